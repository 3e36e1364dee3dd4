"""What can be chosen about a reconstruction; imports nothing heavy, so that a command line can read it at once."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

from reconstruction import ReconstructionError

Metric = Literal["euclidean", "manhattan", "mahalanobis", "chi-squared", "jensen-shannon"]
MetricChoice = Literal["auto", Metric]
Deformation = Literal["auto", "bending", "stretching", "general", "inextensible"]
RecoveredRestShape = Literal["auto", "solid", "sheet", "rigid", "plane"]
FIRST_LOOKS = (10, 15, 20, 30, 45, 60)  # frames after which a first model is looked for; the last decides
USUAL_MODES = 20
MORE_MODES = 40  # of what deforms and is seen well
MOST_MODES = 80  # of solids that deform, when time is no matter
PriorName = Literal["rest", "smoothness", "rotation", "scale", "inextensibility"]
EnergyName = Literal["anchored", "paper"]
CHOICES = {  # of Settings
    "rest_shape": get_args(RecoveredRestShape),
    "metric": ("auto", *get_args(Metric)),
    "deformation": get_args(Deformation),
    "energy": get_args(EnergyName),
}


@dataclass(frozen=True)
class Settings:
    """How to reconstruct.

    Raises:
        ReconstructionError: a value that cannot be used; `about` is the field's name.
    """

    rest_shape: RecoveredRestShape = "auto"
    """How the rest shape is found: by all frames, which may be told whether it is a solid or sheet; or by the first alone,
    rigid or flat. A given one overrides it."""
    bootstrap_frames: Literal["auto"] | int = "auto"
    """Frames the rest shape comes from; auto decides from the evidence."""
    metric: MetricChoice = "auto"
    """Distance between points that the modes come from: straight, along the mesh's edges, in units of the extent along
    each axis, chi-squared of the coordinates, or Jensen-Shannon of the nearness to landmarks. Auto: Jensen-Shannon for a
    solid rest shape, chi-squared for a flat one."""
    modes: Literal["auto"] | int = "auto"
    """Number of modes r. Auto: 20; 40 for a solid whose keyframes show that it deforms, 80 in the final pass; 40 for a
    sheet that they have found, 60 in the final pass."""
    deformation: Deformation = "auto"
    """How the surface may deform: bend out of its plane, drawing in as a sheet does; in its plane; freely; freely, but
    nearly keeping its lengths. Auto: general for a solid rest shape, inextensible for a flat one."""
    window: int = 3
    """Frames adjusted together."""
    energy: EnergyName = "anchored"
    """Anchored: tied to the past and pulled to rest. Paper: the paper's section 5 as printed (orthographic)."""
    priors: Mapping[str, float] = field(default_factory=dict, hash=False)
    """Weights of the energy's priors instead of its own, 0 for none: rest, smoothness, rotation, scale,
    inextensibility."""
    refine_rest: bool = True
    """Let later frames improve the rest shape of a sheet. Not with the paper's energy."""
    uncertainty: bool = False
    """Estimate a standard deviation for each vertex of each frame, too."""
    estimate_focal: bool = False
    """Find the focal length of a perspective camera, where the frames hold it."""
    revise: bool = True
    """Make the model anew whenever the views have grown; without it the first frames decide for good."""

    @property
    def maps(self) -> bool:
        """Whether keyframes say what the object is: not with one of the first frames or the paper's energy."""
        return self.revise and self.rest_shape not in ("rigid", "plane") and self.energy != "paper"

    @property
    def kind(self) -> Literal["solid", "sheet"] | None:
        """What the object is, if that is told; keyframes say the rest."""
        return self.rest_shape if self.rest_shape in ("solid", "sheet") else None

    def __post_init__(self) -> None:
        for name, choices in CHOICES.items():
            if (value := getattr(self, name)) not in choices:
                raise ReconstructionError(f"{name} {value!r} is unknown: choose from {', '.join(choices)}", name)
        if self.bootstrap_frames != "auto" and self.bootstrap_frames < 2:
            problem = f"bootstrap_frames {self.bootstrap_frames} is too few: give auto, or 2 and more"
            raise ReconstructionError(problem, "bootstrap_frames")
        if self.modes != "auto" and self.modes < 1:
            raise ReconstructionError(f"modes {self.modes} is too few: give 1 and more", "modes")
        if self.window < 1:
            raise ReconstructionError(f"window {self.window} is too short: give 1 and more", "window")
        names = get_args(PriorName)
        for name, weight in self.priors.items():
            if name not in names:
                raise ReconstructionError(f"there is no prior {name}: choose from {', '.join(names)}", "priors")
            if not 0 <= weight < float("inf"):
                problem = f"{weight:g} is no weight for the prior {name}: give 0 (to leave it out) or more"
                raise ReconstructionError(problem, "priors")
