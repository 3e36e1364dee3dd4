"""What each frame with a shape tells of its quality."""

import numpy as np
import pytest

from app.pipeline.quality.course import Course
from reconstruction.estimate import ShapeEstimate

FRAMES, POINTS = 50, 100
NO_POSE = np.zeros(4), np.eye(3), np.zeros(2), 1.0, np.zeros((3, 0))


@pytest.mark.parametrize(("often", "astray"), [(0.1, 0.0), (0.6, 0.05)])
def test_points_that_do_not_move_with_the_rest(often: float, astray: float) -> None:
    """Gross errors come and go, of all points in turn; a part that moves by itself stays away."""
    rng = np.random.default_rng(0)
    projection = 100 * rng.normal(size=(POINTS, 2))
    away = rng.random((FRAMES, POINTS)) < np.repeat([often, 0.1], [5, POINTS - 5])
    course = Course()
    for frame, off in enumerate(away):
        residual_px, seen = np.where(off, 20.0, 0.3), np.ones(POINTS, np.bool_)
        course.add(frame, ShapeEstimate(frame, *NO_POSE, projection.T, projection, residual_px, seen))
    assert course.astray == pytest.approx(astray)
    assert Course().astray == 0.0
