"""Windows of frames with data that fit them badly, and energies of one term or of all."""

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st

from reconstruction.basis.model import Model
from reconstruction.state import State
from reconstruction.window.energy import Energy
from reconstruction.window.marginal import Previous
from reconstruction.window.statistics import Statistics
from tests.reconstruction.world import (
    ORTHOGRAPHIC,
    model_of,
    random_state,
    relief,
    statistics_of,
)

FRAMES, MODES, POINTS = 3, 3, 25
SILENT = Energy(rotation=0.0, scale=0.0, smoothness=0.0, rest=0.0)
ROWS = st.sampled_from([(0, 1, 2), (2,), (0, 1), ()])


@dataclass
class Scene:
    """A window of frames with data that fit it badly."""

    model: Model
    W: np.ndarray
    weights: np.ndarray
    data: Statistics
    state: State
    before: Previous


def scene_of(rng: np.random.Generator, camera=ORTHOGRAPHIC) -> Scene:  # type: ignore[no-untyped-def]
    model = model_of(relief(rng, POINTS), camera, MODES)
    W = 80 * rng.normal(size=(FRAMES, 2, POINTS)) + camera.center_px[:, None]
    weights = np.where(rng.random((FRAMES, POINTS)) < 0.7, rng.random((FRAMES, POINTS)), 0.0)
    chain = random_state(rng, FRAMES + 1, MODES)
    return Scene(model, W, weights, statistics_of(model, W, weights), chain[1:], Previous(chain[:1]))


def held(scene: Scene, rng: np.random.Generator, rows: tuple[int, ...]) -> Scene:
    """The same with what is known of the rows of Λ from the frames before."""
    root = rng.normal(size=2 * [len(rows) * MODES])
    return replace(scene, before=replace(scene.before, information=root @ root.T))


def nothing_seen(scene: Scene) -> Statistics:
    """Data terms that are zero, so that another term stands alone."""
    return statistics_of(scene.model, scene.W, np.zeros_like(scene.weights))


def terms(scene: Scene) -> dict[str, Energy]:
    """Energies of one prior each."""
    edges = scene.model.coarse_edges(12)
    return {
        "rotation": replace(SILENT, rotation=0.7),
        "scale": replace(SILENT, scale=0.6),
        "smoothness": replace(SILENT, smoothness=np.array([0.2, 0.3, 0.6])),
        "jumps": replace(SILENT, smoothness=np.array([0.2, 0.3, 0.6]), jump=0.05),
        "rest": replace(SILENT, rest=0.9),
        "inextensibility": replace(SILENT, inextensibility=2.0, edges=edges),
    }


def everything(scene: Scene, rows: tuple[int, ...], *, tied: bool) -> Energy:
    """Every term, with a pull to rest of its own for each mode."""
    return Energy(
        rotation=0.7,
        scale=0.6,
        smoothness=0.3,
        rest=np.array([0.5, 0.9, 1.3]),
        inextensibility=2.0,
        rows=rows,
        tied=tied,
        edges=scene.model.coarse_edges(12),
    )


def replace_states(scene: Scene, state: State) -> Scene:
    before = replace(scene.before.state, Lambda=np.zeros((1, 3, state.Lambda.shape[2])))
    return replace(scene, state=state, before=Previous(before))
