"""Damaged inputs end in one line or in a result, never in a crash."""

import json

import pytest

from tests.robustness.fuzz import fuzz


@pytest.mark.parametrize("count", [8, pytest.param(60, marks=pytest.mark.slow)])
def test_damaged_inputs(count: int) -> None:
    wrong = fuzz(count)
    assert not wrong, json.dumps(wrong, indent=1)
