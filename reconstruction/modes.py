"""Mode shapes Υ and principal axes Φ of a rest shape (paper §3.2, Eq. 2-6)."""

from dataclasses import dataclass

from numpy.typing import NDArray
import numpy as np

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ModalBasis:
    """A rest shape and its modes, S = S̄ + ΦΛΥ (Eq. 3).

    Attributes:
        rest: (3, p) centred rest shape S̄, pixels of the first frame.
        Upsilon: (r, p) leading eigenvectors of −½CDC as rows (Eq. 4).
        eigenvalues: (r,) their eigenvalues, descending.
        Phi: (3, 3) rotation whose columns are the principal axes α, β, τ (Eq. 6).
    """

    rest: Array
    Upsilon: Array
    eigenvalues: Array
    Phi: Array
