"""The estimator's settings as options, for every command that reconstructs; nothing heavy is imported here."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import tyro

from app.terminal.errors import UsageError, in_a_line
from reconstruction import ReconstructionError
from reconstruction.settings import RecoveredRestShape, Settings


def parsed_priors(text: str) -> Mapping[str, float]:
    """The weights in `NAME=WEIGHT,…` by name.

    Raises:
        UsageError: not of that form.
    """
    try:
        pairs = (part.split("=") for part in text.split(","))
        return {name.strip(): float(weight) for name, weight in pairs}
    except ValueError:
        raise UsageError(
            f"--priors {text} is no list of NAME=WEIGHT: give for instance rest=0.02,inextensibility=3"
        ) from None


def priors_text(priors: Mapping[str, float]) -> str | None:
    """Weights by name as they are given; None without any."""
    return ",".join(f"{name}={weight:g}" for name, weight in priors.items()) or None


PRIORS = tyro.constructors.PrimitiveConstructorSpec(
    nargs=1,
    metavar="NAME=WEIGHT,…",
    instance_from_str=lambda arguments: parsed_priors(arguments[0]),
    is_instance=lambda value: isinstance(value, Mapping),
    str_from_instance=lambda priors: [str(priors_text(priors))],
)


@dataclass(frozen=True)
class Model(Settings):
    """What is reconstructed, and how."""

    # Each command has its own choice of these two.
    rest_shape: tyro.conf.Suppress[RecoveredRestShape] = "auto"
    estimate_focal: tyro.conf.Suppress[bool] = False
    priors: Annotated[Mapping[str, float], PRIORS] = field(default_factory=dict, hash=False)
    focal: float | Literal["auto"] | None = None
    """Focal length in pixels; auto: found where the views hold it, as a run has it without this option, else the picture's
    width. Without it, evaluate takes that of the file."""

    def __post_init__(self) -> None:
        try:
            super().__post_init__()
        except ReconstructionError as error:
            given = f"--priors {priors_text(self.priors)}: " if error.about == "priors" else ""
            raise UsageError(given + in_a_line(error)) from error
        if isinstance(self.focal, float) and not self.focal > 0:
            raise UsageError(f"--focal {self.focal} is no focal length: give pixels, more than 0")
