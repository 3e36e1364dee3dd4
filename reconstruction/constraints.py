"""What is known of how a surface deforms (paper §3.4): rows of Λ that stay zero, and how hard the others are held."""

from dataclasses import replace
from typing import Literal

import numpy as np

from reconstruction.camera import Camera
from reconstruction.energy import Energy
from reconstruction.model import Model
from reconstruction.rest_shape import RestShape
from reconstruction.rigid import ORTHOGRAPHIC_SCALE, PERSPECTIVE_SCALE

Deformation = Literal["auto", "bending", "stretching", "general", "inextensible"]
ROWS: dict[str, tuple[int, ...]] = {
    "bending": (2,),
    "stretching": (0, 1),
    "general": (0, 1, 2),
    "inextensible": (0, 1, 2),
}
# λ_0 and λ_γ: the more a constraint says, the less is left for the pull to rest and to the frame before.
PULLS: dict[str, tuple[float, float]] = {
    "bending": (1e-2, 1e-3),
    "stretching": (2e-2, 3e-2),
    "general": (2e-2, 3e-2),
    "inextensible": (1e-3, 1e-3),
}
INEXTENSIBILITY = 3.0  # κ


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


def build_energy(model: Model, deformation: Deformation, *, paper: bool = False) -> Energy:
    """The energy of a constraint on the deformation (paper §5, §3.4); `paper` as printed there."""
    rows = ROWS[deformation]
    if paper:
        return Energy(rows=rows, rest=0.0, deformation=1e-3, free_scale=False, tied=False)
    scale = PERSPECTIVE_SCALE if model.camera.perspective else ORTHOGRAPHIC_SCALE
    # A mode's eigenvalue says how much of the shape's extent it carries: weak modes are pulled to rest harder.
    stiffness = model.basis.eigenvalues**-0.5
    stiffness /= np.exp(np.log(stiffness).mean())
    rest, smooth = PULLS[deformation]
    energy = Energy(scale=scale, deformation=smooth, rest=rest * stiffness, rows=rows)
    if deformation == "inextensible":
        return replace(energy, inextensibility=INEXTENSIBILITY, edges=model.coarse_edges())
    return energy
