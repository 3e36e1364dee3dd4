"""Observations in, shapes out: Mode-Shape Interpretation (Agudo et al., WACV 2016) in NumPy and SciPy."""


class ReconstructionError(ValueError):
    """Observations or settings no shape can be recovered from; the message says what is wrong and what is needed.

    Args:
        text: the message.
        about: the setting that it is about, which another value of may help; empty if there is none.
    """

    def __init__(self, text: str, about: str = "") -> None:
        super().__init__(text)
        self.about = about
