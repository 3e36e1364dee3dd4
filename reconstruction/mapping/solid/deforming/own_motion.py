"""How each point of a solid moves by itself: modes should tell apart what does not move together, however near it is.

Distances in the rest shape know nothing of joints: a lid that touches its box would take the box along. What the rigid
shape leaves over in keyframes tells them apart, and is one more place of a point, beside that in the rest shape, for the
dissimilarity D that the modes come from.
"""

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.principal import principal

TOGETHER = 4.0  # so many times as far apart as they move by themselves, RMS, points count as lying
WAYS = 8  # to move


def own_motion(left_over: Array, visible: Mask) -> Array:
    """Further coordinates (d, p) of points, in units of what is left over: how far apart they are is how they move apart.

    Args:
        left_over: (K, 2, p) what a rigid shape does not explain of keyframes; anything where not visible.
        visible: (K, p), gross errors not among it.
    """
    return TOGETHER * principal(left_over, visible, WAYS)[0] / np.sqrt(len(left_over))
