"""What is known of how a surface deforms (paper §3.4): rows of Λ that stay zero, and how hard the others are held."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from reconstruction import priors
from reconstruction.camera import Camera
from reconstruction.energy import Energy
from reconstruction.model import Model
from reconstruction.rest_shape import RestShape

Deformation = Literal["auto", "bending", "stretching", "general", "inextensible"]
ROWS: dict[str, tuple[int, ...]] = {
    "bending": (2,),
    "stretching": (0, 1),
    "general": (0, 1, 2),
    "inextensible": (0, 1, 2),
}


def chosen(deformation: Deformation, rest: RestShape, camera: Camera) -> Deformation:
    """The constraint itself for `auto`: a solid may do anything, a sheet keeps its lengths.

    An orthographic camera sees a bend and its mirror image alike: there lengths would be kept by either, and now and then
    the wrong one is taken for good; bending alone stays on its side.
    """
    if deformation != "auto":
        return deformation
    if not rest.flat:
        return "general"
    return "inextensible" if camera.perspective else "bending"


def build_energy(
    model: Model, deformation: Deformation, chosen: Mapping[str, float] | None = None, *, paper: bool = False
) -> Energy:
    """The energy of a constraint on the deformation (paper §5, §3.4); `paper` as printed there: s = 1, a floating window.

    `chosen` are weights of priors by name; the others keep their defaults.
    """
    weights = priors.weights(chosen or {}, deformation, perspective=model.camera.perspective, paper=paper)
    # A mode's eigenvalue says how much of the shape's extent it carries: weak modes are pulled to rest harder.
    stiffness = model.basis.eigenvalues**-0.5
    stiffness /= np.exp(np.log(stiffness).mean())
    return Energy(
        rotation=weights["rotation"],
        translation=weights["translation"],
        scale=weights["scale"],
        smoothness=weights["smoothness"],
        rest=weights["rest"] * stiffness,
        inextensibility=weights["inextensibility"],
        rows=ROWS[deformation],
        free_scale=not paper,
        tied=not paper,
        edges=model.coarse_edges() if weights["inextensibility"] else None,
    )
