"""Tracks in a temporary file: read as they were written, as often as wanted."""

import numpy as np

from app.files.stored_tracks import AHEAD, StoredFrame, StoredTracks
from tracking.observation import Observation


def test_frames_come_back_as_they_were() -> None:
    rng = np.random.default_rng(0)
    frames = [
        StoredFrame(7 + k, k / 3, Observation(rng.normal(size=(5, 2)) * 100, rng.random(5) < 0.5), lost=k == 2)
        for k in range(4)
    ]
    frames[1].observation.points_px[0] = np.nan
    stored = StoredTracks(5)
    for one in frames:
        stored.add(one)
    for _ in range(2):
        again = list(stored)
        assert [(one.index, one.time_s, one.lost) for one in again] == [(f.index, f.time_s, f.lost) for f in frames]
        for one, frame in zip(again, frames, strict=True):
            np.testing.assert_array_equal(one.observation.points_px, frame.observation.points_px)
            np.testing.assert_array_equal(one.observation.visible, frame.observation.visible)


def test_nothing_stored_is_nothing_read() -> None:
    assert list(StoredTracks(3)) == []


def test_frames_are_told_before_their_turn() -> None:
    stored, told = StoredTracks(1), 0
    for k in range(2 * AHEAD + 5):
        stored.add(StoredFrame(k, k / 30, Observation(np.full((1, 2), k), np.ones(1, bool)), lost=k % 7 == 0))

    def tell(some: list[Observation]) -> None:
        nonlocal told
        told += len(some)

    seen = 0
    for k, one in enumerate(stored.told_ahead(tell)):
        assert one.index == k
        seen += not one.lost
        assert told >= min(seen + AHEAD // 2, 2 * AHEAD + 5 - 10)
    assert told == seen
