"""The frames of a recording, and where its points were seen in them."""

from dataclasses import dataclass
from typing import cast

import numpy as np

from app.arrays import Array, Flags, Indices
from app.playback.chunks import Rows
from app.recording import entities

OBSERVATION = "modeshape.Observation:"
POSITIONS = "Points2D:positions"


@dataclass(frozen=True)
class Observations:
    """The part of a recording that every frame has; F frames, P points.

    Attributes:
        frames: (F,) numbers of the frames in their source.
        times_s: (F,) their times.
        phases: (F) phase of the run at each.
        W: (F, 2, P) observed px, NaN where not visible.
        visible: (F, P) whether a point was seen.
    """

    frames: Indices
    times_s: Array
    phases: list[str]
    W: Array
    visible: Flags


def read_observations(rows: Rows) -> Observations | None:
    """Frames and observations, or None if there is not a single frame.

    Raises:
        ValueError: the points and their visibility disagree.
    """
    observed = rows.last(entities.OBSERVATION, f"{OBSERVATION}visible")
    seen = rows.last(entities.SEEN, POSITIONS)
    phases = rows.last(entities.OBSERVATION, f"{OBSERVATION}phase")
    numbers = sorted(observed.keys() & seen.keys() & phases.keys())  # what was cut off may have one without another
    if not numbers:
        return None
    visible = np.stack([cast(Flags, observed[k].value) for k in numbers])
    points = np.full((*visible.shape, 2), np.nan)
    positions = np.concatenate([cast(Array, seen[k].value) for k in numbers])
    if len(positions) != visible.sum():
        raise ValueError("the points and their visibility disagree")
    points[visible] = positions
    return Observations(
        frames=np.array(numbers, np.int64),
        times_s=np.array([observed[k].time_s for k in numbers]),
        phases=[cast(list[str], phases[k].value)[0] for k in numbers],
        W=points.transpose(0, 2, 1).copy(),
        visible=visible,
    )
