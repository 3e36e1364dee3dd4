"""All experiments are offered."""

from app.options.reproduce import NAMES
from app.reproduce.catalog import CATALOG
from app.reproduce.work import Effort


def test_every_experiment_can_be_asked_for() -> None:
    assert tuple(experiment.name for experiment in CATALOG) == NAMES
    for experiment in CATALOG:
        assert experiment.expected_s(Effort(quick=True)) <= experiment.expected_s(Effort())
