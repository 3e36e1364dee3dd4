"""Branches of one picture: a surface bent or tilted otherwise can look alike, and only its energy tells (paper §5)."""

from dataclasses import dataclass

import numpy as np

from reconstruction.window.solver import Solution

SAME_BEND = 0.9  # cosine between two bends from which they count as one
SAME_TILT_DEGREES = 5.0  # turn between two poses up to which they count as one


@dataclass(frozen=True)
class Switch:
    """A frame whose window took another branch than the frames before lead to.

    Attributes:
        bend: cosine between the bends Γ_τ of the two branches: 1 is the same, −1 the mirror image.
        turned_degrees: rotation between their poses.
        share: energy of the branch taken over that of the one left.
    """

    bend: float
    turned_degrees: float
    share: float

    def at(self, frame: int) -> str:
        """In words: `bent back at frame 61: energy 0.62 of the other branch`."""
        bent = "" if self.bend >= SAME_BEND else "bent back" if self.bend < 0 else "bent otherwise"
        tilted = f"tilted by {self.turned_degrees:.0f}°" if self.turned_degrees > SAME_TILT_DEGREES else ""
        what = " and ".join(filter(None, (bent, tilted)))
        return f"{what} at frame {frame}: energy {self.share:.2f} of the other branch"


def switch_between(left: Solution, taken: Solution) -> Switch | None:
    """The switch from one branch to another, by their newest frames; None if those are the same but for details."""
    bends = left.state.Lambda[-1, 2], taken.state.Lambda[-1, 2]
    size = np.linalg.norm(bends[0]) * np.linalg.norm(bends[1])
    bend = float(bends[0] @ bends[1] / size) if size > 0 else 1.0
    turned = float(np.rad2deg(2 * np.arccos(min(1.0, abs(left.state.q[-1] @ taken.state.q[-1])))))
    if bend >= SAME_BEND and turned <= SAME_TILT_DEGREES:
        return None
    return Switch(bend, turned, float(taken.value.sum() / left.value.sum()))
