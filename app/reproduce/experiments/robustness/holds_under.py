"""Degraded copies of the sample, and of the printed sheet where it is there: what bad cameras and bad days cost."""

import shutil

from app.demo import sample
from app.footage.case import Case, write
from app.footage.catalog import CASES
from app.footage.clip import Clip
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.reproduce.experiment import Experiment
from app.reproduce.experiments.footage import PAPER_FRAMES, PAPER_TRUTH, PAPER_VIDEO
from app.reproduce.part import Part
from app.reproduce.result import Result, Table, percent
from app.reproduce.work import Effort, Trial, Work
from app.terminal.errors import in_a_line
from reconstruction import ReconstructionError
from tracking import TrackingError

SAMPLE_FRAMES = 150
PAPER_ROI = (195, 95, 325, 265)
QUICK = ("as it is", "light in rolling bands", "a title card first")
COLUMNS = ("footage", "wanted", "sample", "kinect_paper", "times lost", "verdicts")


def clips(work: Work) -> list[Clip | None]:
    """The sample, and the printed sheet or None."""
    made, paper = sample(), work.data / PAPER_VIDEO
    sheet = Clip(paper, work.data / PAPER_TRUTH, PAPER_ROI, PAPER_FRAMES) if paper.is_file() else None
    return [Clip(made.video, made.truth, made.roi, SAMPLE_FRAMES), None if work.effort.quick else sheet]


def holds_under(work: Work) -> Result:
    """Every case of every clip."""
    every = clips(work)
    rows = []
    for case in chosen(work.effort):
        trials = [None if clip is None else run(work, clip, case) for clip in every]
        known = [trial for trial in trials if trial is not None]
        wanted = "told to be poor" if case.wanted is None else case.wanted
        errors = [None if trial is None else percent(trial["e3d"]) for trial in trials]
        verdicts = ", ".join(trial.failure or str(trial.words["verdict"]) for trial in known)
        lost = sum(int(trial["losses"] or 0) for trial in known)
        rows.append((case.name, wanted, *errors, lost, verdicts))
    explained = (
        "What is wanted was written down before. A thing that crosses hides a third of the surface at a time, a watermark "
        "a third all the time; what nobody sees is a guess."
    )
    return Result([Table("Degraded footage: e3d in %", COLUMNS, rows)], remarks=[explained])


def run(work: Work, clip: Clip, case: Case) -> Trial:
    """A copy of a clip, reconstructed."""
    folder = work.scratch / "holds-under"
    folder.mkdir()
    try:
        copy = write(clip, case, folder)
        output = Output(out=folder / "run.rrd", image="none")
        config = Run(copy.source, roi=copy.roi, ground_truth=copy.truth, output=output)
        return Trial(Session(config, Part()).run().as_dict())
    except (ReconstructionError, TrackingError) as error:
        return Trial({}, in_a_line(error))
    finally:
        shutil.rmtree(folder)
        work.step()


def chosen(effort: Effort) -> list[Case]:
    """The cases."""
    return [case for name, case in CASES.items() if not effort.quick or name in QUICK]


def steps(effort: Effort) -> int:
    """Runs."""
    return len(chosen(effort)) * (1 if effort.quick else 2)


EXPERIMENT = Experiment("holds-under", "Degraded footage", holds_under, steps, 12.0)
