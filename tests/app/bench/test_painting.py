"""A picture that is painted to be timed."""

import numpy as np

from app.bench.painting import SIZE, paint_ms, textured


def test_something_is_painted() -> None:
    assert paint_ms(lambda _: None) > 0
    image = textured(np.random.default_rng(0))
    assert image.shape == (*SIZE[::-1], 3)
    assert image.std() > 20
