"""The settings that are reported throughout."""

from dataclasses import dataclass
from pathlib import Path

from app.options.evaluate import Evaluate
from app.options.model import Model
from reconstruction.settings import MetricChoice


@dataclass(frozen=True)
class Line:
    """A setting that is reported throughout: tracks, how they are reconstructed, and what that is called."""

    name: str
    file: str
    rest_shape: str
    deformation: str
    modes: int = 20
    metric: MetricChoice = Model.metric
    bootstrap_frames: int | None = None
    missing: float = 0.0

    def config(self, data: Path, **changed: object) -> Evaluate:
        """The command, with some options changed: missing, noise, seed, modes, metric, deformation."""
        options: dict[str, object] = {"missing": self.missing}
        model: dict[str, object] = {"modes": self.modes, "deformation": self.deformation, "metric": self.metric}
        if self.bootstrap_frames:
            model["bootstrap_frames"] = self.bootstrap_frames
        for name, value in changed.items():
            (options if name in ("missing", "noise", "seed", "shapes_out") else model)[name] = value
        return Evaluate(data / self.file, rest_shape=self.rest_shape, model=Model(**model), **options)  # type: ignore[arg-type]

    @property
    def setting(self) -> str:
        """In words."""
        straight = ", D_E" if self.metric == "euclidean" else ""
        return f"{self.deformation}, r = {self.modes}{straight}"


FLAG = Line("flag250, first shape given", "flag250.npz", "first-truth", "bending", metric="euclidean")
FLAG_RIGID = Line("flag250, rest shape from 15 frames", "flag250.npz", "rigid", "inextensible", bootstrap_frames=15)
FLAG_PERSPECTIVE = Line(
    "flag250 in perspective, first shape given", "flag250_perspective.npz", "first-truth", "inextensible"
)
FACE = Line("face37, rest shape from its first frames", "face37.npz", "rigid", "general", modes=30)
