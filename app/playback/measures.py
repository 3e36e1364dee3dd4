"""What a recording says about its run: measures per frame, and a summary of them in words and numbers."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

import numpy as np

from app.arrays import Array, Indices
from app.options.run import Words
from app.playback.playback import Playback

WORST_FRAMES = 5
WORST_APART = 5  # frames: neighbours of a bad frame are bad for the same reason
SCORES = ("e3d", "e3d_camera", "e3d_static", "e3d_sign_free", "truth_points", "truth_frames")
PARAMETERS = ("qw", "qx", "qy", "qz", "tx_px", "ty_px", "s")
ROWS = ("alpha", "beta", "tau")


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
    if playback.modelled is not None:
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


def as_words(playback: Playback, measured: Measures) -> Words:
    """A recording's facts, ready for JSON; None where something is not known."""
    summary, frames = playback.summary or {}, playback.frames
    seen = measured.residual_px[np.isfinite(measured.residual_px)]
    infos = [text for _, _, level, text in playback.events if level == "INFO"]
    words: Words = {
        "recording": str(playback.path),
        "version": playback.version,
        "source": playback.configuration.get("source"),
        "frames": len(frames),
        "first_frame": int(frames[0]),
        "last_frame": int(frames[-1]),
        "duration_s": float(playback.times_s[-1] - playback.times_s[0]),
        "frames_with_shape": int(playback.shaped.sum()),
        "phases": [{"phase": name, "first": a, "last": b} for name, a, b in phase_ranges(playback)],
        "rest_shape": summary.get("rest_shape", playback.configuration.get("rest_shape")),
        "rest_shape_note": summary.get("rest_shape_note", infos[0] if infos and playback.modelled else None),
        "deformation": summary.get("deformation", playback.configuration.get("deformation")),
        "points": playback.visible.shape[1],
        "metric": summary.get("metric", playback.configuration.get("metric")),
        "modes": playback.Lambda.shape[2] if playback.modelled else playback.configuration.get("modes"),
        "visible_share": {
            "mean": float(measured.visible_share.mean()),
            "min": float(measured.visible_share.min()),
            "last": float(measured.visible_share[-1]),
        },
        "losses": int(measured.lost.sum()),
        "recoveries": int(measured.recovered.sum()),
        "reprojection_px": statistics(seen) | {"rms": float(np.sqrt(np.mean(seen**2))), "median": float(np.median(seen))}
        if seen.size
        else None,
        "worst_frames": worst_frames(frames, playback.times_s, measured.rms_px),
        "stage_ms": {
            name: statistics(values[np.isfinite(values)])
            for name, values in [*playback.stage_ms.items(), ("total", measured.total_ms)]
            if np.isfinite(values).any()
        },
        "fps": summary.get("fps"),
    }
    words |= finite({name: summary.get(name) for name in SCORES})
    events = [{"frame": frame, "time_s": t, "level": level, "text": text} for frame, t, level, text in playback.events]
    return words | {"notes": list(playback.notes), "events": events, "configuration": finite(playback.configuration)}


def finite(values: Words) -> Words:
    """The same without what JSON has no number for, as an orthographic camera's focal length."""
    return {name: None if isinstance(v, float) and not np.isfinite(v) else v for name, v in values.items()}


def statistics(values: Array) -> dict[str, float]:
    """Mean, 95th percentile and maximum."""
    return {"mean": float(values.mean()), "p95": float(np.percentile(values, 95)), "max": float(values.max())}


def phase_ranges(playback: Playback) -> list[tuple[str, int, int]]:
    """Each phase with its first and last frame, in the order in which they happened."""
    ranges = []
    for name, rows in groupby(zip(playback.phases, playback.frames.tolist(), strict=True), key=lambda row: row[0]):
        numbers = [frame for _, frame in rows]
        ranges.append((name, numbers[0], numbers[-1]))
    return ranges


def worst_frames(frames: Indices, times_s: Array, rms_px: Array) -> list[dict[str, float]]:
    """The frames with the largest RMS error, worst first, none next to another."""
    chosen: list[int] = []
    for i in np.argsort(-np.nan_to_num(rms_px, nan=-1.0), kind="stable").tolist():
        if np.isfinite(rms_px[i]) and all(abs(i - other) >= WORST_APART for other in chosen):
            chosen.append(i)
        if len(chosen) == WORST_FRAMES:
            break
    return [{"frame": int(frames[i]), "time_s": float(times_s[i]), "rms_px": float(rms_px[i])} for i in chosen]


def per_frame(one: Reviewed) -> dict[str, list[object]]:
    """Columns with one entry per frame; NaN as None."""
    playback, measured = one.playback, one.measured
    numbers: dict[str, Array] = {
        "visible_share": measured.visible_share,
        "error_rms_px": measured.rms_px,
        "error_mean_px": measured.mean_px,
        **{f"error_{name}_px": measured.errors(q) for name, q in (("median", 50), ("p95", 95), ("max", 100))},
        **{f"{stage}_ms": values for stage, values in playback.stage_ms.items()},
        **dict(zip(PARAMETERS, (*playback.quaternion.T, *playback.t.T, playback.s), strict=True)),
        **{f"Lambda_{row}_px": np.linalg.norm(playback.Lambda[:, k], axis=1) for k, row in enumerate(ROWS)},
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
