"""The camera: scaled orthography (Eq. 7, 8) and perspective as one model, and rotations as quaternions."""

from dataclasses import dataclass, field

import numpy as np

from reconstruction.arrays import Array

NEAREST = 0.1  # a point's depth over its view's, closer than which no point that is seen may come to the camera


@dataclass(frozen=True)
class Camera:
    """A pinhole in pixels; an infinite focal length is the paper's scaled-orthographic camera.

    Attributes:
        focal_px: focal length, > 0; `inf` for orthography.
        center_px: (2,) principal point.
    """

    focal_px: float = np.inf
    center_px: Array = field(default_factory=lambda: np.zeros(2))

    @property
    def perspective(self) -> bool:
        """Whether depth changes the apparent size."""
        return bool(np.isfinite(self.focal_px))

    @property
    def K(self) -> Array:
        """(3, 3) intrinsics; focal length 1 where it is infinite."""
        f = self.focal_px if self.perspective else 1.0
        return np.array([[f, 0.0, self.center_px[0]], [0.0, f, self.center_px[1]], [0.0, 0.0, 1.0]])

    def project(self, points: Array) -> Array:
        """Image (..., 2, p) px of points (..., 3, p) in camera axes; orthography drops the depth."""
        xy, z = points[..., :2, :], points[..., 2:3, :]
        scaled = xy * (self.focal_px / z) if self.perspective else xy
        return scaled + self.center_px[:, None]


def farness(placed: Array, kappa: float) -> Array:
    """Depths (..., p) of points (..., 3, p) over their middle's, at least `NEAREST`; kappa is 1/focal length."""
    return np.maximum(1 + kappa * placed[..., 2, :], NEAREST)


def picture_camera(size: tuple[int, int], focal_px: float | None = None) -> Camera:
    """The camera of a picture (width, height) px: its focal length, or that of most phones and webcams, held either way."""
    return Camera(float(max(size)) if focal_px is None else focal_px, np.array(size) / 2)


def lens(W: Array, sizes: float) -> Camera:
    """A camera in perspective before points (K, 2, p) px, NaN where not seen, its focal length so many times their size."""
    size = float(np.nanmedian(np.sqrt(np.nanvar(W, axis=2).sum(axis=1))))
    return Camera(sizes * size, np.nanmean(W, axis=(0, 2)))


def _hamilton() -> Array:
    """LEFT (4, 4, 4): ab = (Σ_i a_i LEFT[i]) b, w first."""
    left = np.zeros((4, 4, 4))
    left[0] = np.eye(4)
    for i, j, k in ((1, 2, 3), (2, 3, 1), (3, 1, 2)):
        left[i, i, 0], left[i, 0, i] = 1.0, -1.0
        left[i, k, j], left[i, j, k] = 1.0, -1.0
    return left


# Constant tensors instead of formulas: one small product for a whole window of frames.
LEFT = _hamilton()
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
# R(q)v is the vector part of q v q*, so R = Σ_ij q_i q_j SANDWICH[ij].
SANDWICH = np.einsum("ikm,nmj,j->ijkn", LEFT, LEFT, CONJUGATE)[:, :, 1:, 1:].reshape(16, 9)


def left_matrix(q: Array) -> Array:
    """Matrices (..., 4, 4) that multiply by the quaternions (..., 4) from the left."""
    return (q @ LEFT.reshape(4, 16)).reshape(*q.shape, 4)


def quaternion_product(a: Array, b: Array) -> Array:
    """Hamilton product (..., 4) of quaternions (..., 4), w first: R(ab) = R(a) R(b)."""
    return (left_matrix(a) @ b[..., None])[..., 0]


def rotation_from_quaternion(q: Array) -> Array:
    """Rotations (..., 3, 3) of unit quaternions (..., 4), w first."""
    squares = (q[..., :, None] * q[..., None, :]).reshape(*q.shape[:-1], 16)
    return (squares @ SANDWICH).reshape(*q.shape[:-1], 3, 3)


def quaternion_exp(theta: Array) -> Array:
    """Unit quaternions (..., 4) that turn by the rotation vectors `theta` (..., 3) in radians."""
    half = 0.5 * theta
    angle = np.sqrt((half * half).sum(axis=-1, keepdims=True))
    return np.concatenate([np.cos(angle), np.sinc(angle / np.pi) * half], axis=-1)


def quaternion_from_rotation(R: Array) -> Array:
    """Unit quaternions (..., 4), w first and >= 0, of rotations R (..., 3, 3)."""
    # Bar-Itzhack: the leading eigenvector of this symmetric matrix; no branches, and the nearest rotation for a noisy R.
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.moveaxis(R, (-2, -1), (0, 1))
    N = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, yx + xy, zx + xz],
            [xz - zx, yx + xy, yy - xx - zz, zy + yz],
            [yx - xy, zx + xz, zy + yz, zz - xx - yy],
        ]
    )
    q = np.linalg.eigh(np.moveaxis(N, (0, 1), (-2, -1)))[1][..., -1]
    return np.where(q[..., :1] < 0, -q, q)


def nearest_rotation(M: Array) -> Array:
    """The rotation (..., 3, 3) nearest to M (..., 3, 3) in the Frobenius norm (orthogonal Procrustes)."""
    U, _, Vt = np.linalg.svd(M)
    sign = np.linalg.det(U @ Vt)
    U = np.concatenate([U[..., :2], U[..., 2:] * sign[..., None, None]], axis=-1)
    return U @ Vt
