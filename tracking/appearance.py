"""Patches of the reference frame around the points, aligned to a frame to a fraction of a pixel."""

from dataclasses import dataclass
from functools import cached_property
from typing import cast

import cv2
import numpy as np

from tracking import Array, Flags, Floats, Indices

MAX_STEP = 2.0  # patch pixels; beyond, the linear model of the patch does not hold
CONVERGED = 0.05  # patch pixels; a shorter step ends the search
FLAT = 1.0  # grey levels, norm of a patch: below, it has no appearance (rounding leaves 1e-3)
# Light, deformation and compression spoil neighbouring pixels together: so many count as one. Measured against the truth as
# squared errors over those of independent pixels: 38 and 19 (kinect_paper's picture and its half), 16 to 40 (made-up faces,
# hardly any texture, down to the quarter of the picture).
SHARED_ERROR = 30.0
FINEST = 1e-4  # px²: no place is surer than a hundredth of a pixel


@dataclass(frozen=True)
class Alignment:
    """Where patches were found.

    Attributes:
        points_px: (n, 2) aligned positions.
        score: (n,) normalised cross-correlation there, -1 to 1.
        score_before: (n,) the same at the first guess.
        spread: (n, 2, 2) inverse normal matrices of the patches, as they were.
        affine: (n, 2, 2) maps from the patches to the picture.
        samples: of a patch.
    """

    points_px: Array
    score: Array
    score_before: Array
    spread: Array
    affine: Array
    samples: int

    @cached_property
    def covariance(self) -> Array:
        """(n, 2, 2) px² of the positions, by what the patches leave over: large along an edge."""
        noise = SHARED_ERROR * 2 * (1 - self.score).clip(1e-6) / self.samples
        spread = self.affine @ self.spread @ np.swapaxes(self.affine, 1, 2)
        return np.asarray(noise[:, None, None] * spread + FINEST * np.eye(2))

    @property
    def sigma_px(self) -> Array:
        """Standard deviation (n,) in the direction that is known least."""
        half = np.trace(self.covariance, axis1=1, axis2=2) / 2
        return np.sqrt(half + np.sqrt((half**2 - np.linalg.det(self.covariance)).clip(0)))


class Fusion:
    """What several pictures and the neighbours say about places (n, 2) px, each as sure as it is: weighted means.

    Args:
        points_px: (n, 2) where they are as long as nothing is said.
    """

    def __init__(self, points_px: Array) -> None:
        self._start = points_px
        self._known = np.zeros((len(points_px), 2, 2))
        self._sum = np.zeros((len(points_px), 2))

    def add(self, points_px: Array, covariance: Array, good: Flags, which: Indices | slice = slice(None)) -> None:
        """Places (m, 2) px of some points, `which` (m,), with covariance (m, 2, 2) px², where `good` (m,)."""
        known = np.where(good[:, None, None], np.linalg.inv(covariance), 0.0)
        self._known[which] += known
        self._sum[which] += (known @ (points_px - self._start[which])[:, :, None])[:, :, 0]

    @property
    def points_px(self) -> Array:
        """The means (n, 2)."""
        known = np.where(self._known[:, :1, :1] > 0, self._known, np.eye(2))
        return self._start + np.linalg.solve(known, self._sum[:, :, None])[:, :, 0]


