"""Solids that are inside out: things are seen from outside, so a bowl needs better views to be believed than a dome."""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.arrays import Array, Mask
from reconstruction.mapping.solid.bundle import Bundle

FROM_INSIDE = 1.0  # times more of the energy of a bowl, as far as what it leaves over is no noise but deformation


def disbelief(bundle: Bundle, W: Array, seen: Mask, places: Array) -> float:
    """How many times its energy is to count, of views W (K, 2, p) with visibility (K, p): 1 if it is no bowl, or fits.

    Args:
        bundle: what explains them.
        W: relative to the principal point, as `bundle.image()`; anything where not visible.
        seen: (K, p).
        places: where points (2, p) are beside each other.
    """
    bowl = hollow(bundle, seen[0]) if bundle.kappa else 0.0
    return 1 + FROM_INSIDE * bowl * alike_beside(bundle.image() - W, seen, places) if bowl else 1.0


def hollow(bundle: Bundle, seen: Mask) -> float:
    """How much of a bowl points (p,) seen in the first view are: how far their depth off a plane goes with one's, up to 1.

    0 where those in the middle are nearer than those around.
    """
    x, y, z = bundle.placed()[0][:, seen]
    bowl = x * x + y * y
    plane = np.stack([x, y, np.ones_like(x)]).T
    z, bowl = (values - plane @ np.linalg.lstsq(plane, values, rcond=None)[0] for values in (z, bowl))
    return float(max(0.0, -z @ bowl / max(np.linalg.norm(z) * np.linalg.norm(bowl), np.finfo(float).tiny)))


def alike_beside(off: Array, seen: Mask, places: Array) -> float:
    """The share of squared residuals (K, 2, p) that points (2, p) have in common with their nearest: 0 of noise.

    Medians of what is seen (K, p), against gross errors.
    """
    beside = np.asarray(cKDTree(places.T).query(places.T, k=2)[1])[:, 1]
    both = seen & seen[:, beside]
    if not both.any():
        return 0.0
    whole, apart = (float(np.median((left**2).sum(axis=1)[both])) for left in (off, off - off[:, :, beside]))
    return float(max(0.0, 1 - apart / 2 / max(whole, np.finfo(float).tiny)))
