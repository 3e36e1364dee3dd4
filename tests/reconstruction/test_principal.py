"""What points do together is told from noise, however much is missing."""

import numpy as np
import pytest

from reconstruction.arrays import Array, Mask
from reconstruction.principal import principal

K, P, WAYS = 40, 120, 3


def tracks(common: float, noise: float, missing: float) -> tuple[Array, Array, Mask]:
    """How much points take part in three ways (3, p), all that is seen of them, and where it is."""
    rng = np.random.default_rng(1)
    parts = rng.normal(size=(WAYS, P))
    ways = np.linalg.qr(rng.normal(size=(2 * K, WAYS)))[0]
    seen = common * (ways @ parts).reshape(K, 2, P) + noise * rng.normal(size=(K, 2, P))
    visible = rng.random((K, P)) >= missing
    return common * parts, np.where(visible[:, None], seen, np.nan), visible


@pytest.mark.parametrize("missing", [0.0, 0.4, 0.7])
def test_parts_are_found_up_to_a_rotation(missing: float) -> None:
    parts, seen, visible = tracks(1.0, 0.01, missing)
    places, share = principal(seen, visible, WAYS)
    np.testing.assert_allclose(places.T @ places, parts.T @ parts, atol=0.2 * np.abs(parts.T @ parts).max())
    assert share > 0.95


@pytest.mark.parametrize("missing", [0.0, 0.4])
def test_noise_is_nothing_that_points_do_together(missing: float) -> None:
    _, seen, visible = tracks(0.0, 1.0, missing)
    assert principal(seen, visible, WAYS)[1] < 0.2


def test_units_do_not_matter() -> None:
    _, seen, visible = tracks(1.0, 0.1, 0.3)
    (places, share), (small, same) = (principal(unit * seen, visible, WAYS) for unit in (1.0, 1e-6))
    np.testing.assert_allclose(small.T @ small, 1e-12 * (places.T @ places), rtol=1e-6, atol=1e-18)
    assert same == pytest.approx(share)


def test_still_points_do_nothing() -> None:
    places, share = principal(np.zeros((K, 2, P)), np.ones((K, P), bool), WAYS)
    assert share == 0.0
    assert not places.any()
