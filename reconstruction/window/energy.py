"""The energy of the on-line bundle adjustment (paper §5): its weights, and which energy a surface gets."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array
from reconstruction.basis.constraints import ALL_ROWS, ROWS, Bending, CoarseEdges
from reconstruction.basis.model import Model
from reconstruction.basis.rest_shape import is_flat
from reconstruction.camera import Camera
from reconstruction.settings import USUAL_MODES, Deformation
from reconstruction.state import State
from reconstruction.window import priors

FIRM = {"rest": 1e-2}  # of the guide: with less it now and then changes its side
NEGLIGIBLE = 1e-4  # of the largest eigenvalue: of points that coincide it is 0, or just below


@dataclass(frozen=True)
class Pull:
    """Minus twice the log likelihood of Λ', Λ'ᵀ(·)Λ' with its rows one after the other, times the images' variance.

    Attributes:
        form: (3r, 3r) the matrix of the quadratic form.
        variance: of the images, beside whose mean squared error it stands: that of a coordinate over the number of points.
    """

    form: Array
    variance: float


@dataclass(frozen=True)
class Energy:
    """Weights of the terms; each multiplies a sum of squares of dimensionless quantities (`priors` says which when).

    Attributes:
        rotation: λ_q on ‖Δq‖² between neighbouring frames.
        scale: λ_s on (Δ log s)².
        smoothness: λ_γ on ‖ΔΛ'‖²; (r,) where each mode has its own.
        jump: j, the smoothness cost beyond which it grows with its logarithm only; None: quadratic everywhere.
        adaptive: whether what earlier frames say about Λ' is carried over (`marginal`), and the pull to rest grows with
            the misfit.
        rest: λ_0 on ‖Λ' − Λ̄'‖², the pull to the rest shape; (r,) where each mode has its own.
        centre: Λ̄' (3, r), the refined rest shape.
        inextensibility: κ on the mean squared edge strain term of `edges`.
        rows: rows of Λ that are estimated (§3.4): 0 and 1 stretch in the plane, 2 bends out of it.
        free_scale: whether s is estimated; the paper's energy keeps that of the first frame, or after a loss.
        tied: whether the oldest frame is tied to the frame that has left the window; without, the window floats.
        edges: coarse edges of the inextensibility term.
        bending: how the rows of Λ that are not estimated follow from row τ; None: they stay at rest.
        pull: what the deformations are known to be like; instead of a pull to rest.
        residuals: weights and residuals of the priors that are given as such.
    """

    rotation: float = 3e-4
    scale: float = 1e-3
    smoothness: float | Array = 1e-2
    jump: float | None = None
    adaptive: bool = False
    rest: float | Array = 1e-2
    centre: float | Array = 0.0
    inextensibility: float = 0.0
    rows: tuple[int, ...] = ALL_ROWS
    free_scale: bool = True
    tied: bool = True
    edges: CoarseEdges | None = None
    bending: Bending | None = None
    pull: Pull | None = None
    residuals: tuple[tuple[float, priors.Residual], ...] = ()

    def about(self, centre: Array) -> "Energy":
        """The same energy about the rest shape Λ̄' (3, r): what it pulls to, and the lengths that edges keep."""
        edges = self.edges and self.edges.about(centre)
        return replace(self, centre=centre, edges=edges, bending=self.bending and self.bending.about(centre))

    @property
    def free(self) -> bool:
        """Whether shapes may deform in any way, as near as they like: those of a solid."""
        return self.rows == ALL_ROWS and self.edges is None and self.free_scale

    def completed(self, state: State) -> State:
        """The state with the rows of Λ' that are not estimated filled in."""
        if self.rows == ALL_ROWS:
            return state
        Lambda = np.broadcast_to(self.centre, state.Lambda.shape).copy()
        Lambda[:, self.rows] = state.Lambda[:, self.rows]
        return replace(state, Lambda=Lambda if self.bending is None else self.bending.completed(Lambda))


def pose_energy(camera: Camera) -> Energy:
    """The energy of a rigid shape's poses."""
    scale = priors.PERSPECTIVE_SCALE if camera.perspective else priors.ORTHOGRAPHIC_SCALE
    return Energy(rows=(), rest=0.0, rotation=1e-3, scale=scale, tied=False)


def build_energy(
    model: Model,
    deformation: Deformation,
    chosen: Mapping[str, float] | None = None,
    *,
    paper: bool = False,
    linear: bool = False,
    pull: Pull | None = None,
) -> Energy:
    """The energy for a constraint on the deformation (§3.4).

    Args:
        model: the rest shape and its modes.
        deformation: the constraint, not `auto`.
        chosen: weights of priors by name; the others keep their defaults.
        paper: the energy as printed in the paper: s = 1, a floating window.
        linear: with bending, leave rows α and β at rest as the paper does, instead of letting the sheet draw in.
        pull: of `Deformations`, instead of the pull to rest and of smoothness; they were learned without.
    """
    weights = priors.weights(chosen or {}, deformation, perspective=model.camera.perspective, paper=paper)
    # A mode's eigenvalue says how much of the shape's extent it carries: weak modes are pulled to rest harder. By the
    # first ones, so that those are held alike however many there are.
    values = model.basis.eigenvalues
    stiffness = np.maximum(values, NEGLIGIBLE * values[0]) ** -0.5
    stiffness /= np.exp(np.log(stiffness[:USUAL_MODES]).mean())
    if pull is not None:
        weights = weights | {"rest": 0.0, "smoothness": 0.0}
    adaptive = deformation in ("general", "stretching") and not paper and weights["smoothness"] > 0
    draws_in = deformation == "bending" and not (paper or linear)
    edges = model.coarse_edges() if draws_in or weights["inextensibility"] else None
    return Energy(
        rotation=weights["rotation"],
        scale=weights["scale"],
        smoothness=weights["smoothness"] if paper else weights["smoothness"] * stiffness,
        jump=weights["smoothness"] * priors.STILL**2 if adaptive else None,
        adaptive=adaptive,
        rest=weights["rest"] * stiffness,
        inextensibility=weights["inextensibility"],
        rows=ROWS[deformation],
        free_scale=not paper,
        tied=not paper,
        edges=edges if weights["inextensibility"] else None,
        bending=Bending(edges, stiffness) if draws_in and edges else None,
        pull=pull,
        residuals=tuple((weights[n], p.residual) for n, p in priors.PRIORS.items() if p.residual and weights[n]),
    )


def build_guide(model: Model, deformation: Deformation, *, paper: bool = False) -> Energy | None:
    """The energy minimised before that of `build_energy`, so that it starts on the right branch; None where none is needed.

    An orthographic camera sees a bend and its mirror image alike, and either keeps the lengths, so that the minimum found
    is sometimes the wrong one. Bending of a flat sheet with rows α and β at rest, as in the paper, stays on its side.
    """
    if paper or model.camera.perspective or deformation not in ("bending", "inextensible") or not is_flat(model.basis.rest):
        return None
    return build_energy(model, "bending", FIRM, linear=True)
