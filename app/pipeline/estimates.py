"""What a run or an evaluation collects and puts out: shapes, scores, files."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from app.arrays import Array, Indices
from app.files.writing import writable
from app.pipeline.quality.course import Course
from app.pipeline.quality.ruler import Ruler
from app.terminal.summary import Summary
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.model import Model
from reconstruction.basis.surface import Surface
from reconstruction.estimate import ShapeEstimate
from reconstruction.evaluation import Score, centred, followed, known_in, score
from tracking.tracks import Truth

ROUNDING = 1e-6  # of the size


@dataclass
class Collected:
    """Estimates that are kept: all if they are to be saved, else those of truth frames only.

    Attributes:
        everything: whether every estimate is kept.
        truth_frames: source frames whose estimates are kept.
        estimates: by source frame.
        lost: source frames without the object, if everything is kept.
        squared_px: sum of the squared reprojection errors so far.
        residuals: their number.
        last_rms_px: of the newest estimate.
        switches: how often the window took another branch: bent or tilted otherwise.
        course: what each frame tells of its quality.
        ruler: a known length; None if there is none.
    """

    everything: bool
    truth_frames: frozenset[int] = frozenset()
    estimates: dict[int, ShapeEstimate] = field(default_factory=dict)
    lost: list[int] = field(default_factory=list)
    squared_px: float = 0.0
    residuals: int = 0
    last_rms_px: float | None = None
    switches: int = 0
    course: Course = field(default_factory=Course)
    ruler: Ruler | None = None

    def add(self, frame: int, estimate: ShapeEstimate) -> None:
        """Add the estimate of a source frame."""
        seen = estimate.residual_px[estimate.visible]
        squared = float(seen @ seen)
        self.last_rms_px = float(np.sqrt(squared / len(seen))) if len(seen) else None
        self.squared_px += squared
        self.residuals += len(seen)
        self.switches += estimate.switch is not None
        self.course.add(frame, estimate)
        if self.ruler is not None:
            self.ruler.add(estimate.shape)
        if self.everything or frame in self.truth_frames:
            self.estimates[frame] = estimate

    def lose(self, frame: int) -> None:
        """Note a source frame in which the object is lost."""
        self.course.lost += 1
        if self.everything:
            self.lost.append(frame)

    @property
    def reprojection_rms_px(self) -> float | None:
        """Over all visible points of all frames."""
        return float(np.sqrt(self.squared_px / self.residuals)) if self.residuals else None

    def score_against(self, truth: Truth, rest: Array, mesh: Mesh) -> Score | None:
        """Score on truth points followed in the mesh; None if no truth frame has a shape.

        Raises:
            ReconstructionError: the truth points lie outside the mesh.
        """
        both = self._both(truth, rest, mesh)
        if both is None:
            return None
        found, still, S, frames = both
        return score(found[:, :3], still, S, frames, found[:, 3] if found.shape[1] > 3 else None)

    def true_shapes(self, truth: Truth, rest: Array, mesh: Mesh) -> dict[int, Array]:
        """True points (n, 3) by source frame, those known, as large as ours and in the same place.

        Raises:
            ReconstructionError: as of `score_against`.
        """
        both = self._both(truth, rest, mesh)
        if both is None:
            return {}
        found, _, S, frames = both
        known, found = known_in(S), found[:, :3]
        ours, S = centred(found, known), centred(S, known)
        placed = np.linalg.norm(ours) / np.linalg.norm(S) * S + found - ours
        return {int(frame): points[:, seen].T for frame, points, seen in zip(frames, placed, known, strict=True)}

    def _both(self, truth: Truth, rest: Array, mesh: Mesh) -> tuple[Array, Array, Array, Indices] | None:
        """Ours (K, 3, n), or 4 with sigma, that at rest (3, n), the true shapes (K, 3, n), and their frames (K,)."""
        chosen = [k for k, frame in enumerate(truth.frames) if int(frame) in self.estimates]
        if not chosen:
            return None
        kept = [self.estimates[int(truth.frames[k])] for k in chosen]
        known = [e.shape if e.sigma is None else np.vstack([e.shape, e.sigma]) for e in kept]
        found, still, inside = followed(known, [e.projection_px for e in kept], rest, mesh, truth.W_px[chosen[0]].T)
        return found, still, truth.S[chosen][:, :, inside], truth.frames[chosen]


@dataclass(frozen=True)
class Scores(Summary):
    """A score as it is told: errors against the truth, and how many points and frames of it there are."""

    e3d: float
    e3d_camera: float
    e3d_static: float
    e3d_sign_free: float
    truth_points: int
    truth_frames: int
    error_over_sigma: float | None = None

    @classmethod
    def of(cls, result: Score) -> Self:
        """Without the errors of single frames."""
        return cls(
            result.e3d,
            result.e3d_camera,
            result.e3d_static,
            result.e3d_sign_free,
            result.points,
            len(result.frames),
            result.error_over_sigma,
        )


def sigmas(estimates: Iterable[ShapeEstimate]) -> Array | None:
    """Standard deviations (F, P) of the vertices; None if they were not asked for."""
    known = [e.sigma for e in estimates if e.sigma is not None]
    return np.stack(known) if known else None


def save_shapes(
    path: Path, estimates: Mapping[int, ShapeEstimate], model: Model, lost: Iterable[int] = (), unit: float = 1.0
) -> None:
    """Write S (F, 3, P) camera axes; R, s, t, Lambda, faces, visible, frames, and the basis they refer to.

    And sigma (F, P), the standard deviations of the vertices, if they were asked for; strain and curvature (F, P), see
    `reconstruction.basis.surface`. Lengths are in pixels of the first
    frame, or in another unit, of which a pixel has so many. Frames in which the surface was lost get rows of NaN; so do R
    and Lambda where another model was in force.

    Raises:
        UsageError: the file cannot be written.
    """
    frames = sorted({*estimates, *lost})
    nothing = without_shape(next(iter(estimates.values())))
    rows, r = [estimates.get(frame, nothing) for frame in frames], len(model.basis.eigenvalues)
    basis, sigma = model.basis, sigmas(rows)
    poses = [(e.R, e.Lambda) if is_of(e, model) else (np.full((3, 3), np.nan), np.full((3, r), np.nan)) for e in rows]
    arrays: dict[str, Any] = {
        "S": unit * np.stack([e.shape for e in rows]),
        "R": np.stack([R for R, _ in poses]),
        "s": np.array([e.s for e in rows]) / unit,
        "t": np.stack([e.t for e in rows]),
        "Lambda": unit * np.stack([Lambda for _, Lambda in poses]),
        "visible": np.stack([e.visible for e in rows]),
        "frames": np.array(frames),
        "faces": model.mesh.faces,
        "rest": unit * basis.rest,
        "Upsilon": basis.Upsilon,
        "eigenvalues": basis.eigenvalues,
        "Phi": basis.Phi,
        "K": model.camera.K,
        "perspective": model.camera.perspective,
    }
    if sigma is not None:
        arrays["sigma"] = unit * sigma
    surface = Surface(arrays["rest"], model.mesh.faces)
    arrays["strain"] = np.stack([surface.strain(shape) for shape in arrays["S"]])
    arrays["curvature"] = np.stack([surface.curvature(shape) for shape in arrays["S"]])
    with writable(path) as file:
        np.savez_compressed(file, **arrays)


def is_of(estimate: ShapeEstimate, model: Model) -> bool:
    """Whether the pose and Λ of an estimate are of that model: then its shape follows from them."""
    if len(estimate.Lambda.T) != len(model.basis.eigenvalues):
        return False
    scale = 1.0 if model.camera.perspective else estimate.s
    off = estimate.shape - scale * estimate.R @ model.basis.deform(estimate.Lambda)
    return bool(np.ptp(off, axis=1).max() < ROUNDING * np.ptp(estimate.shape))


def without_shape(like: ShapeEstimate) -> ShapeEstimate:
    """An estimate of the same size that says nothing: NaN, and no point visible."""

    def nan(value: Array) -> Array:
        return np.full_like(value, np.nan)

    return ShapeEstimate(
        frame=-1,
        quaternion=nan(like.quaternion),
        R=nan(like.R),
        t=nan(like.t),
        s=np.nan,
        Lambda=nan(like.Lambda),
        shape=nan(like.shape),
        projection_px=nan(like.projection_px),
        residual_px=nan(like.residual_px),
        visible=np.zeros_like(like.visible),
        sigma=None if like.sigma is None else nan(like.sigma),
    )
