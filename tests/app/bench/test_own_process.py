"""Work in a process of its own."""

from app.bench.own_process import apart


def test_memory_is_that_of_a_process_of_its_own() -> None:
    size, peak_mb = apart(sum, [1, 2])
    assert size == 3
    assert 5 < peak_mb < 1000
