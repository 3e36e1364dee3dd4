"""Normal equations of a window of frames."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri

from reconstruction.arrays import Array


@dataclass
class Normal:
    """Value of an energy and its block tridiagonal normal equations.

    Attributes:
        value: (n,) energy per frame; smoothness counts for the later frame.
        gradient: (n, d) half the gradient.
        diagonal: (n, d, d) diagonal blocks of half the Gauss-Newton Hessian.
        coupling: (n-1, d, d) blocks between frame i (rows) and i+1 (columns).
    """

    value: Array
    gradient: Array
    diagonal: Array
    coupling: Array

    @staticmethod
    def zero(value: Array, d: int) -> "Normal":
        """No terms yet: d parameters for each frame of `value` (n,)."""
        n = len(value)
        return Normal(value, np.zeros((n, d)), np.zeros((n, d, d)), np.zeros((n - 1, d, d)))


def diagonals(blocks: Array) -> Array:
    """The diagonals (n, d) of blocks (n, d, d), to be changed in place."""
    return np.einsum("nii->ni", blocks)


def inverted(matrix: Array) -> Array:
    """The inverse of a symmetric positive definite matrix.

    Raises:
        LinAlgError: it is not.
    """
    return from_lower(dpotri(cholesky(matrix), lower=1)[0])


def cholesky(matrix: Array) -> Array:
    """Its lower Cholesky factor, anything above the diagonal.

    Raises:
        LinAlgError: it is not positive definite.
    """
    factor, failed = dpotrf(matrix.T, lower=1, clean=0)  # LAPACK's order of a symmetric one: it is not turned
    if failed:
        raise np.linalg.LinAlgError("not positive definite")
    return np.asarray(factor)


def from_lower(matrix: Array) -> Array:
    """The symmetric matrix of which this is the lower half."""
    lower = np.tril(matrix)
    return np.asarray(lower + np.tril(lower, -1).T)
