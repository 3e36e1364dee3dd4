"""Least times and their growth."""

import pytest

from app.bench.timing import growth, least_s


def test_times_grow_as_they_do() -> None:
    assert growth([10, 100], [1.0, 10.0]) == pytest.approx(1.0)
    calls: list[str] = []
    least = least_s(lambda: calls.append("a"), lambda: calls.append("b"), budget_s=0.0)
    assert calls == ["a", "b"] * 2
    assert len(least) == 2
