"""Which points of a solid may be seen: not its far side, but a part that moves by itself may have turned away, too."""

import numpy as np

from app.arrays import Flags, Indices
from reconstruction.basis.mesh import vertex_normals
from reconstruction.basis.model import triangulated
from reconstruction.mapping.map import Map
from reconstruction.mapping.solid.bundle import seen_by

TOGETHER = 0.75  # of the points that a keyframe shows, with which another has been seen, or it may be on the far side
COMPARED = 300  # points tell how much is hidden so
GRAZING = 0.25  # cosine of the angle at which a surface is looked at; below that, tracks get lost anyhow
SELDOM = 0.5  # times as often as the usual point


def at_once(found: Map) -> float:
    """The share of a solid's points that a usual keyframe might show: of one that turns the far side is hidden.

    Those that some keyframes show together with most of what this one shows; of points missing at random all are.
    """
    if found.seen is None or found.rest.kind != "rigid":
        return 1.0
    shown = found.seen[:, :: -(-found.seen.shape[1] // COMPARED)].astype(np.float64)
    beside = shown @ (shown.T @ shown > 0) / shown.sum(axis=1, keepdims=True).clip(1)
    return float(np.median((beside > TOGETHER).mean(axis=1)))


def missed(found: Map) -> float:
    """The share of points that are seen half as often as usual in the keyframes in which the rest shape shows them.

    0 for what is seen from all sides, which no triangles show.
    """
    if found.seen is None or at_once(found) < 1:
        return 0.0
    faces = triangulated(found.rest, found.camera, found.seen).faces
    shown = shows(found, faces)
    there = shown.any(axis=0) & np.isin(np.arange(shown.shape[1]), faces)
    often = (found.seen & shown).sum(axis=0)[there] / shown.sum(axis=0)[there]
    return float((often < SELDOM * np.median(often)).sum() / len(there)) if often.size else 0.0


def shows(found: Map, faces: Indices) -> Flags:
    """Which points (K, p) of triangles (m, 3) the rest shape turns to the camera in its keyframes."""
    motion, camera = found.rest.motion, found.camera
    normals = vertex_normals(motion.shape.T, faces).T
    rays = np.insert((seen_by(camera, motion) - camera.center_px[:, None]) / camera.focal_px, 2, 1.0, axis=1)
    turned = ((motion.R @ normals) * rays).sum(axis=1)
    return np.asarray(turned / np.linalg.norm(rays, axis=1) * np.sign(turned[found.seen].sum()) > GRAZING)
