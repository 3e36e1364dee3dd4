"""What is known of a solid's deformations: a Gaussian of Λ' about its rest shape."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array
from reconstruction.state import State
from reconstruction.window.energy import Pull
from reconstruction.window.normal import inverted


@dataclass(frozen=True)
class Deformations:
    """A Gaussian of Λ' about the rest shape.

    Attributes:
        covariance: (3r, 3r) of Λ', row after row.
        noise: standard deviation of a coordinate of an image point, over the shape's size.
    """

    covariance: Array
    noise: float

    def pull(self, points: int) -> Pull:
        """What it adds to the energy of a frame of so many points."""
        variance = self.noise**2 / points
        return Pull(variance * inverted(self.covariance), variance)

    def mirrored(self) -> "Deformations":
        """The same of the mirror image, whose row τ has the other sign."""
        sign = np.repeat([1.0, 1.0, -1.0], len(self.covariance) // 3)
        return replace(self, covariance=sign[:, None] * self.covariance * sign)


@dataclass(frozen=True)
class Learned:
    """What keyframes tell of a solid that deforms.

    Attributes:
        B: (4 + r, p) the model's basis, its rest shape S̄' another one.
        state: pose and Λ' of the keyframes (n = K), their mean 0.
        deformations: the Gaussian.
        taken: how many parameters the image of a keyframe holds, on average.
    """

    B: Array
    state: State
    deformations: Deformations
    taken: float = 0.0
