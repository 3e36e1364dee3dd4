"""What a recording says about its run, frame by frame."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.arrays import Array, Indices
from app.playback.playback import Playback
from reconstruction.basis.modal_basis import ROW_NAMES

PARAMETERS = ("qw", "qx", "qy", "qz", "tx_px", "ty_px", "s")


@dataclass(frozen=True)
class Measures:
    """Measures of F frames, NaN where there are none.

    Attributes:
        residual_px: (F, P) reprojection error of every point.
        visible_share: (F,) of the points, 0 to 1.
        lost: (F,) points seen in the frame before and not in this one.
        recovered: (F,) points not seen in the frame before and seen in this one.
        total_ms: (F,) of all stages.
    """

    residual_px: Array
    visible_share: Array
    lost: Indices
    recovered: Indices
    total_ms: Array

    def errors(self, percentile: float) -> Array:
        """A percentile (F,) px of each frame's reprojection errors."""
        return by_frame(self.residual_px, lambda seen: float(np.percentile(seen, percentile)))

    @property
    def rms_px(self) -> Array:
        """(F,) root mean square reprojection error."""
        return by_frame(self.residual_px, lambda seen: float(np.sqrt(np.mean(seen**2))))

    @property
    def mean_px(self) -> Array:
        """(F,) mean reprojection error."""
        return by_frame(self.residual_px, lambda seen: float(seen.mean()))


class Reviewed(NamedTuple):
    """A recording under review."""

    playback: Playback
    measured: Measures
    label: str
    """What tells it from the other."""
    place: int
    """0 for the first, 1 for the second."""


def reviewed(playbacks: list[Playback]) -> list[Reviewed]:
    """Recordings with their measures, labelled by the names of their files, or by the paths if the names are equal."""
    stems = [playback.path.stem for playback in playbacks]
    labels = stems if len(set(stems)) == len(stems) else [str(playback.path) for playback in playbacks]
    return [Reviewed(one, measures(one), labels[k], k) for k, one in enumerate(playbacks)]


def by_frame(residual_px: Array, measure: Callable[[Array], float]) -> Array:
    """A measure (F,) of the finite entries in each row of (F, P); NaN where there are none."""
    rows = (row[np.isfinite(row)] for row in residual_px)
    return np.array([measure(row) if row.size else np.nan for row in rows])


def measures(playback: Playback) -> Measures:
    """Measures of a recording; those of shapes are NaN if it contains none."""
    residual_px = np.full(playback.visible.shape, np.nan)
    if playback.recorded_model is not None:
        for i in np.flatnonzero(playback.shaped):
            estimate = playback.estimate(int(i))
            assert estimate is not None
            residual_px[i] = estimate.residual_px
    visible = playback.visible
    before = np.concatenate([visible[:1], visible[:-1]])
    stages = np.stack(list(playback.stage_ms.values()) or [np.full(len(visible), np.nan)])
    missing = np.isnan(stages).all(axis=0)
    return Measures(
        residual_px,
        visible.mean(axis=1),
        (before & ~visible).sum(axis=1),
        (~before & visible).sum(axis=1),
        np.where(missing, np.nan, np.nansum(stages, axis=0)),
    )


def per_frame(one: Reviewed) -> dict[str, list[object]]:
    """Columns with one entry per frame; NaN as None."""
    playback, poses, measured = one.playback, one.playback.estimates, one.measured
    unit = "mm" if playback.unit == "millimetres" else "px"
    numbers: dict[str, Array] = {
        "visible_share": measured.visible_share,
        "error_rms_px": measured.rms_px,
        "error_mean_px": measured.mean_px,
        **{f"error_{name}_px": measured.errors(q) for name, q in (("median", 50), ("p95", 95), ("max", 100))},
        **{f"{stage}_ms": values for stage, values in playback.stage_ms.items()},
        **dict(zip(PARAMETERS, (*poses.quaternion.T, *poses.t.T, poses.s), strict=True)),
        **{f"Lambda_{row}_{unit}": np.linalg.norm(poses.Lambda[:, k], axis=1) for k, row in enumerate(ROW_NAMES)},
    }
    return {
        "recording": [one.label] * len(playback.frames),
        "frame": playback.frames.tolist(),
        "time_s": playback.times_s.tolist(),
        "phase": list(playback.phases),
        "visible": playback.visible.sum(axis=1).tolist(),
        "lost": measured.lost.tolist(),
        "recovered": measured.recovered.tolist(),
    } | {name: [None if np.isnan(v) else v for v in values.tolist()] for name, values in numbers.items()}
