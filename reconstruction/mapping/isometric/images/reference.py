"""The image of a bending sheet that all others are smooth functions of."""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.arrays import Array, Mask
from reconstruction.basis.mesh import farthest_points
from reconstruction.mapping.isometric.images.smooth_field import robust_fit, smooth_field

FUNCTIONS = 20  # of a field that only says where a point would be in the reference image
FEWEST = 6  # where images have few points in common
NODES = 50
FIRMNESS = 1e-3
COMPARED = 250  # well-spread points
FULL = 0.9  # of the points of the image that shows most: as good as all


def reference_image(W: Array, visible: Mask) -> Array:
    """One image (2, p) px of all points: the median of what every image, warped on to the clearest one, says.

    NaN for points that no image shows.
    """
    clearest = clearest_image(W, visible)
    reference = np.where(visible[clearest], W[clearest], np.nan)
    if np.median((visible & visible[clearest]).sum(axis=1)) < 2 * FUNCTIONS:  # roughly first, and so all points
        reference = placed(W, visible, reference, FEWEST)
    return placed(W, visible, reference, FUNCTIONS)


def placed(W: Array, visible: Mask, reference: Array, functions: int) -> Array:
    """What every image, warped on to a reference image (2, p), says in the median; as it is for points that none tells of.

    An image counts that has in common with it twice as many points as the least number of functions.
    """
    said = np.full((len(W), 2, W.shape[2]), np.nan)
    for f, (w, h) in enumerate(zip(W, visible, strict=True)):
        both = np.flatnonzero(h & np.isfinite(reference[0]))
        if len(both) < 2 * functions:
            continue
        nodes = both[farthest_points(w[:, both].T, NODES)]
        field = smooth_field(w[:, nodes], min(FUNCTIONS, len(both) // 2))
        B, known = field.at(w[:, h]), np.isfinite(reference[0, h])
        c = robust_fit(B, reference[:, h], known, field.stiffness, FIRMNESS)[0]
        said[f][:, h] = (B @ c).T
    found = median(said)
    return np.where(np.isfinite(found), found, reference)


def clearest_image(W: Array, visible: Mask) -> int:
    """Of the images that show most points, the one in which they lie farthest from each other.

    What is seen there from the side or folded over is no function of it in any other image.
    """
    count = visible.sum(axis=1)
    fullest = int(count.argmax())
    few = np.flatnonzero(visible[fullest])
    few = few[farthest_points(W[fullest][:, few].T, COMPARED)]
    shared = visible[:, few].sum(axis=1)  # none with the far side of a solid
    full = np.flatnonzero((count >= FULL * count.max()) & (shared >= min(2, shared.max())))
    apart = []
    for f in full:
        place = W[f][:, few[visible[f, few]]].T
        nearest = np.asarray(cKDTree(place).query(place, k=2)[0])[:, 1]
        apart.append(np.log(nearest.clip(1e-12)).mean())
    return int(full[np.argmax(apart)])


def median(values: Array) -> Array:
    """Median over the first axis of values (F, ...) without NaN; NaN where there is none."""
    ordered = np.sort(values, axis=0)
    n = np.isfinite(ordered).sum(axis=0)
    low, high = np.maximum(n - 1, 0) // 2, np.minimum(n // 2, len(values) - 1)
    picked = [np.take_along_axis(ordered, k[None], axis=0)[0] for k in (low, high)]
    return np.asarray(np.where(n > 0, (picked[0] + picked[1]) / 2, np.nan))