class Appearance:
    """Square patches around the points of one frame, compared regardless of gain, offset and slope of the light.

    What bends or turns is lit otherwise on one side than on the other, and highlights stay where they are while texture
    moves on: to first order, a slope over the patch.

    A patch is found again by inverse-compositional alignment (Baker & Matthews 2004, translation only): its
    gradients and normal matrices are computed once, an iteration samples the new picture and multiplies.

    Args:
        image: (H, W) float32 picture, e.g. a level of a pyramid.
        points_px: (P, 2) patch centres in that picture.
        radius: patches have (2 radius + 1)² samples.
    """

    def __init__(self, image: Floats, points_px: Array, radius: int) -> None:
        steps = np.arange(-radius, radius + 1, dtype=np.float32)
        u, v = np.meshgrid(steps, steps)
        self._grid = np.stack([u.ravel(), v.ravel(), np.ones(u.size, np.float32)])
        self._slopes = (self._grid / np.linalg.norm(self._grid, axis=1, keepdims=True)).T  # orthonormal
        self._templates = np.empty((len(points_px), 3, steps.size**2), np.float32)
        self._inverse = np.empty((len(points_px), 2, 2))
        self.learn(image, points_px, np.broadcast_to(np.eye(2), (len(points_px), 2, 2)), np.arange(len(points_px)))

    def learn(self, image: Floats, points_px: Array, affine: Array, which: Indices) -> None:
        """The points `which` look as they do in a picture from now on.

        Args:
            image: (H, W) float32 picture.
            points_px: (n, 2) where they are in it.
            affine: (n, 2, 2) maps from the patch to the picture.
            which: (n,) the points' indices.
        """
        patches = _sample(image, points_px, affine, self._grid)
        contrast = self._even(patches)
        patches /= contrast
        gradients = [
            (_sample(image, points_px + step, affine, self._grid) - _sample(image, points_px - step, affine, self._grid))
            / (2.0 * contrast)
            for step in np.moveaxis(affine, 2, 0)
        ]
        for gradient in gradients:  # the part that the light and gain cannot explain
            self._even(gradient)
            gradient -= _dot(gradient, patches)[:, None] * patches
        # All are free of the light, and the gradients of the patch: one product with what is seen gives score and slope.
        templates = np.stack([patches, *gradients], axis=1)
        normal = (templates[:, 1:] @ np.swapaxes(templates[:, 1:], 1, 2)).astype(np.float64)
        normal[:, (0, 1), (0, 1)] += 1e-3 * np.trace(normal, axis1=1, axis2=2)[:, None] + 1e-9
        self._templates[which], self._inverse[which] = templates, np.linalg.inv(normal)

    def clarity(self, which: Indices) -> Array:
        """How sharp the patches of the points `which` (n,) are along the direction in which they are least: (n,)."""
        return np.asarray(1.0 / np.linalg.eigvalsh(self._inverse[which])[:, -1])

    def align(self, image: Floats, points_px: Array, affine: Array, which: Indices, iterations: int) -> Alignment:
        """Move the points `which` to where the picture looks most like their patches.

        Args:
            image: (H, W) float32 picture.
            points_px: (n, 2) first guesses.
            affine: (n, 2, 2) maps from the patch to the picture.
            which: (n,) the points' indices.
            iterations: most steps taken; with 0 the guesses are only scored.
        """
        points = points_px.copy()
        score, slope = self._compare(image, points, affine, which)
        before = score.copy()
        moving = np.arange(len(which))
        for _ in range(iterations):
            step = (self._inverse[which[moving]] @ slope[:, :, None])[:, :, 0]
            length = np.linalg.norm(step, axis=1)
            step /= np.maximum(1.0, length / MAX_STEP)[:, None]
            points[moving] -= (affine[moving] @ step[:, :, None])[:, :, 0]
            moving = moving[length > CONVERGED]  # a shorter step changes neither score nor slope
            if len(moving) == 0:
                break
            score[moving], slope = self._compare(image, points[moving], affine[moving], which[moving])
        return Alignment(points, score, before, self._inverse[which], affine, self._grid.shape[1])

    def _compare(self, image: Floats, points: Array, affine: Array, which: Indices) -> tuple[Array, Array]:
        """Score (n,) and half its falling slope (n, 2) where the picture is sampled for the points `which`."""
        seen = _sample(image, points, affine, self._grid)
        contrast = self._even(seen)
        templates = self._templates if len(which) == len(self._templates) else self._templates[which]
        products = ((templates @ seen[:, :, None])[:, :, 0] / contrast).astype(np.float64)
        return products[:, 0], products[:, 1:]

    def _even(self, patches: Floats) -> Floats:
        """Take offset and slope of the light from patches (n, m), in place; their norms (n, 1)."""
        patches -= (patches @ self._slopes) @ self._slopes.T
        return np.maximum(np.sqrt(_dot(patches, patches)), FLAT)[:, None]


def _sample(image: Floats, centres: Array, affine: Array, grid: Floats) -> Floats:
    """The picture (n, m) at the m grid points (u, v, 1) mapped by each affine map about its centre."""
    if len(centres) == 0:
        return np.empty((0, grid.shape[1]), np.float32)
    maps = np.concatenate([affine, centres[:, :, None]], axis=2).astype(np.float32)
    x, y = maps[:, 0] @ grid, maps[:, 1] @ grid
    return cast(Floats, cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def _dot(a: Floats, b: Floats) -> Floats:
    return cast(Floats, np.einsum("ij,ij->i", a, b))
