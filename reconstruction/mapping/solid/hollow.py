"""Solids that are inside out: things are seen from outside, so a bowl needs better views to be believed than a dome."""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.arrays import Array, Mask
from reconstruction.mapping.solid.bundle import Bundle


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
