"""A solid in views that it was not made from: poses alone, fitted robustly."""

from dataclasses import replace

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.outliers import medians
from reconstruction.mapping.solid.adjustment import Adjustment, adjust
from reconstruction.mapping.solid.building import TAIL_SIGMAS
from reconstruction.mapping.solid.bundle import Bundle, Loss, Prior
from reconstruction.mapping.solid.solid import Solid
from reconstruction.window.robust import deviation

ROUNDS = 4  # of robust weights of a pose
POSES = Adjustment(steps=15, tolerance=1e-3, points=False)


def image_in(solid: Solid, W: Array, visible: Mask, camera: Camera) -> Array:
    """Image (K, 2, p) px of a solid in other keyframes, posed as fits best, starting as the view most alike."""
    W, h = np.where(visible[:, None], W, 0.0) - camera.center_px[:, None], visible.astype(np.float64)
    bundle = Bundle(solid.motion, 1 / solid.camera.focal_px)
    image, motion = bundle.image(), solid.motion
    apart = np.where(visible[:, None, None], W[:, None] - image, np.nan)  # (K, views, 2, p)
    shift = medians(apart, axis=3)
    left = medians(np.linalg.norm(apart - shift[..., None], axis=2), axis=2)
    like = left.argmin(axis=1)
    views = np.append(0, like)  # the first keeps its turn and scale: one that counts for nothing
    shifted = np.concatenate([np.zeros((1, 2)), shift[np.arange(len(W)), like]])
    bundle = bundle[views]
    bundle = replace(bundle, motion=replace(bundle.motion, t=motion.t[views] + shifted))
    padded, counting = np.concatenate([W[:1], W]), np.concatenate([np.zeros((1, W.shape[2])), h])
    for _ in range(ROUNDS):
        off = np.linalg.norm(bundle.image() - padded, axis=1)[counting > 0]
        loss = Loss(TAIL_SIGMAS * deviation(off, 1e-9 * float(np.abs(motion.shape).max())), redescending=False)
        bundle, _ = adjust(padded, counting, bundle, loss, Prior(0.0, 0.0, np.inf, bundle.kappa), POSES)
    return bundle.image()[1:] + camera.center_px[:, None]
