"""Log lengths of edges between points along rays, and the depths that keep them the same in all frames."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.blas import dsyrk, dtrsm, dtrsv
from scipy.linalg.lapack import dposv

from reconstruction.arrays import Array, Indices
from reconstruction.window.robust import geman_mcclure

FARTHEST = 50.0  # logarithm of a depth, so that squares stay numbers
HOPELESS = 1e4  # damping with which no step helps
ENOUGH = 1e-3  # relative decrease of a frame's cost that is not worth another step
TOGETHER = 8  # frames are worked on at once, whatever start they come from; more would not stay near the processor
FIRST_STEPS, LEFT = 2, 2  # after so many steps only so many starts go on


@dataclass(frozen=True)
class Edges:
    """n edges between m points seen along rays q in F frames; depths are exp(B c_f), B smooth functions, c_f (r,).

    An edge is a line on the surface, not a chord, which gets shorter as the surface bends: its length is that of the two
    chords over its halves, and by a third of what these are longer than the one chord (Richardson's extrapolation).

    Attributes:
        ends: (n, 2) point indices.
        squares: (F, 3, n) |q|² at its first end, its middle and its second end.
        products: (F, 3, n) q · q of first end and middle, middle and second end, first and second end.
        B: (3, n, r) the functions at first end, middle and second end.
        weights: (F, n) how well each length is seen, 0 to 1.
    """

    ends: Indices
    squares: Array
    products: Array
    B: Array
    weights: Array

    def log_lengths(self, c: Array) -> Array:
        """The logs g (F, n) of the lengths with coefficients c (F, r)."""
        return self.logs_and_shares(c)[0]

    def by_shares(self, shares: Array) -> Array:
        """Derivatives (F, r, n) by c from those (2, F, n) by the log depths of both ends; the middle's is the rest."""
        first, middle, second = (np.ascontiguousarray(B.T) for B in self.B)
        first, second = first - middle, second - middle
        J = np.empty((shares.shape[1], *middle.shape))
        for one, (by_first, by_second) in zip(J, shares.swapaxes(0, 1), strict=True):  # stays near the processor
            np.multiply(by_first, first, out=one)
            one += by_second * second
            one += middle
        return J

    def logs_and_shares(self, c: Array) -> tuple[Array, Array]:
        """The logs g (F, n), and their derivatives (2, F, n) by the log depths of both ends."""
        i, m, j = (np.exp(np.clip(c @ B.T, -FARTHEST, FARTHEST)) for B in self.B)
        ii, mm, jj = (depth**2 * self.squares[:, k] for k, depth in enumerate((i, m, j)))
        im, mj, ij = (depths * self.products[:, k] for k, depths in enumerate((i * m, m * j, i * j)))
        first, second, chord = (
            np.sqrt(np.maximum(one + other - 2 * cross, 1e-300))
            for one, other, cross in ((ii, mm, im), (mm, jj, mj), (ii, jj, ij))
        )
        length = (4 * (first + second) - chord) / 3
        shares = (4 * (ii - im) / first - (ii - ij) / chord, 4 * (jj - mj) / second - (jj - ij) / chord)
        return np.log(length), np.stack(shares) / (3 * length)

    def rms(self, values: Array) -> Array:
        """Weighted rms (F,) over the edges of values (F, n)."""
        total = np.maximum(self.weights.sum(axis=1), 1e-12)
        return np.asarray(np.sqrt((self.weights * values**2).sum(axis=1) / total))

    def frames(self, chosen: slice | Indices) -> "Edges":
        """The same in some of the frames."""
        return replace(self, squares=self.squares[chosen], products=self.products[chosen], weights=self.weights[chosen])

    def weighted(self, factor: Array) -> "Edges":
        """The same with weights multiplied by factors (n,) or (F, 1)."""
        return replace(self, weights=self.weights * factor)


def edges_of(rays: Array, middles: Array, ends: Indices, B: Array, weights: Array) -> Edges:
    """Edges (n, 2) between points along rays (F, 3, m), their middles along others (F, 3, n).

    Functions B (3, n, r) and weights (F, n) as in `Edges`.
    """
    i, j = (rays[:, :, end] for end in ends.T)
    squares = np.stack([(q**2).sum(axis=1) for q in (i, middles, j)], axis=1)
    products = np.stack([(p * q).sum(axis=1) for p, q in ((i, middles), (middles, j), (i, j))], axis=1)
    return Edges(ends, squares, products, B, weights)


@dataclass(frozen=True)
class Solver:
    """How depths are adjusted."""

    bend: float = 1e-2
    """λ: weight of the depth field's bending."""
    grow: float = 3e-4
    """η: pull to short lengths, against shapes that grow without end."""
    steps: int = 30
    """At most so many Levenberg-Marquardt steps."""
    enough: float = 1e-3
    """Relative decrease of the cost that ends them."""


def mean_log_lengths(edges: Edges, g: Array) -> Array:
    """Weighted mean over frames (n,) of log lengths g (F, n)."""
    total = edges.weights.sum(axis=0)
    return np.asarray((edges.weights * g).sum(axis=0) / np.maximum(total, 1e-12))


def cost(edges: Edges, g: Array, c: Array, stiffness: Array, solver: Solver) -> float:
    """1/N Σ w (g − mean_f g)² + 2η/N Σ w g + λ Σ_f c_fᵀ diag(stiffness) c_f, N = Σ w / F, of the log lengths g of c."""
    d = g - mean_log_lengths(edges, g)
    n = edges.weights.sum() / len(c)
    bend = solver.bend * float((stiffness * c**2).sum())
    return float((edges.weights * (d**2 + 2 * solver.grow * g)).sum() / n) + bend


def gradient(edges: Edges, g: Array, J: Array, c: Array, stiffness: Array, solver: Solver) -> Array:
    """Half the derivative (F, r) of the cost; J (F, r, n) are the derivatives of the log lengths g."""
    pull = edges.weights * (g - mean_log_lengths(edges, g) + solver.grow) * len(c) / edges.weights.sum()
    return np.asarray((J @ pull[:, :, None])[:, :, 0] + solver.bend * stiffness * c)


def adjust_depths(edges: Edges, c: Array, stiffness: Array, solver: Solver) -> Array:
    """Coefficients (F, r) for which every edge has the same, unknown, length in all frames; mean of c_f0 is 0.

    The frames are coupled only through n mean lengths: the normal matrix is one block a frame less a matrix of rank n,
    and is inverted as such (Woodbury).
    """
    F, r = c.shape
    w = edges.weights * F / edges.weights.sum()
    root = w / np.sqrt(np.maximum(w.sum(axis=0), 1e-12))
    c = c - c[:, :1].mean() * np.eye(r)[0]
    logs, shares = edges.logs_and_shares(c)
    before, damping = cost(edges, logs, c, stiffness, solver), 1e-3
    for _ in range(solver.steps):
        J = edges.by_shares(shares)
        g = gradient(edges, logs, J, c, stiffness, solver)
        g[:, 0] -= g[:, 0].mean()  # not along the scale, which is held
        blocks = (J * w[:, None]) @ J.transpose(0, 2, 1) + np.diag(solver.bend * stiffness)
        J *= root[:, None]
        diagonal = np.einsum("frr->fr", blocks) - np.einsum("frn,frn->fr", J, J)
        while damping < HOPELESS:
            D = np.linalg.cholesky(blocks + (damping * diagonal + 1e-9)[:, :, None] * np.eye(r))
            through, y = J.copy(), g.copy()
            for L, part, one in zip(D, through, y, strict=True):  # L⁻¹ of them, in place: BLAS counts along columns
                dtrsm(1.0, L.T, part.T, side=1, overwrite_b=1)
                dtrsv(L.T, one, trans=1, overwrite_x=1)
            y += coupled(through, y, 1.0)
            new = c - [dtrsv(L.T, one) for L, one in zip(D, y, strict=True)]
            new[:, 0] -= new[:, 0].mean()
            logs, shares = edges.logs_and_shares(new)
            after = cost(edges, logs, new, stiffness, solver)
            if after < before:
                break
            damping *= 10
        else:
            break
        settled = before - after < solver.enough * abs(before)
        c, before, damping = new, after, max(damping / 10, 1e-6)
        if settled:
            break
    return c


def coupled(through: Array, y: Array, own: float) -> Array:
    """T (own − Tᵀ T)⁻¹ Tᵀ y, T (F, k, n) and y (F, k): what frames gain by what couples them (Woodbury)."""
    T = through.reshape(-1, through.shape[2])
    normal = dsyrk(-1.0, T.T, 1.0, own * np.eye(T.shape[1]))
    return np.asarray((T @ dposv(normal, T.T @ y.ravel())[1]).reshape(y.shape))


def finish_depths(
    edges: Edges, logs: Array, c: Array, stiffness: Array, bend: float, steps: int = 6
) -> tuple[Array, Array]:
    """Coefficients (F, r) of frames, each by itself, with known log lengths (n,), started from c; and their costs (F,)."""
    w = edges.weights / np.maximum(edges.weights.sum(axis=1), 1e-12)[:, None]
    held = bend * stiffness

    def costs(g: Array, c: Array) -> Array:
        return np.asarray((w * (g - logs) ** 2).sum(axis=1) + (held * c**2).sum(axis=1))

    g, shares = edges.logs_and_shares(c)
    before, damping = costs(g, c), np.full(len(c), 1e-3)
    for _ in range(steps):
        J = edges.by_shares(shares)
        right = (J @ (w * (g - logs))[:, :, None])[:, :, 0] + held * c
        H = (J * w[:, None]) @ J.transpose(0, 2, 1)
        diagonal = np.einsum("frr->fr", H)
        diagonal += held
        diagonal += diagonal * damping[:, None] + 1e-9
        new = c - np.linalg.solve(H, right[:, :, None])[:, :, 0]
        there, its_shares = edges.logs_and_shares(new)
        after = costs(there, new)
        better = after < before
        done = bool((before - after < ENOUGH * before).all())
        c, g, shares = (np.where(better[:, None], *pair) for pair in ((new, c), (there, g), (its_shares, shares)))
        before = np.where(better, after, before)
        if done and better.all():
            break
        damping = np.where(better, np.maximum(damping / 5, 1e-9), damping * 10)
    return c, before


def best_start(edges: Edges, logs: Array, starts: list[Array], stiffness: Array, bend: float, steps: int = 8) -> Array:
    """For each frame, of coefficients (F, r) finished from several starts those that keep lengths best.

    After a few steps from each start, only the best two go on.
    """
    frames = np.arange(len(starts[0]))

    def finished(starts: list[Array], steps: int) -> tuple[Array, Indices]:
        if len(frames) * len(starts) > TOGETHER:
            each = [finish_depths(edges, logs, c, stiffness, bend, steps) for c in starts]
            ends, costs = (np.stack(part) for part in zip(*each, strict=True))
        else:
            many = edges.frames(np.tile(frames, len(starts)))
            found = finish_depths(many, logs, np.concatenate(starts), stiffness, bend, steps)
            ends, costs = (part.reshape(len(starts), len(frames), *part.shape[1:]) for part in found)
        return ends, costs.argsort(axis=0)

    if len(starts) > LEFT:
        ends, order = finished(starts, FIRST_STEPS)
        starts, steps = [ends[k, frames] for k in order[:LEFT]], steps - FIRST_STEPS
    ends, order = finished(starts, steps)
    return np.asarray(ends[order[0], frames])


def robust_lengths(edges: Edges, g: Array) -> tuple[Array, Array, Array]:
    """Log lengths (n,) that most frames agree on, from g (F, n); rms disagreement (F,) of frames and (n,) of edges."""
    h = np.ones((len(g), 1))
    for _ in range(10):
        weights = edges.weights * h
        logs = (weights * g).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-12)
        squared = edges.weights * (g - logs) ** 2
        off = np.sqrt(squared.sum(axis=1) / np.maximum(edges.weights.sum(axis=1), 1e-12))
        h = geman_mcclure(off / (2 * np.median(off) + 1e-12))[:, None]
    by_edge = np.sqrt((h * squared).sum(axis=0) / np.maximum((h * edges.weights).sum(axis=0), 1e-12))
    return logs, off, by_edge


def usual(changes: Array) -> float:
    """Usual size of changes of length (F, n)."""
    return float(np.median(np.abs(changes)))
