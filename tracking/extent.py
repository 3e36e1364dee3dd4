"""Whether image points can carry a shape at all."""

import numpy as np

from tracking import Array, Flags, TrackingError

FEWEST = 4  # points in a frame: fewer have no shape
LARGEST = 1e100  # beyond, squares overflow
ON_A_LINE = 5e-3  # of the points' length: what is so thin shows nothing of its depth
LOOKED_AT = 50  # frames


def check_extent(W: Array, visible: Flags) -> None:
    """Check that image points (F, 2, P), visible (F, P), spread over an area in some frame.

    Raises:
        TrackingError: what is wrong with them.
    """
    enough = np.flatnonzero(visible.sum(axis=1) >= FEWEST)
    if len(enough) == 0:
        raise TrackingError(f"no frame shows {FEWEST} points or more: there is nothing to reconstruct")
    if np.abs(W[np.broadcast_to(visible[:, None], W.shape)]).max() > LARGEST:
        raise TrackingError(f"W has values beyond {LARGEST:g}: give pixels, or coordinates in units of the focal length")
    longest, thin = 0.0, True
    for frame in enough[:: max(1, len(enough) // LOOKED_AT)]:
        points = W[frame][:, visible[frame]]
        lengths = np.linalg.svd(points - points.mean(axis=1, keepdims=True), compute_uv=False)
        longest = max(longest, lengths[0])
        thin = thin and lengths[1] <= ON_A_LINE * lengths[0]
    if longest < 1.0 / LARGEST:
        raise TrackingError("all points are at one place in every frame: there is nothing to reconstruct")
    if thin:
        raise TrackingError("the points lie on one line in every frame: track a wider region")
