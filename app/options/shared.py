"""Groups of options that several commands share; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

import tyro

from app.options.model import Model


@dataclass(frozen=True, kw_only=True)
class Json:
    """How the summary is printed."""

    json: bool = False
    """Print the summary as JSON on stdout."""
    verbose: bool = False
    """Print all that is known, not the most important lines."""


@dataclass(frozen=True, kw_only=True)
class Overwrite:
    """What happens to files of the same names."""

    overwrite: bool = False
    """Replace existing files."""


@dataclass(frozen=True, kw_only=True)
class FromTracks:
    """How given tracks are reconstructed."""

    rest_shape: Annotated[str, tyro.conf.arg(metavar="auto|solid|sheet|rigid|plane|first-truth|PATH")] = "auto"
    """Where the rest shape of tracks comes from: all frames (auto, or told what it is: solid, sheet), the first ones alone
    (rigid, plane), the first true shape, or a mesh file."""
    camera: Literal["auto", "perspective", "orthographic"] = "auto"
    """Auto: perspective if the tracks have K; without it the one under which what is seen changes less, by all frames,
    orthographic in doubt, with --no-final-pass, and with a rest shape from elsewhere or the first frames."""
    model: tyro.conf.OmitArgPrefixes[Model] = field(default_factory=Model)


@dataclass(frozen=True, kw_only=True)
class FinalPass:
    """What happens when the last frame is done."""

    final_pass: bool = True
    """Reconstruct all frames once more with what is known of the surface at the end; not of cameras and streams."""


@dataclass(frozen=True, kw_only=True)
class Online:
    """Which shapes of a recording are meant."""

    online: bool = False
    """The shapes as they were shown on the way, before the final pass, if the run was told to --keep-online."""
