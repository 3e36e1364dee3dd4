"""Fixtures of the benchmarks' tests."""

from collections.abc import Iterator

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="package", autouse=True)
def one_core() -> Iterator[None]:
    with threadpool_limits(1):
        yield
