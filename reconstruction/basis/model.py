"""A rest shape with its modes made dimensionless, seen by a camera: from its units to the solver and back (paper §3.3).

Inside, lengths are over the rest shape's RMS radius, and image points over the radius that it has in the first frame,
whatever the units of the two are.
"""

from copy import copy
from dataclasses import replace

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.constraints import CoarseEdges
from reconstruction.basis.mesh import Mesh, farthest_points, mesh_from_faces, triangulate, unique_edges, without_strays
from reconstruction.basis.modal_basis import ModalBasis, principal_axes
from reconstruction.basis.rest_shape import RestShape, RigidMotion, rms_radius
from reconstruction.camera import Camera, farness, nearest_rotation, quaternion_from_rotation, rotation_from_quaternion
from reconstruction.estimate import ShapeEstimate
from reconstruction.settings import Metric
from reconstruction.state import State

COARSE_VERTICES = 60  # at least so many,
VERTICES_PER_MODE = 1.6  # and so many for each mode: between fewer, modes stretch
TURNS = 3  # of pose and Λ, each with the other known
STAYS = 0.02  # pull of Λ to the frame before, against 1 of a mode that shows in all points


class Model:
    """A modal basis seen by a camera, dimensionless and in the rest shape's principal frame.

    Args:
        scale: pixels of the first frame in a unit of the rest shape.

    Attributes:
        basis: the modes, in units of the rest shape.
        mesh: connectivity of the points.
        camera: the camera, in pixels.
        scale: as given.
        radius: RMS distance of the rest shape's points to their centroid: the unit of length inside.
        radius_px: the same in the first frame: the unit of image points inside.
        B: (4 + r, p) rows S̄', Υ' = √p Υ, 1.
        focal: focal length in units of `radius_px`.
    """

    def __init__(self, basis: ModalBasis, mesh: Mesh, camera: Camera, scale: float = 1.0) -> None:
        self.basis, self.mesh, self.camera, self.scale = basis, mesh, camera, scale
        p = basis.rest.shape[1]
        self.radius = rms_radius(basis.rest)
        self.radius_px = scale * self.radius
        self.focal = camera.focal_px / self.radius_px
        self.B = np.concatenate([basis.Phi.T @ basis.rest / self.radius, np.sqrt(p) * basis.Upsilon, np.ones((1, p))])

    def scaled(self, factor: float) -> "Model":
        """The same in other units of the rest shape: so many times as many, each so much smaller."""
        return Model(replace(self.basis, rest=factor * self.basis.rest), self.mesh, self.camera, self.scale / factor)

    def of_points(self, some: Indices) -> "Model":
        """The same for some of the points only, without a mesh of their own: poses and Λ' are those of all."""
        few = copy(self)
        gain = float(np.sqrt(self.B.shape[1] / len(some)))
        rest, Upsilon = self.basis.rest[:, some], gain * self.basis.Upsilon[:, some]
        few.basis, few.B = replace(self.basis, rest=rest, Upsilon=Upsilon), self.B[:, some]
        return few

    def mirrored(self) -> "Model":
        """The same with its depth reversed; of Λ', row τ, too."""
        flip = np.diag([1.0, 1.0, -1.0])
        basis = replace(self.basis, rest=flip @ self.basis.rest, Phi=flip @ self.basis.Phi @ flip)
        return Model(basis, self.mesh, self.camera, self.scale)

    def begun(self, motion: RigidMotion) -> "Model":
        """The same with its rest shape posed first as in another frame."""
        return Model(self.basis, facing(self.mesh, motion), self.camera, float(motion.s[0]))

    @property
    def unit(self) -> float:
        """What Λ' is multiplied by to give Λ in units of the rest shape."""
        return self.radius * float(np.sqrt(self.B.shape[1]))

    def normalised(self, W: Array) -> Array:
        """Image points (..., 2, p) px as the solver wants them."""
        return (W - self.camera.center_px[:, None]) / self.radius_px

    def projection(self, state: State, frame: int = -1) -> Array:
        """Image (2, p) px of one frame of a state."""
        seen = state.matrices()[frame] @ self.B
        depth = 1 + seen[2] / self.focal
        return seen[:2] / depth * self.radius_px + self.camera.center_px[:, None]

    def residuals(self, W: Array, state: State, frame: int = -1) -> Array:
        """Reprojection errors (2, p) px of one frame of a state."""
        return W - self.projection(state, frame)

    def estimate(self, frame: int, W: Array, visible: Mask, state: State, row: int = -1) -> ShapeEstimate:
        """One frame of a state in the units of rest shape and image; the observation W (2, p) gives the residuals."""
        R = rotation_from_quaternion(state.q[row]) @ self.basis.Phi.T
        s = self.scale * float(np.exp(state.log_s[row]))
        t = state.t[row] * self.radius_px
        Lambda = state.Lambda[row] * self.unit
        shape = self.shape(R, t, s, Lambda)
        projection = self.projection(state, row)
        residual = np.where(visible, np.linalg.norm(np.where(visible, W - projection, 0.0), axis=0), np.nan)
        return ShapeEstimate(
            frame, quaternion_from_rotation(R), R, t, s, Lambda, shape, projection.T.copy(), residual, visible
        )

    def shape(self, R: Array, t: Array, s: float, Lambda: Array) -> Array:
        """The shape (3, p) in camera axes, units of the rest shape, of pose and Λ as a `ShapeEstimate` has them."""
        if self.camera.perspective:
            origin = np.array([t[0] / s, t[1] / s, self.camera.focal_px / s])
            return np.asarray(R @ self.basis.deform(Lambda) + origin[:, None])
        return np.asarray(s * (R @ self.basis.deform(Lambda)) + np.array([*t, 0.0])[:, None])

    def state_of(self, shape: Array, camera: Camera, seen: Mask, last: State | None) -> State | None:
        """Pose and Λ' (n = 1) with which the model comes nearest to a shape; None if that is behind the camera.

        Args:
            shape: (3, p) in camera axes and units of the rest shape.
            camera: in perspective, also where the model's own is orthographic: its depth goes with that focal length.
            seen: (p,) the points to come near to.
            last: the frame before, if there is one (n >= 1): what does not show in these points stays as it was.
        """
        B = self.B if seen.all() else self.B[:, seen]
        gram, said = B @ B.T, shape[:, seen] @ B.T / self.radius
        modes, r, shown = slice(3, -1), len(B) - 4, gram[-1, -1]
        pull = STAYS * self.B.shape[1]
        before = np.zeros((3, r)) if last is None else last.Lambda[-1]
        Lambda, middle = np.zeros((3, r)), said[:, -1:] / shown
        held = np.linalg.inv(gram[modes, modes] + pull * np.eye(r))
        for _ in range(TURNS):
            model = np.concatenate([np.eye(3), Lambda, np.zeros((3, 1))], axis=1)  # times B: the shape by now
            centre = model @ gram[:, -1:] / shown
            R = nearest_rotation(said @ model.T - shown * middle @ centre.T)
            origin = middle - R @ centre
            wanted = R.T @ (said - origin * gram[-1])[:, modes] - gram[:3, modes] + pull * before
            Lambda = wanted @ held
        if origin[2, 0] <= 0:
            return None
        s = camera.focal_px / (self.radius_px * origin[2, 0])
        t = s * origin[:2, 0] + self.normalised(camera.center_px[:, None])[:, 0]
        return State(quaternion_from_rotation(R)[None], t[None], np.log([s]), Lambda[None])

    def coarse_edges(self, vertices: int | None = None) -> CoarseEdges:
        """Edges of a coarse mesh through well-spread points, triangulated in the main plane; finer for more modes."""
        rest, modes = self.B[:3], self.B[3:-1]
        vertices = vertices or max(COARSE_VERTICES, round(VERTICES_PER_MODE * len(modes)))
        chosen = farthest_points(rest.T, vertices)
        edges = chosen[unique_edges(triangulate(rest[:2, chosen].T).faces)]
        start, end = edges.T
        d, middle = rest[:, end] - rest[:, start], (rest[:, end] + rest[:, start]) / 2
        return CoarseEdges(d, modes[:, end] - modes[:, start], np.linalg.norm(d, axis=0), middle)


