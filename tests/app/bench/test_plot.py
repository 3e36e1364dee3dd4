"""The figure of times."""

from pathlib import Path

from app.bench import basis, window


def test_the_figure_is_drawn(tmp_path: Path) -> None:
    from app.bench.plot import draw

    timings = [window.Timing(p, 30, "general", 0.1, 0.1, 1.0, 3, 4.0) for p in (250, 828)]
    times = [basis.BasisTime(p, metric, 0.1, 0.1, 100.0, 1.0, None) for p in (56, 594) for metric in basis.METRICS]
    with (tmp_path / "bench.png").open("wb") as file:
        draw(file, "png", timings, [window.Race(828, 30, "general", 4.0, 400.0, None)], times)
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")
