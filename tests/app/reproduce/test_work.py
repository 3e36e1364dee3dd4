"""Trials: computed once, and failures in words."""

from pathlib import Path

from app.reproduce.experiments.organ import organ_tracks
from app.reproduce.lines import FLAG
from app.reproduce.work import Effort, Work


def test_a_trial_is_computed_once_and_fails_in_words(tmp_path: Path) -> None:
    with (tmp_path / FLAG.file).open("wb") as file:
        organ_tracks(6, 40).save(file)
    with Work(tmp_path, tmp_path, Effort(quick=True), 1.0) as work, work.experiment("trial", 1.0, 3):
        config = FLAG.config(tmp_path, modes=5, deformation="general")
        first = work.evaluated(config)
        assert first["e3d"] is not None
        assert work.evaluated(config) is first
        failed = work.evaluated(FLAG.config(tmp_path, modes=40))
    assert failed["e3d"] is None
    assert "modes 40" in failed.failure
