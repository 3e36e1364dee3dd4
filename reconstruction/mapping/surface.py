"""Which points are on one surface: neighbours in the image that go on being neighbours."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from reconstruction.basis.mesh import triangulate

Array = NDArray[np.float64]
Visibility = NDArray[np.bool_]

APART = 0.25  # of how far it moved itself, by which a point may move against its neighbour
SLACK = 0.005  # of the image's RMS radius, besides
USUALLY = 0.75  # share of the frames in which they must stay together: a frame can be wrong


def on_one_surface(reference: Array, W: Array, visible: Visibility) -> NDArray[np.bool_]:
    """Points (p,) of the largest surface: most points times their median motion.

    Edges of the Delaunay mesh of the reference image (2, p) are cut where their ends move apart in W (F, 2, p) px.

    Args:
        reference: NaN where a point is unknown.
        W: images.
        visible: (F, p).
    """
    known = np.flatnonzero(np.isfinite(reference[0]))
    i, j = known[triangulate(reference[:, known].T).edges].T
    size = float(np.sqrt(np.nanvar(reference, axis=1).sum()))
    moved = np.where(visible[:, None], W - reference, np.nan)
    common = np.linalg.norm(moved, axis=1)
    least = np.fmin(common[:, i], common[:, j])
    limit = APART * np.maximum(least, SLACK * size) + SLACK * size
    over = np.linalg.norm(moved[:, :, j] - moved[:, :, i], axis=1) / limit
    both = np.isfinite(over).sum(axis=0)
    ordered = np.sort(over, axis=0)  # NaN last
    usual = np.take_along_axis(ordered, np.minimum(USUALLY * both, both - 1).clip(0).astype(int)[None], axis=0)[0]
    kept = (both == 0) | (usual <= 1)
    graph = sp.coo_matrix((np.ones(kept.sum()), (i[kept], j[kept])), shape=(reference.shape[1],) * 2)
    _, label = connected_components(graph, directed=False)
    usually_moved = np.nanmedian(np.where(np.isfinite(common).any(axis=0), common, 0.0), axis=0)
    worth = [usually_moved[label == k].sum() + 1e-12 * (label == k).sum() for k in range(label.max() + 1)]
    return np.asarray((label == int(np.argmax(worth))) & np.isfinite(reference[0]))