def build_model(
    rest: RestShape,
    camera: Camera,
    modes: int,
    metric: Metric = "euclidean",
    mesh: Mesh | None = None,
    seen: Mask | None = None,
    own_motion: Array | None = None,
) -> Model:
    """Mesh and modes of a rest shape.

    Args:
        rest: the rest shape.
        camera: what sees it.
        modes: how many.
        metric: the dissimilarity they come from.
        mesh: its mesh, if it has one; else points are triangulated,
        seen: and those at the border that views (K, p) hardly ever show, or far off, left out: modes are those of all.
        own_motion: as for `modal_basis`.

    Raises:
        ReconstructionError: more modes than the points carry.
    """
    from reconstruction.basis.modes import modal_basis  # SciPy takes its time to load, and who only draws needs none

    shape, whole = rest.motion.shape, mesh or triangulated(rest, camera, seen)
    basis = modal_basis(shape, whole, modes, metric, own_motion)
    shown = whole if mesh or seen is None else without_strays(whole, shape, seen)
    return Model(basis, shown, camera, float(rest.motion.s[0]))


def triangulated(rest: RestShape, camera: Camera, seen: Mask | None = None) -> Mesh:
    """A mesh of a rest shape's points, facing the camera in the first frame.

    Points of a solid are triangulated in the view that shows most of them (the first frame's where views (K, p) are not
    given): there, none is before another. Those of a sheet in its main plane.
    """
    motion = rest.motion
    if rest.kind != "rigid":
        return facing(triangulate((principal_axes(motion.shape).T @ motion.shape)[:2].T), motion)
    k = 0 if seen is None else int(seen.sum(axis=1).argmax())
    placed = motion.s[k] * (motion.R[k] @ motion.shape)
    image = (placed[:2] + motion.t[k][:, None]) / farness(placed, 1 / camera.focal_px)
    return facing(triangulate(image.T), motion)


def facing(mesh: Mesh, motion: RigidMotion) -> Mesh:
    """A mesh whose outward normals face the camera in the first frame."""
    x, y = (motion.R[0] @ motion.shape)[:2]
    a, b, c = mesh.faces.T
    area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
    # y points down: they do when the image winds the other way.
    return mesh_from_faces(mesh.faces[:, ::-1]) if area.sum() > 0 else mesh
