"""Gross outliers in the first frames: entries that neither the common motion nor their neighbours explain.

A rest shape comes from least squares, which a few points put anywhere spoil. A robust affine fit of the frames tells them:
first of rank 2, all that a flat sheet does, since a third direction fitted at once would rather explain the outliers.
"""

from itertools import combinations_with_replacement

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.arrays import Array, Mask
from reconstruction.window.robust import LEAST_SIGMA, deviation, fit_weights, lengths

GROSS_SIGMAS = 6.0  # deviations beyond which an entry may be an outlier
DISAGREEING_SIGMAS = 4.0  # deviations beyond which an entry speaks against a place, how far ever it is off
NEIGHBOURS = 8  # of a point: a part of the surface that moves by itself takes them along
FLAT_SWEEPS, SOLID_SWEEPS, CLOSE_SWEEPS = 8, 12, 8
CONVERGED = 1e-3  # change of all deviations after which no further sweep is needed
MANY_FAR = 0.3  # of a point's entries
FAR_OUT = 12.0  # squared distance from the middle, in variances of a coordinate
PAIRED_FRAMES = 10  # of a point, at most, that are tried two by two
FEWEST_POINTS, FEWEST_FRAMES = 4, 1  # to be left of a frame, of a point; else it keeps all its entries


def without_outliers(W: Array, visible: Mask) -> Mask:
    """Visibility (F, p) of observations (F, 2, p) px without the entries that are grossly wrong."""
    fit = RobustFit(W, visible)
    fit.sweep(1)
    if not fit.gross().any():  # tracks that were checked: nothing more to do
        return visible
    fit.sweep(FLAT_SWEEPS)
    fit.deepen()
    fit.sweep(SOLID_SWEEPS)
    fit.sweep(CLOSE_SWEEPS, close=True)
    fit.reseat()
    fit.sweep(1, close=True)
    sound = visible & ~fit.gross()
    bare = sound.sum(axis=1) < FEWEST_POINTS
    sound[bare] = visible[bare]
    rare = sound.sum(axis=0) < FEWEST_FRAMES
    sound[:, rare] = visible[:, rare]
    return sound


