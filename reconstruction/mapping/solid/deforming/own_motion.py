"""How each point of a solid moves by itself: modes should tell apart what does not move together, however near it is.

Distances in the rest shape know nothing of joints: a lid that touches its box would take the box along. What the rigid
shape leaves over in keyframes tells them apart, and is one more place of a point, beside that in the rest shape, for the
dissimilarity D that the modes come from. Gaps are filled by probabilistic principal components (Tipping and Bishop 1999).
"""

import numpy as np

from reconstruction.arrays import Array, Mask

TOGETHER = 4.0  # so many times as far apart as they move by themselves, RMS, points count as lying
COMPONENTS = 8  # ways to move
SWEEPS = 10  # of expectation and maximisation


def own_motion(left_over: Array, visible: Mask) -> Array:
    """Further coordinates (d, p) of points, in units of what is left over: how far apart they are is how they move apart.

    Args:
        left_over: (K, 2, p) what a rigid shape does not explain of keyframes; anything where not visible.
        visible: (K, p), gross errors not among it.
    """
    K, _, p = left_over.shape
    seen = np.repeat(visible, 2, axis=0)
    known = np.where(seen, left_over.reshape(2 * K, p), 0.0)
    filled, count, total = known, min(COMPONENTS, p, 2 * K), max(int(seen.sum()), 1)
    noise, tiny = (known**2).sum() / total, np.finfo(float).tiny ** 0.5
    for _ in range(SWEEPS):
        variances, ways = (found[..., -count:] for found in np.linalg.eigh(filled @ filled.T / p))
        gram = np.einsum("fi,fp,fj->pij", ways, seen, ways, optimize=True)
        inverse = np.linalg.inv(gram + np.diag((noise + tiny) / np.maximum(variances, tiny)))
        places = (inverse @ (ways.T @ known).T[:, :, None])[:, :, 0].T
        filled = np.where(seen, known, ways @ places)
        taken = float(np.einsum("pij,pji->", inverse, gram))  # by the places, of what is known
        noise = ((known - ways @ places)[seen] ** 2).sum() / max(total - taken, 1.0)
    return TOGETHER * places / np.sqrt(K)
