"""All experiments, in the order of the report."""

from app.reproduce.experiment import Experiment
from app.reproduce.experiments import (
    accuracy,
    basis_time,
    footage,
    metrics,
    missing,
    mode_counts,
    mode_shapes,
    organ_run,
    peers,
)
from app.reproduce.experiments.robustness import hard_cases, holds_under

CATALOG: tuple[Experiment, ...] = (
    accuracy.EXPERIMENT,
    peers.EXPERIMENT,
    mode_counts.EXPERIMENT,
    metrics.EXPERIMENT,
    missing.EXPERIMENT,
    basis_time.EXPERIMENT,
    mode_shapes.EXPERIMENT,
    organ_run.EXPERIMENT,
    footage.SAMPLE,
    footage.PAPER,
    footage.TALKING_FACE,
    hard_cases.EXPERIMENT,
    holds_under.EXPERIMENT,
)
