"""The silent progress of a part."""

import pytest

from app.reproduce.part import Part


def test_a_part_is_silent_and_counts(capfd: pytest.CaptureFixture[str]) -> None:
    advanced = []
    with Part(lambda: advanced.append(1)) as part:
        part.expect(3)
        part.log("hello")
        part.at(1, 3)
        part.advance("tracking")
    assert advanced == [1]
    assert capfd.readouterr() == ("", "")
