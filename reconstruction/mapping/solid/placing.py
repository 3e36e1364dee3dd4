"""Which points of a solid are adjusted together, the shapes that this starts from, and where the other points are."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.mesh import farthest_points
from reconstruction.basis.modal_basis import principal_axes
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.mapping.solid.bundle import Bundle
from reconstruction.window.robust import geman_mcclure

FEWEST_VIEWS, FEWEST_POINTS = 3, 6
MOST_POINTS = 1000  # are adjusted together with the poses; of dense ones the others are placed afterwards
DOME = 0.4  # height of the shape it starts from, over its RMS radius
FLAT_DOME = 1e-3  # of that, for a plane
FAR = 4.0  # usual distances from the middle, beyond which a place by linear least squares is not believed
BESIDE = 5  # points beside one that only one view shows
NEAR = 0.3  # a point's depth over its view's, nearer than which it is not believed either


def well_spread(places: Array, visible: Mask, most: int = MOST_POINTS) -> Indices:
    """Those of points (2 or 3, p) with visibility (K, p) that are adjusted together, ascending."""
    often = np.flatnonzero(visible.sum(axis=0) >= FEWEST_VIEWS)
    if places.shape[1] <= most:
        return np.arange(places.shape[1])
    return np.sort(often[farthest_points(places[:, often].T, most)])


def dome(first: Array, kappa: float, *, flat: bool) -> RigidMotion:
    """A shallow dome (3, p), or hardly one, that looks as the image (2, p), bulging from the camera."""
    middle = first.mean(axis=1)
    squares = ((first - middle[:, None]) ** 2).sum(axis=0)
    z = DOME * (squares.mean() - squares) / np.quantile(squares, 0.9)
    z = (FLAT_DOME if flat else 1.0) * np.clip(z, -DOME, DOME)
    xy = first * (1 + kappa * z)
    t = xy.mean(axis=1)
    return RigidMotion(np.concatenate([xy - t[:, None], z[None]]), np.eye(3)[None], np.ones(1), t[None])


def resection(shape: Array, image: Array, rounds: int) -> tuple[Array, float]:
    """Rotation (3, 3) and scale with which a shape (3, n) looks most like an image (2, n), as if there were no perspective.

    With more rounds, points that are far off count for little.
    """
    h = np.ones(shape.shape[1])
    for _ in range(rounds):
        w = h / h.sum()
        X, u = shape - (shape @ w)[:, None], image - (image @ w)[:, None]
        affine = (u * w) @ X.T @ np.linalg.pinv((X * w) @ X.T, rcond=1e-9, hermitian=True)
        off = np.linalg.norm(u - affine @ X, axis=0)
        h = geman_mcclure(off / (2 * np.median(off) + 1e-12))
    U, size, Vt = np.linalg.svd(affine, full_matrices=False)
    rows = U @ Vt
    return np.concatenate([rows, np.cross(rows[0], rows[1])[None]]), float(size.mean())


def placed_by(W: Array, h: Array, bundle: Bundle, *, flat: bool) -> Array:
    """Points (3, p) where views (K, 2, p) with weights (K, p) see them, by linear least squares; unseen ones in the middle.

    Of a view (s R_xy − κ u s R_z) X = u − t. If it is flat, X is on the plane through the bundle's own points.
    """
    m = bundle.motion
    turned = m.s[:, None, None] * m.R
    rows = turned[:, :2, :, None] - bundle.kappa * turned[:, 2:, :, None] * W[:, :, None]  # (K, 2, 3, p)
    normal = np.einsum("kp,kuap,kubp->pab", h, rows, rows)
    right = np.einsum("kp,kuap,kup->pa", h, rows, W - m.t[:, :, None])
    middle = m.shape.mean(axis=1)
    along = principal_axes(m.shape)[:, : 2 if flat else 3]
    normal, right = along.T @ normal @ along, (right - normal @ middle) @ along
    loose = 1e-6 * normal.max(initial=1e-300) * np.eye(along.shape[1])
    return middle[:, None] + along @ np.linalg.solve(normal + loose, right[:, :, None])[:, :, 0].T


def located(W: Array, h: Array, bundle: Bundle, points: Mask, *, flat: bool) -> Bundle:
    """A bundle in which points (p,) are where its views (K, 2, p) with weights (K, p) see them, others stay.

    If it is flat, on the plane through these. Else, where two views or more do not place them well they are as far away as
    others beside them, in a view that shows both.
    """
    m, seen = bundle.motion, h > 0
    middle = np.median(m.shape[:, ~points], axis=1, keepdims=True)
    usual = np.sqrt(np.median(((m.shape[:, ~points] - middle) ** 2).sum(axis=0)))
    known = Bundle(replace(m, shape=m.shape[:, ~points]), bundle.kappa)
    place = placed_by(W[:, :, points], h[:, points], known, flat=flat)
    far = bundle.farness(Bundle(replace(m, shape=place), bundle.kappa).placed())
    good = (seen[:, points].sum(axis=0) > (0 if flat else 1)) & (np.linalg.norm(place - middle, axis=0) < FAR * usual)
    good &= np.where(seen[:, points], far, 1.0).min(axis=0) > NEAR
    shape = beside_others(W, seen, bundle, points)
    shape[:, points] = np.where(good, place, shape[:, points])
    return Bundle(replace(m, shape=shape), bundle.kappa)


def with_others(W: Array, h: Array, bundle: Bundle, some: Indices) -> Bundle:
    """A bundle of `some` of the points with all of them, the others where `located` finds them; arguments as for that."""
    p = h.shape[1]
    shape, others = np.zeros((3, p)), np.ones(p, np.bool_)
    shape[:, some] = bundle.motion.shape
    others[some] = False
    whole = Bundle(replace(bundle.motion, shape=shape), bundle.kappa)
    return located(W, h, whole, others, flat=False) if others.any() else whole


def beside_others(W: Array, seen: Mask, bundle: Bundle, points: Mask) -> Array:
    """The shape (3, p), points (p,) on the ray of the view that shows most others as well, as deep as those beside them."""
    m, others = bundle.motion, seen & ~points
    shape = m.shape.copy()
    view = np.where(seen, 1 + others.sum(axis=1)[:, None], 0).argmax(axis=0)
    for k in np.unique(view[points & seen.any(axis=0)]):
        new, known = np.flatnonzero(points & seen[k] & (view == k)), np.flatnonzero(others[k])
        if not len(known):
            continue
        depth = m.s[k] * (m.R[k, 2] @ shape[:, known])
        beside = cKDTree(W[k][:, known].T).query(W[k][:, new].T, range(1, 1 + min(BESIDE, len(known))))[1]
        deep = np.median(depth[beside], axis=1)
        ray = W[k][:, new] * (1 + bundle.kappa * deep) - m.t[k][:, None]
        shape[:, new] = m.R[k].T @ np.concatenate([ray, deep[None]]) / m.s[k]
    return shape
