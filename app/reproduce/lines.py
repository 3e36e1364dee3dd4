"""The settings that are reported throughout."""

from dataclasses import dataclass
from pathlib import Path

from app.config import Evaluate
from app.config_model import Model


@dataclass(frozen=True)
class Line:
    """A setting that is reported throughout: tracks, how they are reconstructed, and what that is called."""

    name: str
    file: str
    rest_shape: str
    deformation: str
    modes: int = 20
    bootstrap_frames: int | None = None
    missing: float = 0.0

    def config(self, data: Path, **changed: object) -> Evaluate:
        """The command, with some options changed: missing, noise, seed, modes, metric, deformation."""
        options: dict[str, object] = {"missing": self.missing}
        model: dict[str, object] = {"modes": self.modes, "deformation": self.deformation}
        if self.bootstrap_frames:
            model["bootstrap_frames"] = self.bootstrap_frames
        for name, value in changed.items():
            (options if name in ("missing", "noise", "seed", "shapes_out") else model)[name] = value
        return Evaluate(data / self.file, rest_shape=self.rest_shape, model=Model(**model), **options)  # type: ignore[arg-type]


FLAG = Line("flag250, first shape given", "flag250.npz", "first-truth", "bending")
FLAG_RIGID = Line("flag250, rest shape from 15 frames", "flag250.npz", "rigid", "bending", bootstrap_frames=15)
FLAG_PERSPECTIVE = Line(
    "flag250 in perspective, first shape given", "flag250_perspective.npz", "first-truth", "inextensible"
)
FACE = Line("face37, rest shape from its first frames", "face37.npz", "rigid", "general", modes=30)