class RobustFit:
    """W^f ≈ A^f S + t^f 1ᵀ, by alternating weighted least squares over observations (F, 2, p) px.

    It starts with S in two dimensions: every point where it usually is. Few entries may not drive a point or a frame far
    from the usual: A and S are pulled to 0, as weakly as a Gaussian prior of their own size says.

    Args:
        W: (F, 2, p) px; anything where not visible.
        visible: (F, p).
    """

    def __init__(self, W: Array, visible: Mask) -> None:
        seen = np.where(visible[:, None], W, np.nan)
        middle = medians(seen, axis=2)[:, :, None]
        track = np.nan_to_num(medians(seen - middle, axis=0))
        self._known, self._visible, self._h = np.nan_to_num(seen), visible, visible.astype(np.float64)
        nearest = cKDTree(track.T).query(track.T, k=range(1, min(NEIGHBOURS + 1, track.shape[1]) + 1))[1]
        self._neighbours = np.asarray(nearest, np.int64)[:, 1:]
        self._size = float(np.sqrt((track**2).sum(axis=0).mean()))
        self._S = standardised(track)
        self._judge(self._known - track - np.nan_to_num(middle))

    def sweep(self, times: int, *, close: bool = False) -> None:
        """Improve A, t and S, at most so often; `close` all but leaves out what is far off, else it counts linearly."""
        for _ in range(times):
            before = self._off.sum()
            h = self._h * fit_weights(self._off / self._sigma, close=close)
            A, t = self._motion(h)
            S = self._points(A, t, h)
            self._judge(self._known - A @ S - t)
            self._S = standardised(S)
            if abs(self._off.sum() - before) < CONVERGED * before:
                break

    def deepen(self) -> None:
        """Another row of S: what the points do most of what is not explained so far."""
        left = self._left * fit_weights(self._off / self._sigma, close=False)[:, None]
        direction = np.linalg.svd(left.reshape(-1, left.shape[2]), full_matrices=False)[2][:1]
        self._S = np.concatenate([self._S, standardised(direction)])

    def reseat(self) -> None:
        """Doubtful points start anew, where one frame or two put them and few other frames disagree.

        Doubtful are those of which many entries are far off, and those that lie far outside to explain all of theirs.
        """
        far = self._visible & (self._off > GROSS_SIGMAS * self._sigma)
        seen = self._visible.sum(axis=0)
        doubtful = (far.sum(axis=0) > MANY_FAR * seen) | ((self._S**2).sum(axis=0) > FAR_OUT)
        A, t = self._motion(self._h * fit_weights(self._off / self._sigma, close=True))
        left = self._left.copy()
        for i in np.flatnonzero(doubtful & (seen > 0)):
            frames = np.flatnonzero(self._visible[:, i])
            rows, place = A[frames], self._known[frames, :, i] - t[frames, :, 0]
            few = np.unique(np.linspace(0, len(frames) - 1, PAIRED_FRAMES).astype(int))
            pairs = np.array(list(combinations_with_replacement(few, 2)))
            two, places = rows[pairs].reshape(len(pairs), 4, -1), place[pairs].reshape(len(pairs), 4, 1)
            gram = two.transpose(0, 2, 1) @ two + self._sigma**2 * np.eye(two.shape[2])
            S = np.linalg.solve(gram, two.transpose(0, 2, 1) @ places)[:, :, 0]
            S = np.concatenate([S, self._S[None, :, i]])
            tried = place[:, :, None] - rows @ S.T  # (frames, 2, pairs)
            cost = (np.minimum(lengths(tried) / self._sigma, DISAGREEING_SIGMAS) ** 2).sum(axis=0) + (S**2).sum(axis=1)
            best = int(cost.argmin())
            self._S[:, i] = S[best]
            left[frames, :, i] = tried[:, :, best]
        self._judge(left)

    def gross(self) -> Mask:
        """Which entries (F, p) are off by far, and not together with their neighbours."""
        limit = GROSS_SIGMAS * self._sigma
        off = self._visible & (self._off > limit)
        f, i = np.nonzero(off)
        beside = self._neighbours[i]
        around = np.where(self._visible[f[:, None], beside], self._left[f[:, None], :, beside].transpose(2, 0, 1), np.nan)
        alone = self._left[f, :, i].T - np.nan_to_num(medians(around, axis=2))
        off[f, i] = lengths(alone) > limit
        return off

    def _judge(self, left: Array) -> None:
        self._left = left * self._h[:, None]
        self._off = lengths(self._left)
        self._sigma = deviation(self._off[self._visible], LEAST_SIGMA * self._size)

    def _motion(self, h: Array) -> tuple[Array, Array]:
        """A (F, 2, k) and t (F, 2, 1) given S."""
        k, p = self._S.shape
        B = np.concatenate([self._S, np.ones((1, p))])
        pull = np.append(np.full(k, (self._sigma / self._size) ** 2), 1e-9)
        gram = (h @ products(B).T).reshape(-1, k + 1, k + 1) + np.diag(pull)
        right = ((self._known * h[:, None]).reshape(-1, p) @ B.T).reshape(-1, 2, k + 1)
        M = np.linalg.solve(gram, right.transpose(0, 2, 1)).transpose(0, 2, 1)
        return M[:, :, :k], M[:, :, k:]

    def _points(self, A: Array, t: Array, h: Array) -> Array:
        """S (k, p) given A and t."""
        k = A.shape[2]
        rows = A.reshape(-1, k)  # (2F, k)
        both = products(rows.T).reshape(k * k, -1, 2).sum(axis=2)  # (k², F)
        gram = (both @ h).T.reshape(-1, k, k) + self._sigma**2 * np.eye(k)
        right = rows.T @ ((self._known - t) * h[:, None]).reshape(len(rows), -1)
        return np.linalg.solve(gram, right.T[:, :, None])[:, :, 0].T


def products(vectors: Array) -> Array:
    """The products (k², n) of all pairs of rows (k, n)."""
    return (vectors[:, None] * vectors).reshape(-1, vectors.shape[1])


def standardised(S: Array) -> Array:
    """Rows of mean 0 and variance 1."""
    S = S - S.mean(axis=1, keepdims=True)
    return S / S.std(axis=1, keepdims=True).clip(1e-12)


def medians(x: Array, axis: int) -> Array:
    """Medians (the upper of two) along an axis of what is not NaN; NaN where nothing is. As nanmedian, but fast."""
    known = np.isfinite(x).sum(axis=axis, keepdims=True)
    return np.take_along_axis(np.sort(x, axis=axis), np.minimum(known // 2, x.shape[axis] - 1), axis=axis).squeeze(axis)
