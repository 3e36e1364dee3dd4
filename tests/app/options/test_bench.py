"""Options of `modeshape bench`."""

from pathlib import Path

import pytest

from app.options.bench import Bench
from app.terminal.errors import UsageError


@pytest.mark.parametrize("name", ["bench.txt", "bench"])
def test_a_plot_that_is_no_picture_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="is no picture"):
        Bench(plot=Path(name))
