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
    factor, failed = dpotrf(matrix, lower=1)
    if failed:
        raise np.linalg.LinAlgError("not positive definite")
    inverse = np.tril(dpotri(factor, lower=1)[0])
    return np.asarray(inverse + np.tril(inverse, -1).T)
