"""Tracks of a whole video in a temporary file: what is known of every frame, for another pass over all of them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from tempfile import TemporaryFile
from typing import BinaryIO

import numpy as np

from app.arrays import Array
from tracking.observation import Observation
from tracking.tracks import Tracks

AHEAD = 30  # frames that are told at a time


@dataclass(frozen=True)
class StoredFrame:
    """What was tracked in a frame.

    Attributes:
        index: of the frame in its source.
        time_s: of the frame.
        observation: its points.
        lost: whether the object was lost.
    """

    index: int
    time_s: float
    observation: Observation
    lost: bool


class StoredTracks:
    """Frames are added, and read again from the first one; memory does not grow with them.

    Args:
        points: in every frame.
    """

    def __init__(self, points: int) -> None:
        point = np.dtype([("px", np.float64, 2), ("visible", np.bool_)])
        self._row = np.dtype([("index", np.int64), ("time_s", np.float64), ("lost", np.bool_), ("points", point, points)])
        self._file = TemporaryFile()  # noqa: SIM115 (goes when this object goes)

    def add(self, stored: StoredFrame) -> None:
        """Keep a frame.

        Raises:
            OSError: the disk is full.
        """
        row = np.zeros((), self._row)
        row["index"], row["time_s"], row["lost"] = stored.index, stored.time_s, stored.lost
        row["points"]["px"], row["points"]["visible"] = stored.observation.points_px, stored.observation.visible
        self._file.write(row.tobytes())

    def __iter__(self) -> Iterator[StoredFrame]:
        self._file.seek(0)
        while len(data := self._file.read(self._row.itemsize)) == self._row.itemsize:  # a full disk may cut off the last
            row = np.frombuffer(data, self._row)[0]
            observation = Observation(row["points"]["px"].copy(), row["points"]["visible"].copy())
            yield StoredFrame(int(row["index"]), float(row["time_s"]), observation, bool(row["lost"]))

    def told_ahead(self, tell: Callable[[list[Observation]], None]) -> Iterator[StoredFrame]:
        """The frames; those in which the object is not lost are told, some at a time, before their turn comes."""
        frames = iter(self)

        def told() -> list[StoredFrame]:
            some = list(islice(frames, AHEAD))
            tell([one.observation for one in some if not one.lost])
            return some

        now = told()
        while now:
            following = told()
            yield from now
            now = following

    def save(self, file: BinaryIO, K: Array | None) -> None:
        """Write them as a track file, with the camera (3, 3) if that is known."""
        tracks = [stored.observation for stored in self]
        W, visible = np.stack([o.points_px.T for o in tracks]), np.stack([o.visible for o in tracks])
        Tracks(W, visible, K=K).save(file)
