"""Fixtures of the rivals' tests."""

import pytest

from app.rivals.problems import WindowStep, full_model, window_step


@pytest.fixture(scope="package")
def step() -> WindowStep:
    return window_step(full_model(80), 6, "general")
