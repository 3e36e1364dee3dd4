"""Damaged inputs end in one line or in a result, never in a crash."""

import json

import pytest

from tests.robustness.fuzz import CASES, fuzz


@pytest.mark.parametrize("count", [30, pytest.param(CASES, marks=pytest.mark.slow)])
def test_damaged_inputs(count: int) -> None:
    wrong = fuzz(count)
    assert not wrong, json.dumps(wrong, indent=1)
