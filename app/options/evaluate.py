"""What a person can choose of `evaluate`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import tyro

from app.options.shared import FinalPass, FromTracks, Json, Overwrite
from app.terminal.errors import UsageError


@dataclass(frozen=True)
class Evaluate(Json, Overwrite, FinalPass, FromTracks):
    """Reconstruct from given tracks and score against the truth in the file.

    Examples:
      modeshape evaluate tracks.npz --rest-shape first-truth --deformation bending
      modeshape evaluate tracks.npz --missing 0.4 --seed 0 --json
    """

    ESSENTIAL: ClassVar = (
        *("tracks", "rest_shape", "camera", "focal", "deformation", "missing", "noise", "outliers", "seed", "shapes_out"),
        *("final_pass", "json", "verbose"),
    )

    tracks: tyro.conf.Positional[Path]
    """Tracks (.npz, .mat): W (F, 2, P), visible (F, P), and K, S_gt, gt_frames where known."""
    missing: float = 0.0
    """Share of the entries hidden at random."""
    noise: float = 0.0
    """Gaussian noise, as a share of the largest distance of a point to the centroid."""
    outliers: float = 0.0
    """Share of the entries put anywhere among the others."""
    seed: int = 0
    """Of the noise, the hidden entries and the outliers."""
    shapes_out: Path | None = None
    """Save the shapes as .npz: S (F, 3, P) camera axes, R, s, t, Lambda, faces, visible."""

    def __post_init__(self) -> None:
        for name, share in (("missing", self.missing), ("outliers", self.outliers)):
            if not 0 <= share < 1:
                raise UsageError(f"--{name} {share} is no share: give 0 to less than 1")
        if not 0 <= self.noise < float("inf"):
            raise UsageError(f"--noise {self.noise} is no noise level: give 0 and more")
        if self.seed < 0:
            raise UsageError(f"--seed {self.seed} is no seed: give 0 and more")
