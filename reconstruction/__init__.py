"""Observations in, shapes out: Mode-Shape Interpretation (Agudo et al., WACV 2016) in NumPy and SciPy."""


class ReconstructionError(ValueError):
    """Observations or settings no shape can be recovered from; the message names what is missing and the remedy."""
