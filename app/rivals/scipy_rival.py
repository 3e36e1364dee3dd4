"""The window step by scipy.optimize.least_squares: trust region reflective, sparse analytic Jacobian."""

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import csr_array

from app.arrays import Array
from app.rivals.problems import WindowStep
from app.rivals.residuals import FrameData, change_weights, parameters, rest_weights
from reconstruction.camera import left_matrix


class ScipyWindow:
    """A window step as SciPy wants it: one vector of residuals, one sparse Jacobian whose pattern is made once.

    The turn of a frame is a rotation vector away from its start.
    """

    def __init__(self, step: WindowStep) -> None:
        self._start = parameters(step.start, step.energy.rows)
        self._before = parameters(step.before, step.energy.rows)[0]
        if self._before[:4] @ self._start[0, :4] < 0:
            self._before[:4] *= -1
        self._frames = [FrameData(step, W) for W in step.W]
        self._change, self._rest = change_weights(step), rest_weights(step)
        self._p, self._k = step.points, len(self._rest)
        self._d = 6 + self._k
        self._pattern()

    def solve(self, tolerance: float) -> float:
        """The energy where SciPy ends."""
        x = np.concatenate([np.zeros((len(self._start), 3)), self._start[:, 4:]], axis=1).ravel()
        found = least_squares(
            self.residuals, x, self.jacobian, method="trf", x_scale="jac", ftol=tolerance, xtol=None, gtol=None
        )
        return 2.0 * float(found.cost)

    def residuals(self, x: Array) -> Array:
        """All of them: reprojection, change, rest, frame by frame."""
        at = self._at(x)
        seen = [frame.residual(a[:4], a[4:6], a[6], a[7:]) for frame, a in zip(self._frames, at, strict=True)]
        change = self._change * np.diff(at, axis=0, prepend=self._before[None])
        return np.concatenate([*seen, change.ravel(), (self._rest * at[:, 7:]).ravel()])

    def jacobian(self, x: Array) -> csr_array:
        """Their derivatives."""
        n, p, d = len(self._start), self._p, self._d
        at, turning = self._at(x), self._turning(x)
        data = np.empty((n, 2 * p, d))
        of_q = np.empty((2 * p, 4))
        for i, frame in enumerate(self._frames):
            out = of_q, data[i, :, 3:5], data[i, :, 5:6], data[i, :, 6:]
            frame.derivatives(at[i, :4], at[i, 6], at[i, 7:], out=out)
            data[i, :, :3] = of_q @ turning[i]
        own = self._change[:4, None] * turning
        plain = np.broadcast_to(self._change[4:], (n, d - 3))
        rest = np.broadcast_to(self._rest, (n, self._k))
        parts = [data, own, plain, -own[:-1], -plain[:-1], rest]
        values = np.concatenate([part.ravel() for part in parts])
        return csr_array((values[self._order], self._columns, self._rows), shape=self._shape)

    def _at(self, x: Array) -> Array:
        """(n, 7 + k) parameters with quaternions."""
        x = x.reshape(len(self._start), -1)
        turned = (left_matrix(self._start[:, :4]) @ exponential(x[:, :3])[:, :, None])[:, :, 0]
        return np.concatenate([turned, x[:, 3:]], axis=1)

    def _turning(self, x: Array) -> Array:
        """dq/dθ (n, 4, 3)."""
        theta = x.reshape(len(self._start), -1)[:, :3]
        return np.asarray(left_matrix(self._start[:, :4]) @ exponential_slope(theta))

    def _pattern(self) -> None:
        """Where the values that `jacobian` makes belong."""
        n, p, d, k = len(self._start), self._p, self._d, self._k
        rows, columns = [], []

        def block(row: int, column: int, height: int, width: int) -> None:
            i, j = np.mgrid[:height, :width]
            rows.append(row + i.ravel())
            columns.append(column + j.ravel())

        def diagonal(row: int, column: int, length: int) -> None:
            rows.append(row + np.arange(length))
            columns.append(column + np.arange(length))

        change, rest = 2 * p * n, 2 * p * n + n * (7 + k)
        for i in range(n):
            block(2 * p * i, d * i, 2 * p, d)
        for frames, shift in ((range(n), 0), (range(1, n), -d)):
            for i in frames:
                block(change + (7 + k) * i, d * i + shift, 4, 3)
            for i in frames:
                diagonal(change + (7 + k) * i + 4, d * i + shift + 3, d - 3)
        for i in range(n):
            diagonal(rest + k * i, d * i + 6, k)
        row, column = np.concatenate(rows), np.concatenate(columns)
        self._shape = (rest + n * k, n * d)
        self._order = np.lexsort((column, row))
        self._columns = column[self._order].astype(np.int32)
        self._rows = np.searchsorted(row[self._order], np.arange(self._shape[0] + 1)).astype(np.int32)


def exponential(theta: Array) -> Array:
    """Unit quaternions (n, 4) of rotation vectors (n, 3)."""
    half = np.linalg.norm(theta, axis=1, keepdims=True) / 2
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * theta], axis=1)


def exponential_slope(theta: Array) -> Array:
    """Derivative (n, 4, 3) of `exponential`."""
    angle = np.linalg.norm(theta, axis=1)[:, None, None]
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    sine = 0.5 * np.sinc(angle / (2 * np.pi))
    bend = np.where(small, -1.0 / 24.0, (0.5 * np.cos(safe / 2) - np.sin(safe / 2) / safe) / safe**2)
    outer = theta[:, :, None] * theta[:, None, :]
    return np.concatenate([-0.5 * sine * theta[:, None, :], sine * np.eye(3) + bend * outer], axis=1)
