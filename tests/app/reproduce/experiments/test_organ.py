"""The synthetic organ."""

import numpy as np
import pytest

from app.reproduce.experiments.organ import POINTS, REST_FRAMES, organ, organ_tracks
from reconstruction.evaluation import e3d


def test_the_organ_rests_then_beats_and_stretches() -> None:
    surface = organ()
    assert surface.rest.shape == (3, POINTS)
    np.testing.assert_allclose(surface.beating(REST_FRAMES), surface.rest)
    beating = np.stack([surface.beating(f) for f in range(REST_FRAMES, REST_FRAMES + 24)])
    changes = np.linalg.norm(beating - surface.rest, axis=(1, 2)) / np.linalg.norm(surface.rest)
    assert 0.05 < changes.max() < 0.3
    a, b = np.random.default_rng(0).integers(POINTS, size=(2, 50))
    lengths = np.linalg.norm(beating[:, :, a] - beating[:, :, b], axis=1)
    assert (np.ptp(lengths, axis=0) > 0.03 * lengths[0]).mean() > 0.9


def test_the_organ_is_seen_with_little_noise() -> None:
    tracks = organ_tracks(20, 80)
    assert tracks.K is not None
    assert tracks.S_gt is not None
    image = tracks.K @ tracks.S_gt
    assert (tracks.W - image[:, :2] / image[:, 2:]).std() == pytest.approx(0.3, rel=0.1)
    assert e3d(np.broadcast_to(tracks.S_gt[0], (REST_FRAMES, 3, 80)), tracks.S_gt[:REST_FRAMES]).max() < 1e-9
