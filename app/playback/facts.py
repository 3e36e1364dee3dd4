"""What a recording says about its run as a whole."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from app.arrays import Array, Indices
from app.playback.measures import Measures
from app.playback.playback import Playback
from app.terminal.summary import Summary

Row = Mapping[str, Any]

WORST_FRAMES = 5
WORST_APART = 5  # frames: neighbours of a bad frame are bad for the same reason
SCORES = ("e3d", "e3d_camera", "e3d_static", "e3d_sign_free", "truth_points", "truth_frames")


@dataclass(frozen=True)
class Facts(Summary):
    """A recording's facts; None where something is not known.

    Attributes:
        phases: phase, first and last frame of each, in the order in which they happened.
        visible_share: of the points: mean, min and last.
        reprojection_px: mean, median, p95, max and rms of the reprojection errors.
        worst_frames: frame, time_s and rms_px of the frames with the largest errors.
        stage_ms: mean, p95 and max milliseconds by stage, and in total.
        events: frame, time_s, level and text.
    """

    recording: Path
    version: str
    source: object
    verdict: object
    verdict_reason: object
    frames: int
    first_frame: int
    last_frame: int
    duration_s: float
    frames_with_shape: int
    phases: Sequence[Row]
    rest_shape: object
    rest_shape_note: object
    deformation: object
    points: int
    metric: object
    modes: object
    visible_share: Mapping[str, float]
    point_losses: int
    point_recoveries: int
    reprojection_px: Mapping[str, float] | None
    worst_frames: Sequence[Row]
    stage_ms: Mapping[str, Mapping[str, float]]
    fps: float | None
    e3d: float | None
    e3d_camera: float | None
    e3d_static: float | None
    e3d_sign_free: float | None
    truth_points: int | None
    truth_frames: int | None
    notes: Sequence[str]
    events: Sequence[Row]
    configuration: Row


def facts(playback: Playback, measured: Measures) -> Facts:
    """The facts of a recording, ready for JSON."""
    configuration = playback.configuration
    summary: Row = playback.summary or {}
    frames = playback.frames
    seen = measured.residual_px[np.isfinite(measured.residual_px)]
    rms = {"rms": float(np.sqrt(np.mean(seen**2))), "median": float(np.median(seen))} if seen.size else {}
    infos = [text for _, _, level, text in playback.events if level == "INFO"]
    stages = [*playback.stage_ms.items(), ("total", measured.total_ms)]
    return Facts(
        recording=playback.path,
        version=playback.version,
        source=configuration.get("source"),
        verdict=summary.get("verdict"),
        verdict_reason=summary.get("verdict_reason"),
        frames=len(frames),
        first_frame=int(frames[0]),
        last_frame=int(frames[-1]),
        duration_s=float(playback.times_s[-1] - playback.times_s[0]),
        frames_with_shape=int(playback.shaped.sum()),
        phases=[{"phase": name, "first": a, "last": b} for name, a, b in phase_ranges(playback)],
        rest_shape=summary.get("rest_shape", configuration.get("rest_shape")),
        rest_shape_note=summary.get("rest_shape_note", infos[0] if infos and playback.recorded_model else None),
        deformation=summary.get("deformation", configuration.get("deformation")),
        points=playback.visible.shape[1],
        metric=summary.get("metric", configuration.get("metric")),
        modes=playback.estimates.Lambda.shape[2] if playback.recorded_model else configuration.get("modes"),
        visible_share={
            "mean": float(measured.visible_share.mean()),
            "min": float(measured.visible_share.min()),
            "last": float(measured.visible_share[-1]),
        },
        point_losses=int(measured.lost.sum()),
        point_recoveries=int(measured.recovered.sum()),
        reprojection_px=statistics(seen) | rms if seen.size else None,
        worst_frames=worst_frames(frames, playback.times_s, measured.rms_px),
        stage_ms={name: statistics(values[np.isfinite(values)]) for name, values in stages if np.isfinite(values).any()},
        fps=summary.get("fps"),
        **finite({name: summary.get(name) for name in SCORES}),
        notes=playback.notes,
        events=[
            {"frame": frame, "time_s": time_s, "level": level, "text": text}
            for frame, time_s, level, text in playback.events
        ],
        configuration=finite(configuration),
    )


def finite(values: Row) -> dict[str, Any]:
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
