"""Where missing entries cost too much."""

import pytest

from app.reproduce.experiments.missing import breaking_point


@pytest.mark.parametrize(
    ("errors", "static", "expected"),
    [
        ([[2.0], [3.0], [3.9]], 6.0, "not up to 80%"),
        ([[2.0], [3.0], [4.1]], 6.0, "80%"),
        ([[2.0, 2.0], [2.9, 3.3], [3.0, 3.1]], 3.0, "40%"),
        ([[2.0, 2.0], [2.1, None], [3.0, 3.1]], 6.0, "40%"),
        ([[None], [2.0], [2.0]], 6.0, "0%"),
    ],
)
def test_a_line_breaks_where_it_is_of_no_more_use(errors: list[list[float | None]], static: float, expected: str) -> None:
    assert breaking_point((0.0, 0.4, 0.8), errors, static) == expected
