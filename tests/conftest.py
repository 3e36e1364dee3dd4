"""Fixtures every test may use."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

from app.environment import environment

os.environ.update(environment())

# A busy machine is no reason to fail, and a red run must be red again when it is repeated.
settings.register_profile("modeshape", deadline=None, derandomize=True, max_examples=40, database=None)
settings.load_profile("modeshape")


def pytest_configure(config: pytest.Config) -> None:
    """What Rerun only warns of is a mistake; said here, since settings read earlier would load Rerun before `app` does."""
    config.addinivalue_line("filterwarnings", "error::rerun.error_utils.RerunWarning")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real sequences with ground truth that lies beside the checkout."""
    folder = Path(__file__).parents[1].parent / "shared" / "data"
    if not folder.is_dir():
        reason = f"no research data at {folder}"
        pytest.fail(reason) if os.environ.get("CI") == "true" else pytest.skip(reason)
    return folder
