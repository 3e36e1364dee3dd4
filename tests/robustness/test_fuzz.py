"""Damaged inputs end in one line or in a result, never in a crash."""

import json
from pathlib import Path

import pytest

from tests.robustness.fuzz import ALL, fuzz, make_samples

FEW, MORE = range(2), range(2, 24)


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    make_samples(folder)
    return folder


@pytest.mark.parametrize("cases", [FEW, pytest.param(MORE, marks=pytest.mark.slow)], ids=["few", "more"])
def test_damaged_inputs(samples: Path, cases: range) -> None:
    wrong = fuzz(samples, ALL, cases)
    assert not wrong, json.dumps(wrong, indent=1)
