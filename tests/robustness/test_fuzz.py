"""Damaged inputs end in one line or in a result, never in a crash."""

import json

import pytest

from tests.robustness.fuzz import fuzz


@pytest.mark.parametrize("cases", [range(8), pytest.param(range(8, 40), marks=pytest.mark.slow)], ids=["few", "more"])
def test_damaged_inputs(cases: range) -> None:
    wrong = fuzz(cases)
    assert not wrong, json.dumps(wrong, indent=1)
