"""The priors of the energy by name: formula, weight, and when to use them (paper §5, §3.4).

Each is a sum of squares of dimensionless quantities (lengths in units of the rest shape's size), added for every frame to
the mean squared reprojection error; any weights go together. The terms themselves are in `energy`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from reconstruction.arrays import Array
from reconstruction.settings import PriorName
from reconstruction.state import State

Weights = dict[str, float]
Residual = Callable[[State, tuple[int, ...]], tuple[Array, Array]]

ORTHOGRAPHIC_SCALE = 1.0  # λ_s without depth, where only a zoom changes the scale
PERSPECTIVE_SCALE = 1e-3  # λ_s with depth, where moving towards the camera does
SWELLING_SCALE = 1e-2  # λ_s with depth where the object may swell, too, which looks alike
OTHERWISE = "otherwise"
FITTING = 1e-2  # misfit, of the shape's size, above which a model that may do anything is pulled to rest harder, ...
FIRMEST = 3.0  # ... up to so many times
STILL = 3e-3  # σ: change between frames, of the shape's size, up to which a surface holds still


@dataclass(frozen=True)
class Prior:
    """One term of the energy that does not come from the images.

    Attributes:
        formula: the term; Δ is the change since the frame before.
        use: what it is for, and when to change its weight.
        default: weight by deformation and camera (perspective, orthographic), or by one of them, or otherwise.
        residual: of a state of n frames and the estimated rows of Λ': residuals (n, k) and their derivatives (n, k, d) by
            the POSE parameters and those rows; the term is the sum of their squares. None: the term is in `terms` or
            `smoothness`, since it couples frames, or is made for speed.
    """

    formula: str
    use: str
    default: Mapping[str, float]
    residual: Residual | None = None

    def weight(self, deformation: str, camera: str) -> float:
        """The weight unless somebody chooses another."""
        cases = (f"{deformation} {camera}", deformation, camera, OTHERWISE)
        return next(self.default[case] for case in cases if case in self.default)


PRIORS: dict[PriorName, Prior] = {
    "rest": Prior(
        "λ_0 Σ_k ω_k ‖Λ'_k − Λ̄'_k‖², ω_k ∝ eigenvalue_k^(−½); where a surface may do anything, times the mean squared "
        "misfit so far over (1 %)², between 1 and 3",
        "Pulls to the rest shape, weak modes harder, and harder where noise or too few modes leave much over. Without it, "
        "modes 1 and 2 do what tilt and scale should. More where points are few or noisy, less where the surface deforms "
        "far.",
        {"bending": 5e-3, "inextensible": 3e-4, OTHERWISE: 8e-3},
    ),
    "smoothness": Prior(
        "λ_γ Σ_k ω_k ‖ΔΛ'_k‖²; where a surface may do anything, λ_γ σ² log(1 + Σ_k ω_k ‖ΔΛ'_k‖²/σ²), σ = 0.3 %",
        "The deformation changes slowly. More for noisy or missing points and high frame rates, less for fast motion.",
        {"bending": 1e-3, "inextensible": 1e-4, OTHERWISE: 5.0},
    ),
    "rotation": Prior(
        "λ_q ‖Δq‖²",
        "The object turns slowly (q is the unit quaternion). More where the pose jitters.",
        {"general": 1e-4, OTHERWISE: 3e-4},
    ),
    "scale": Prior(
        "λ_s (Δ log s)²",
        "The object stays as far away. Less for an orthographic camera that zooms, more for a perspective one before which "
        "the object only turns. Of no effect with the paper's energy, where s = 1.",
        {"general perspective": SWELLING_SCALE, "orthographic": ORTHOGRAPHIC_SCALE, "perspective": PERSPECTIVE_SCALE},
    ),
    "inextensibility": Prior(
        "κ mean_e ρ_e², ρ_e = (‖d_e‖² − l_e²) / (2 l_e)",
        "The edges d_e of a coarse mesh keep their lengths l_e: paper, cloth. Less for what stretches somewhat, or for a "
        "rest shape that is only roughly known; none for skin and rubber.",
        {"inextensible": 1.0, OTHERWISE: 0.0},
    ),
}
# The energy of the paper as printed: nothing pulls to rest.
PAPER: Weights = {"rest": 0.0, "smoothness": 1e-3, "inextensibility": 0.0}


def weights(chosen: Mapping[str, float], deformation: str, *, perspective: bool, paper: bool) -> Weights:
    """All weights by name: those chosen, and for the others the defaults, or the paper's."""
    camera = "perspective" if perspective else "orthographic"
    defaults: Weights = {name: prior.weight(deformation, camera) for name, prior in PRIORS.items()}
    return defaults | (PAPER if paper else {}) | dict(chosen)


def table() -> str:
    """All priors as a table in Markdown."""
    rows = ["| prior | formula | weight unless given | when to use |", "|---|---|---|---|"]
    for name, prior in PRIORS.items():
        cases = ", ".join(f"{case} {weight:g}" for case, weight in prior.default.items())
        default = cases if len(prior.default) > 1 else f"{prior.default.get(OTHERWISE):g}"
        rows.append(f"| `{name}` | {prior.formula} | {default} | {prior.use} |")
    return "\n".join(rows)
