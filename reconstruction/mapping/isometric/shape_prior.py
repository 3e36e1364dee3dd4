"""What shapes a sheet takes, by those of its keyframes: what a frame hides, or what noise leaves open, follows them.

A Gaussian: the mean shape, the principal axes of the keyframes' shapes about it with their variances, and, beyond these,
anything smooth, by so much as keyframes usually differ from what all others say. Rotation and translation are free.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reconstruction.arrays import Array
from reconstruction.camera import nearest_rotation

FIRM = 2e4  # of the bending of unit size that no keyframe shows: likeliest by leaving out one keyframe after the other
LEAST = 1e-7  # the same of what does not bend
ROUNDS = 5  # of turning shapes to their mean


@dataclass(frozen=True)
class ShapePrior:
    """A Gaussian of shapes C B of smooth functions, C (3, R), turned as its mean is.

    Attributes:
        mean: (3, R).
        gram: (R, R) mean products of the functions, less their means.
        axes: (k, 3R) directions with unit variance.
        held: (3R,) precision beyond them.
        of_others: whether it is asked about the shapes that it is made of, in their order: each is judged by the others.
    """

    mean: Array
    gram: Array
    axes: Array
    held: Array
    of_others: bool

    @cached_property
    def precision(self) -> Array:
        """(3R, 3R) the inverse of the covariance, by Woodbury's formula."""
        across = self.axes * self.held
        inner = np.linalg.solve(np.eye(len(self.axes)) + across @ self.axes.T, across)
        return np.asarray(np.diag(self.held) - across.T @ inner)

    def at(self, C: Array) -> tuple[Array, Array]:
        """Precisions (F, 3R, 3R) about, and ways (F, 3R) from, the mean turned as shapes C (F, 3, R) are."""
        R, F = self._turns(C), len(C)
        by_axis = self.precision.reshape(*self.mean.shape, *self.mean.shape)
        turned = np.einsum("fij,fkl,jrls->firks", R, R, by_axis, optimize=True).reshape(F, self.mean.size, self.mean.size)
        if self.of_others:  # the covariance less what each gives to it: one column more of the precision
            own = self.axes[:F]
            column = own @ self.precision
            column /= np.sqrt(np.maximum(1 - (column * own).sum(axis=1), LEAST))[:, None]
            column = (R @ column.reshape(F, *self.mean.shape)).reshape(F, -1)
            turned += column[:, :, None] * column[:, None]
        return turned, (C - R @ self.mean).reshape(F, -1)

    def cost(self, C: Array) -> Array:
        """Squared Mahalanobis distances (F,) of shapes C (F, 3, R) from the mean."""
        away = (self._turns(C).swapaxes(1, 2) @ C - self.mean).reshape(len(C), -1)
        return np.asarray((away @ self.precision * away).sum(axis=1))

    def _turns(self, C: Array) -> Array:
        """Rotations (F, 3, 3) of the mean to shapes C (F, 3, R)."""
        return nearest_rotation(C @ self.gram @ self.mean.T)


def shape_prior(C: Array, B: Array, stiffness: Array, *, of_others: bool) -> ShapePrior:
    """The prior by shapes C (F, 3, R) in keyframes.

    Args:
        C: as above.
        B: (m, R) the functions at well-spread points; the first is 1.
        stiffness: (R,) their bending energy.
        of_others: as in `ShapePrior`.
    """
    centred = B - B.mean(axis=0)
    gram = centred.T @ centred / len(B)
    C = C.copy()
    C[:, :, 0] -= C @ B.mean(axis=0)
    mean = C[len(C) // 2]
    for _ in range(ROUNDS):
        turned = nearest_rotation(mean @ gram @ C.swapaxes(1, 2)) @ C
        mean = turned.mean(axis=0)
    turns = np.cross(np.eye(3)[:, None], mean.T[None]).swapaxes(1, 2)  # slopes of the mean by its rotation
    axes = np.concatenate([(turned - mean) / np.sqrt(len(C)), turns]).reshape(-1, mean.size)
    held = (FIRM * stiffness + LEAST) / float(np.trace(mean @ gram @ mean.T))
    return ShapePrior(mean, gram, axes, np.tile(held, 3), of_others)
