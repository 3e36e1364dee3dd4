"""Fixtures of the recordings' tests."""

from collections.abc import Iterator

import pytest
import rerun as rr

from tests.app.recording.rows import Rows, read
from tests.synthetic_run import Run, write_run


@pytest.fixture(autouse=True)
def strict() -> Iterator[None]:
    """Wrongly shaped data only warns otherwise."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


@pytest.fixture(scope="package")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return write_run(tmp_path_factory.mktemp("run") / "sheet.rrd")


@pytest.fixture(scope="package")
def rows(run: Run) -> Rows:
    return read(run.path)
