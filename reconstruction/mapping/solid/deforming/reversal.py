"""Depth reversals: from far away a thin shape looks nearly alike from in front and from behind (Necker).

Its mirror image in depth is the shape itself, turned by half a turn about the line of sight and by another about the axis
along which it is thin. A rigid shape's poses may be reversed wherever it deforms by more than it is thick. Once
deformations are known in part, they tell: where the pose is right, those of other keyframes explain its image, too. Others
are all but a quarter, in their order: beside each other they are reversed together, and a Gaussian explains what it was
made of.
"""

from dataclasses import replace

import numpy as np

from reconstruction.arrays import Mask
from reconstruction.camera import quaternion_product
from reconstruction.mapping.solid.deforming.deformations import Learned
from reconstruction.mapping.solid.deforming.rounds import Rounds
from reconstruction.state import State, join

PARTS = 4
STEPS = 5
SURELY = 1.0  # more of log likelihood: it is not turned for nothing
SIGHT = THIN = np.array([0.0, 0.0, 0.0, 1.0])  # half turns, about the third axis of the camera, and of the shape


def righted(known: Learned, rounds: Rounds) -> Learned:
    """The same with each keyframe's pose as it is, or reversed, whichever the others make likelier.

    Args:
        known: what a round has found, keyframes in the order of time.
        rounds: what found it.
    """
    K, chosen = len(known.state), list[State]()
    for part in range(PARTS):
        frames = slice(part * K // PARTS, (part + 1) * K // PARTS)
        own, by_others = known.state[frames], rounds.by_others(known, frames)
        starts = own, in_reverse(own)
        tried = [rounds.settled(replace(known, state=one, deformations=by_others), frames, STEPS) for one in starts]
        (own, cost), (other, its_cost) = tried
        better = its_cost < cost - SURELY
        chosen.append(either(own, other, better))
    return replace(known, state=join(chosen))


def either(own: State, other: State, turned: Mask) -> State:
    """Of two states of the same n frames the one, or the other where `turned` (n,)."""
    return join([(other if turns else own)[k : k + 1] for k, turns in enumerate(turned)])


def in_reverse(state: State) -> State:
    """Poses of the undeformed shape, mirrored in depth but for its thickness."""
    q = quaternion_product(quaternion_product(SIGHT, state.q), THIN)
    return replace(state, q=q, Lambda=np.zeros_like(state.Lambda))
