"""Damaged inputs end in one line or in a result, never in a crash."""

import json

import pytest

from tests.robustness.fuzz import KINDS, fuzz

FEW, MORE = range(5), range(5, 25)


@pytest.mark.parametrize("cases", [FEW, pytest.param(MORE, marks=pytest.mark.slow)], ids=["few", "more"])
@pytest.mark.parametrize("kind", [*KINDS, "command"])
def test_damaged_inputs(kind: str, cases: range) -> None:
    wrong = fuzz(kind, cases)
    assert not wrong, json.dumps(wrong, indent=1)
