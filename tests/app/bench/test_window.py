"""The race of solvers."""

import pytest

from app.bench import window
from app.rivals.problems import full_model, window_step
from app.terminal.errors import UsageError


def test_a_race_has_everybody_at_the_same_end() -> None:
    race = window.race(window_step(full_model(80), 6, "general"), "general")
    assert race.scipy_ms > 0
    assert race.ours_ms > 0
    with pytest.raises(UsageError, match="does not reach"):
        window.loosest(lambda _: 2.0, 1.0)
    assert window.loosest(lambda tolerance: 1.0 + tolerance / 100, 1.0) == pytest.approx(1e-4)
