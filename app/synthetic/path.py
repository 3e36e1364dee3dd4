"""How a thing is turned and moved before the camera."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.arrays import Array


@dataclass(frozen=True)
class Path:
    """A smooth path of poses, its phases by a seed.

    Attributes:
        turn_deg: how far the thing is turned from its first view.
        late: share of the video in which it is held almost still before.
        away: its distance, in its widths.
        phase: (6,) rad.
    """

    turn_deg: float
    late: float
    away: float
    phase: Array

    def pose(self, time: float) -> tuple[Array, Array]:
        """Rotation (3, 3) and place (3,), in widths, at a time from 0 to 1."""
        a, b, c, d, e, f = self.phase
        turning = max(0.0, (time - self.late) / (1 - self.late))
        swing, bow = np.sin(1.3 * np.pi * turning), np.sin(2 * np.pi * turning + b) - np.sin(b)
        towards = np.array([np.cos(a), np.sin(a)])
        aside = np.array([-towards[1], towards[0]])
        vector = np.append(swing * towards + 0.35 * bow * aside, 0.2 * np.sin(2 * turning)) * np.deg2rad(self.turn_deg)
        held = 0.03 * np.sin(2 * np.pi * (np.array([2.0, 3.0, 1.0]) * time) + [c, d, e])  # a hand is never quite still
        R = Rotation.from_rotvec(vector).as_matrix() @ Rotation.from_rotvec(held).as_matrix()
        wander = 0.08 * np.sin(2 * np.pi * time * np.array([1.0, 1.5, 1.0]) + [d, e, f])
        return np.asarray(R), np.array([0.0, 0.0, self.away]) + wander
