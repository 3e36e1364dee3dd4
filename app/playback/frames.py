"""The frames of a recording: where its points were seen in them, and their estimates by one model."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from app.arrays import Array, Flags, Indices
from app.playback.reading.checks import LARGEST, LARGEST_PX, numbers
from app.playback.reading.rows import Rows
from app.recording import entities
from reconstruction.basis.model import Model
from reconstruction.camera import quaternion_from_rotation, rotation_from_quaternion
from reconstruction.estimate import ShapeEstimate
from reconstruction.state import State

OBSERVATION = "modeshape.Observation:"
POSITIONS = "Points2D:positions"
ESTIMATE = "modeshape.Estimate:"
FAR = 100.0  # times the size, at which an orthographic camera may as well stand


@dataclass(frozen=True)
class Observations:
    """The part of a recording that every frame has; F frames, P points.

    Attributes:
        frames: (F,) numbers of the frames in their source.
        times_s: (F,) their times.
        phases: (F) phase of the run at each.
        W: (F, 2, P) observed px, NaN where not visible.
        visible: (F, P) whether a point was seen.
    """

    frames: Indices
    times_s: Array
    phases: list[str]
    W: Array
    visible: Flags


def read_observations(rows: Rows) -> Observations | None:
    """Frames and observations, or None if there is not a single frame.

    Raises:
        ValueError: the points and their visibility disagree.
    """
    observed = rows.last(entities.OBSERVATION, f"{OBSERVATION}visible")
    seen = rows.last(entities.SEEN, POSITIONS)
    phases = rows.last(entities.OBSERVATION, f"{OBSERVATION}phase")
    frames = sorted(observed.keys() & seen.keys() & phases.keys())  # what was cut off may have one without another
    if not frames:
        return None
    visible = np.stack([cast(Flags, observed[k].value) for k in frames])
    points = np.full((*visible.shape, 2), np.nan)
    positions = np.concatenate([cast(Array, seen[k].value) for k in frames])
    if visible.dtype != np.bool_ or positions.shape != (visible.sum(), 2):
        raise ValueError("the points and their visibility disagree")
    if visible.any():
        numbers(positions, "places of points", LARGEST_PX)
    points[visible] = positions
    return Observations(
        frames=np.array(frames, np.int64),
        times_s=np.array([observed[k].time_s for k in frames]),
        phases=[cast(list[str], phases[k].value)[0] for k in frames],
        W=points.transpose(0, 2, 1).copy(),
        visible=visible,
    )


@dataclass(frozen=True)
class Estimates:
    """Poses and Λ of F frames; NaN in those without a shape.

    Attributes:
        quaternion: (F, 4) w first.
        t: (F, 2) px.
        s: (F,).
        Lambda: (F, 3, r) px.
        sigma: (F, P) standard deviations of the vertices; NaN if they were not asked for.
        before: of rows that an earlier model was made for, that model and the one row as it was shown.
    """

    quaternion: Array
    t: Array
    s: Array
    Lambda: Array
    sigma: Array
    before: "dict[int, tuple[Model, Estimates]]" = field(default_factory=dict)

    def scaled(self, factor: float) -> "Estimates":
        """The same in other units of the rest shape."""
        before = {i: (model.scaled(factor), one.scaled(factor)) for i, (model, one) in self.before.items()}
        return replace(self, s=self.s / factor, Lambda=factor * self.Lambda, sigma=factor * self.sigma, before=before)

    def of(self, i: int, model: Model, W: Array, visible: Flags) -> ShapeEstimate:
        """Shape and pose of row i, by the model they were made for; W (2, P) px, visible (P,)."""
        sigma = self.sigma[i] if np.isfinite(self.sigma[i]).all() else None
        if i in self.before:
            earlier, one = self.before[i]
            return replace(one.of(0, earlier, W, visible), sigma=sigma)
        q = quaternion_from_rotation(rotation_from_quaternion(self.quaternion[i]) @ model.basis.Phi)
        t, log_s = self.t[i] / model.radius_px, np.log(self.s[i] / model.scale)
        state = State(q[None], t[None], np.array([log_s]), self.Lambda[i][None] / model.unit)
        return replace(model.estimate(i, W, visible, state), sigma=sigma)


def read_estimates(rows: Rows, entity: str, frames: Sequence[int], models: Sequence[Model]) -> Estimates:
    """The estimates of frames by the last model; what an earlier one showed as near as this comes to it, and as it was."""
    modes = [len(model.basis.eigenvalues) for model in models] or [0]
    points = models[-1].basis.rest.shape[1] if models else 0
    rows_of = ((4,), (2,), (), (3, modes[-1]), (points,))
    q, t, s, Lambda, sigma = (np.full((len(frames), *size), np.nan) for size in rows_of)
    found = Estimates(q, t, s, Lambda, sigma)
    unsure = rows.last(entity, f"{ESTIMATE}sigma")
    values = {name: rows.last(entity, f"{ESTIMATE}{name}") for name in ("quaternion", "t", "s", "Lambda", "model")}
    if not models:
        return found
    for i, frame in enumerate(frames):
        if not all(frame in rows_of_name for rows_of_name in values.values()):
            continue
        q, t, s, Lambda, number = (np.asarray(cast(Array, one[frame].value)) for one in values.values())
        for name, value in (("rotations", q), ("places", t), ("sizes", s), ("deformations", Lambda)):
            numbers(value, f"frame {frame} has {name}", LARGEST)
        if not (s[0] > 0 and int(number[0]) >= 0 and np.abs(q @ q - 1) < 1e-3):
            raise ValueError(f"the shape of frame {frame} has no size or no orientation")
        model = models[int(number[0])]
        if model is not models[-1]:
            single = Estimates(q[None], t[None], s, Lambda.reshape(1, 3, -1), np.full((1, points), np.nan))
            found.before[i] = model, single
            nothing = np.zeros(model.basis.rest.shape[1], np.bool_)
            seen = translated(models[-1], model, single.of(0, model, np.zeros((2, len(nothing))), nothing))
            q, t, s, Lambda = seen.quaternion, seen.t, np.array([seen.s]), seen.Lambda
        found.quaternion[i], found.t[i], found.s[i], found.Lambda[i] = q, t, s[0], Lambda.reshape(3, -1)
        if frame in unsure:
            found.sigma[i] = cast(Array, unsure[frame].value)
    return found


def translated(model: Model, before: Model, seen: ShapeEstimate) -> ShapeEstimate:
    """The estimate that comes nearest to one of a model before, of the same points, at the same place in the image.

    Raises:
        ValueError: it is behind the camera.
    """
    camera = model.camera if model.camera.perspective else replace(model.camera, focal_px=FAR * model.radius)
    origin = np.array([*seen.t, camera.focal_px]) / seen.s
    shape = seen.R @ before.basis.deform(seen.Lambda) + origin[:, None]
    state = model.state_of(shape, camera, np.ones(shape.shape[1], np.bool_), None)
    if state is None:
        raise ValueError("a shape is behind the camera")
    return model.estimate(seen.frame, seen.projection_px.T, seen.visible, state)
