"""Spikes of a rigid shape: depths that the views hardly hold are drawn to the plane through their neighbours.

The most likely depths z, of which the views say ẑ_i ± σ_i, on a surface whose vertices are d = D z off their neighbours':

    min Σ_i (z_i − ẑ_i)²/σ_i² + Σ_i d_i²/τ_i²,   τ_i the usual d times the neighbours' distance over the usual one.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import cg

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.mesh import Mesh, neighbour_averages, triangulate
from reconstruction.basis.modal_basis import principal_axes
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.mapping.first.evidence import extent
from reconstruction.mapping.solid.bundle import Bundle, Derivatives
from reconstruction.window.robust import RAYLEIGH_MEDIAN, deviation

INLIER_SIGMAS = 3.0  # of the residuals
LIKE_VIEWS = 4.0  # views whose errors are alike, since what deforms stays so for a while: they count as one
LEAST_SIGMA = 0.005  # of half the width: less is what anything deforms by
LIVELY = 3.0  # times the residuals' sigma that a point's own may be: lips move more than a brow
SHARE = 0.5  # of a point's observations that must agree with the solid
FEWEST = 2  # of them
ASIDE = 0.02  # weight of a point that does not move with the solid among the neighbours of one that does
LEAST = 0.05  # of the usual distance from the neighbours' plane: no depth is surer
CLOSEST = 0.5  # of the usual distance of neighbours: nearer ones lie behind each other, or on a side seen edge-on
ROUNDS = 3  # of leaving out what is a spike
LARGEST = 0.8  # times half the width, both RMS, that a vertex may be off its neighbours' plane; 12 % of the width across
AS_OFTEN = 0.8  # as its neighbours a point is seen, or its track is doubtful
LARGEST_NEW = 0.4  # times half the width, that it may come to be off while deformations are learned
USUAL = 4.0  # times the usual distance that it may, too: with few points, most are far from their neighbours' plane
PROVEN = 20.0  # standard deviations of its depth that it may, too: a nose of few points is no spike
RELATIVE = 1e-10  # residual of the smoothed depths
SMOOTHEST = 0.1  # times half the width: no surface is believed to be smoother, or creases would be rounded


def smoothed(visible: Mask, bundle: Bundle, residual: Array) -> tuple[RigidMotion, Mask]:
    """The motion with spikes smoothed, and which points (p,) keep the depth that the views gave them.

    Args:
        visible: (K, p).
        bundle: in the first view's axes.
        residual: (K, p) lengths, NaN where not visible.
    """
    axes = principal_axes(bundle.motion.shape)
    shape = axes.T @ bundle.motion.shape
    deep = extent(shape[:2]) / 2
    sigma = deviation(residual[visible], LEAST_SIGMA * deep)
    usual = np.nanmedian(np.where(visible.any(axis=0), residual, 0.0), axis=0) / RAYLEIGH_MEDIAN  # of each point
    agrees = visible & (np.nan_to_num(residual, nan=np.inf) < INLIER_SIGMAS * 1.2 * usual.clip(sigma, LIVELY * sigma))
    count = agrees.sum(axis=0)
    sound = (count >= FEWEST) & (count >= SHARE * visible.sum(axis=0))
    information = axes.T @ point_information(agrees.astype(np.float64), bundle) @ axes
    own = np.sqrt((np.where(agrees, residual, 0.0) ** 2).sum(axis=0) / count.clip(1) / 2)
    noise = np.sqrt((own**2 + sigma**2) / 2)
    spread = np.minimum(depth_variance(information) * noise**2 * LIKE_VIEWS, deep**2)

    def spike(off: Array, tau: float) -> Mask:
        return np.asarray((np.abs(off) > max(LARGEST * deep, USUAL * tau)) & (np.abs(off) < PROVEN * np.sqrt(spread)))

    edges = triangulate(shape[:2].T).edges
    for _ in range(ROUNDS):
        D, distance = off_neighbours_plane(shape[:2], edges, sound)
        off = np.abs(D @ shape[2])
        tau = max(float(np.median(off[sound] if sound.any() else off)) / 0.6745, SMOOTHEST * deep)
        weight = np.where(sound, 1 / (spread + (LEAST * tau) ** 2), 1 / deep**2)
        usually = float(np.median(distance))
        stiffness = D.T @ sp.diags_array((usually / (tau * distance.clip(CLOSEST * usually))) ** 2) @ D
        z = solved((sp.diags_array(weight) + stiffness).tocsr(), weight * shape[2])
        sound = sound & ~spike(D @ z, tau)
    # What smoothing left, most of it at the border: there, the plane would carry it off.
    z, sound = put_back(z, shape[:2], edges, sound, lambda off: spike(off, tau))
    return replace(bundle.motion, shape=axes @ (shape + along(information, z - shape[2]))), sound


def without_new_spikes(shape: Array, before: Array, visible: Mask) -> Array:
    """A shape in which doubtful points that have left their neighbours since an earlier one are back with them.

    Args:
        shape: (3, p).
        before: (3, p) the earlier one.
        visible: (K, p) in keyframes.
    """
    axes = principal_axes(before)
    flat = (axes.T @ before)[:2]
    deep = extent(flat) / 2
    mesh, change = triangulate(flat.T), shape - before
    doubted = lost_alone(mesh, visible)

    def left(change: Array) -> Mask:
        off = np.linalg.norm(change, axis=0)
        return np.asarray(doubted & (off > max(LARGEST_NEW * deep, USUAL * float(np.median(off)) / 0.6745)))

    return before + put_back(change, flat, mesh.edges, np.ones_like(doubted), left)[0]


def put_back(values: Array, flat: Array, edges: Indices, sound: Mask, spike: Callable[[Array], Mask]) -> tuple[Array, Mask]:
    """Values (..., p) of points (2, p), spikes put on the plane through their neighbours', and which are still sound (p,).

    Args:
        values: depths, or places.
        flat: the points.
        edges: (n, 2) of their mesh.
        sound: (p,) which count as neighbours.
        spike: which points (p,) are spikes, that are so far off (..., p).
    """
    all_neighbours, _ = off_neighbours_plane(flat, edges, np.ones_like(sound))
    for _ in range(ROUNDS):
        far = spike((all_neighbours @ values.T).T)
        sound = sound & ~far
        values = values - np.where(far, (off_neighbours_plane(flat, edges, sound)[0] @ values.T).T, 0.0)
    return values, sound


def lost_alone(mesh: Mesh, visible: Mask) -> Mask:
    """Which points (p,) are seen (K, p) much more seldom than those around: they were lost, so they were followed badly."""
    count = visible.sum(axis=0)
    ring = neighbour_averages(mesh, len(count))
    return np.asarray(count < AS_OFTEN * (ring @ (ring @ count)))


def solved(A: sp.csr_array, b: Array) -> Array:
    """A⁻¹ b of a symmetric positive matrix (p, p), by conjugate gradients: of dense points thirty times as fast."""
    return np.asarray(cg(A, b, rtol=RELATIVE, M=sp.diags_array(1 / A.diagonal()))[0])


def point_information(h: Array, bundle: Bundle) -> Array:
    """JᵀJ (p, 3, 3) of each point over the views (K, p) that count, poses held."""
    B = Derivatives(bundle).by_point
    return np.asarray(np.einsum("kdcp,kecp->pde", h[:, None, None] * B, B))


def depth_variance(information: Array) -> Array:
    """Variance (p,) of z, x and y free, by unit noise."""
    xy, z = information[:, :2, :2] + 1e-9 * np.eye(2), information[:, :2, 2:]
    left = information[:, 2, 2] - (z.transpose(0, 2, 1) @ np.linalg.solve(xy, z))[:, 0, 0]
    return np.asarray(1 / left.clip(1e-9))


def along(information: Array, change: Array) -> Array:
    """Steps (3, p) that change the depths by so much and the images as little as can be, and go aside by no more.

    What is seen from the side has other neighbours than those of its place in the main plane, and would be carried off.
    """
    xy, z = information[:, :2, :2] + 1e-9 * np.eye(2), information[:, :2, 2:]
    aside = -np.linalg.solve(xy, z)[:, :, 0].T
    change = change / np.linalg.norm(aside, axis=0).clip(1.0)
    return np.concatenate([aside * change, change[None]])


def off_neighbours_plane(points: Array, edges: Indices, sound: Mask) -> tuple[sp.csr_array, Array]:
    """D (p, p), so that D z are distances from the planes through the neighbours, and the neighbours' mean distance (p,).

    Neighbours of points (2, p) are those along a mesh's edges (n, 2), and theirs. Points that are not sound (p,) hardly
    count as neighbours, and are compared with the mean of theirs instead: a plane would carry them off beyond the last
    sound point.
    """
    p = points.shape[1]
    near = sp.coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(p, p))
    ring = ((near + near.T) + sp.eye_array(p)).tocsr()
    i, j = (ring @ ring).tocoo().coords
    apart = points[:, j] - points[:, i]
    lengths = np.linalg.norm(apart, axis=0)
    first = ring.tocoo()
    own = np.linalg.norm(points[:, first.coords[0]] - points[:, first.coords[1]], axis=0)
    close = np.bincount(first.coords[0], own, p) / (np.bincount(first.coords[0], minlength=p) - 1).clip(1)
    close = close.clip(1e-12 * close.max())
    w = np.where(i == j, 0.0, 1 / (1 + (lengths / close[i]) ** 2)) * np.where(sound[j] | ~sound[i], 1.0, ASIDE)
    rows = np.stack([np.ones(len(i)), *(apart / close[i])])
    gram = np.stack([np.bincount(i, w * a * b, p) for a in rows for b in rows], axis=1).reshape(p, 3, 3)
    height = np.linalg.inv(gram + 1e-6 * np.eye(3))[:, 0]  # of the plane at the vertex itself
    alone = gram[:, 0, 0] == 0  # on top of another: not in the mesh
    height = np.where(sound[:, None], height, np.eye(3)[0] / np.where(alone, 1.0, gram[:, 0, 0])[:, None])
    share = (height[i] * rows.T).sum(axis=1) * w
    plane = sp.coo_array((share, (i, j)), shape=(p, p))
    return (sp.diags_array((~alone).astype(np.float64)) - plane).tocsr(), close
