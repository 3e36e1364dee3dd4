"""How each point of a solid moves by itself: modes should tell apart what does not move together, however near it is.

Distances in the rest shape know nothing of joints: a lid that touches its box would take the box along. What the rigid
shape leaves over in keyframes tells them apart, and is one more place of a point, beside that in the rest shape, for the
dissimilarity D that the modes come from.
"""

import numpy as np

from reconstruction.arrays import Array, Mask

TOGETHER = 4.0  # so many times as far apart as they move by themselves, RMS, points count as lying
COMPONENTS = 8  # ways to move
SWEEPS = 5  # to fill what is hidden
RIDGE = 0.1  # of a whole track: points that are seldom seen are said to move less


def own_motion(left_over: Array, visible: Mask) -> Array:
    """Further coordinates (d, p) of points, in units of what is left over: how far apart they are is how they move apart.

    Args:
        left_over: (K, 2, p) what a rigid shape does not explain of keyframes; anything where not visible.
        visible: (K, p), gross errors not among it.
    """
    K, _, p = left_over.shape
    seen = np.repeat(visible, 2, axis=0)
    known = np.where(seen, left_over.reshape(2 * K, p), 0.0)
    filled, count = known, min(COMPONENTS, p, 2 * K)
    for _ in range(SWEEPS):
        ways = np.linalg.svd(filled, full_matrices=False)[0][:, :count]
        gram = np.einsum("fi,fp,fj->pij", ways, seen, ways, optimize=True) + RIDGE * np.eye(count)
        places = np.linalg.solve(gram, (ways.T @ known).T[:, :, None])[:, :, 0].T
        filled = np.where(seen, known, ways @ places)
    return TOGETHER * places / np.sqrt(K)
