"""Numbers by frame."""

import pytest

from app.numbered import Numbered


def test_it_is_a_dictionary() -> None:
    known = Numbered()
    known[5], known[2], known[2] = 0.5, 7.0, 8.0
    assert list(known) == [2, 5]
    assert known[2] == 8.0
    assert [number in known for number in (0, 5, 9)] == [False, True, False]
    known.forget(5)
    known.forget(100)
    assert list(known) == [2]
    for unknown in (5, 100):
        with pytest.raises(KeyError):
            known[unknown]
