"""The basis of many points beside the exact one."""

import pytest

from app.bench import basis


def test_the_short_way_is_near_the_exact_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(basis, "COMPARED_POINTS", 700)
    for metric in basis.METRICS:
        assert basis.angle_degrees(metric, lambda _: None) < 5.0
