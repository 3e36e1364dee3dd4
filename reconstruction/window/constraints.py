"""What is known of how a surface deforms (paper §3.4): rows of Λ that stay zero, and how hard the others are held."""

from collections.abc import Mapping

import numpy as np

from reconstruction.mapping.rest_shape import RestShape
from reconstruction.settings import Deformation
from reconstruction.window import priors
from reconstruction.window.edges import Bending
from reconstruction.window.energy import Energy
from reconstruction.window.model import Model

ROWS: dict[str, tuple[int, ...]] = {
    "bending": (2,),
    "stretching": (0, 1),
    "general": (0, 1, 2),
    "inextensible": (0, 1, 2),
}

FIRM = {"rest": 1e-2}  # of the first guide: with less it now and then changes its side


def chosen(deformation: Deformation, rest: RestShape) -> Deformation:
    """The constraint itself for `auto`: a solid may do anything, a sheet keeps its lengths."""
    if deformation != "auto":
        return deformation
    return "inextensible" if rest.flat else "general"


def build_energy(
    model: Model,
    deformation: Deformation,
    chosen: Mapping[str, float] | None = None,
    *,
    paper: bool = False,
    linear: bool = False,
) -> Energy:
    """The energy of a constraint on the deformation (paper §5, §3.4); `paper` as printed there: s = 1, a floating window.

    `chosen` are weights of priors by name; the others keep their defaults. With `linear`, bending leaves rows α and β at
    rest as the paper does, instead of drawing in.
    """
    weights = priors.weights(chosen or {}, deformation, perspective=model.camera.perspective, paper=paper)
    # A mode's eigenvalue says how much of the shape's extent it carries: weak modes are pulled to rest harder.
    stiffness = model.basis.eigenvalues**-0.5
    stiffness /= np.exp(np.log(stiffness).mean())
    lets_go = deformation in ("general", "stretching") and not paper and weights["smoothness"] > 0
    draws_in = deformation == "bending" and not (paper or linear)
    edges = model.coarse_edges() if draws_in or weights["inextensibility"] else None
    return Energy(
        rotation=weights["rotation"],
        translation=weights["translation"],
        scale=weights["scale"],
        smoothness=weights["smoothness"] if paper else weights["smoothness"] * stiffness,
        jump=weights["smoothness"] * priors.STILL**2 if lets_go else np.inf,
        rest=weights["rest"] * stiffness,
        inextensibility=weights["inextensibility"],
        rows=ROWS[deformation],
        free_scale=not paper,
        tied=not paper,
        edges=edges if weights["inextensibility"] else None,
        bending=Bending(edges, stiffness) if draws_in and edges else None,
    )


def build_guides(model: Model, deformation: Deformation, *, paper: bool = False) -> tuple[Energy, ...]:
    """What leads, one after the other, to where an energy of kept lengths is to start from, if it needs that.

    An orthographic camera sees a bend and its mirror image alike and lengths are kept by either, so now and then the wrong
    one would be taken for good. Bending with rows α and β at rest, as the paper has it, stays on its side. From there it is
    let draw in as it bends, before its rows α and β are free to do what only edges hold back.
    """
    if paper or model.camera.perspective or deformation not in ("bending", "inextensible"):
        return ()
    linear = build_energy(model, "bending", FIRM, linear=True)
    return (linear,) if deformation == "bending" else (linear, build_energy(model, "bending"))
