"""What a person can choose about the model, for every command that reconstructs; nothing heavy is imported here."""

from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from app.terminal.errors import UsageError
from reconstruction import ReconstructionError
from reconstruction.window.priors import Weights, check


@dataclass(frozen=True)
class Model:
    """What is reconstructed, and how."""

    bootstrap_frames: Literal["auto"] | int = "auto"
    """Frames the rest shape comes from; auto decides from the evidence."""
    metric: Literal["auto", "euclidean", "manhattan", "mahalanobis", "chi-squared", "jensen-shannon"] = "auto"
    """Distance between points that the modes come from: straight, along the mesh's edges, in units of the extent along
    each axis, chi-squared of the coordinates, or Jensen-Shannon of the nearness to landmarks. Auto: Jensen-Shannon for a
    solid rest shape, chi-squared for a flat one."""
    modes: int = 20
    """Number of modes r."""
    deformation: Literal["auto", "bending", "stretching", "general", "inextensible"] = "auto"
    """How the surface may deform: bend out of its plane, drawing in as a sheet does; in its plane; freely; freely, but
    nearly keeping its lengths. Auto: general for a solid rest shape, inextensible for a flat one."""
    window: int = 3
    """Frames adjusted together."""
    energy: Literal["anchored", "paper"] = "anchored"
    """Anchored: tied to the past and pulled to rest. Paper: the paper's section 5 as printed (orthographic)."""
    priors: Annotated[str | None, tyro.conf.arg(metavar="NAME=WEIGHT,…")] = None
    """Weights of the energy's priors instead of its own, 0 for none: rest, smoothness, rotation, translation, scale,
    inextensibility."""
    refine_rest: bool = True
    """Let later frames improve the rest shape. Not with --energy paper."""
    focal: float | Literal["auto"] | None = None
    """Focal length in pixels; auto: from the first frames where they hold it, as a run has it without this option, else the
    picture's width. Without it, evaluate takes that of the file."""

    def __post_init__(self) -> None:
        if self.bootstrap_frames != "auto" and self.bootstrap_frames < 2:
            raise UsageError(f"--bootstrap-frames {self.bootstrap_frames} is too few: give auto, or 2 and more")
        if self.modes < 1:
            raise UsageError(f"--modes {self.modes} is too few: give 1 and more")
        if self.window < 1:
            raise UsageError(f"--window {self.window} is too short: give 1 and more")
        if isinstance(self.focal, float) and not self.focal > 0:
            raise UsageError(f"--focal {self.focal} is no focal length: give pixels, more than 0")
        try:
            check(self.weights)
        except ReconstructionError as error:
            raise UsageError(f"--priors {self.priors}: {error}") from error

    @property
    def weights(self) -> Weights:
        """The weights of `priors` by name.

        Raises:
            UsageError: not of that form.
        """
        try:
            pairs = (part.split("=") for part in self.priors.split(",")) if self.priors else ()
            return {name.strip(): float(weight) for name, weight in pairs}
        except ValueError:
            raise UsageError(
                f"--priors {self.priors} is no list of NAME=WEIGHT: give for instance rest=0.02,inextensibility=3"
            ) from None
