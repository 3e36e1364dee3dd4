"""Lines of the report as commands."""

from pathlib import Path

from app.reproduce.lines import FACE, FLAG


def test_lines_are_commands() -> None:
    config = FACE.config(Path("data"), modes=5, noise=0.01, seed=2, metric="manhattan")
    assert config.tracks == Path("data/face37.npz")
    assert (config.model.modes, config.model.metric, config.model.deformation) == (5, "manhattan", "general")
    assert (config.noise, config.seed, config.missing) == (0.01, 2, 0.0)
    assert FLAG.config(Path("data")) == FLAG.config(Path("data"), missing=0.0)
