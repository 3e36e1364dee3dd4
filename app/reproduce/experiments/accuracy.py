"""Accuracy of given tracks in the settings that are reported throughout."""

from dataclasses import replace

from app.reproduce.experiment import Experiment
from app.reproduce.lines import FACE, FLAG, FLAG_PERSPECTIVE, FLAG_RIGID
from app.reproduce.published import PAPER, PAPER_BATCH_E3D, PAPER_E3D, PAPER_MISSING, PAPER_MODES, PAPER_SEQUENTIAL_E3D
from app.reproduce.result import Headline, Result, Table, percent
from app.reproduce.work import Effort, Work

LINES = (
    FLAG,
    replace(FLAG, missing=PAPER_MISSING),
    replace(FLAG, missing=0.8),
    FLAG_RIGID,
    FLAG_PERSPECTIVE,
    replace(FLAG_PERSPECTIVE, missing=0.4),
    FACE,
    replace(FACE, missing=0.4),
)
COLUMNS = (
    "data",
    "missing %",
    "deformation",
    "modes",
    "e3d %",
    "camera",
    "sign free",
    "rest shape alone",
    "with auto",
    "ms/frame",
)


def accuracy(work: Work) -> Result:
    """Every line as it is, and with the deformation left to the program."""
    rows, headlines, remarks = [], [], []
    for line in LINES:
        trial = work.evaluated(line.config(work.data))
        left_to_us = work.evaluated(line.config(work.data, deformation="auto"))
        e3d, static, auto = (percent(v) for v in (trial["e3d"], trial["e3d_static"], left_to_us["e3d"]))
        rows.append(
            (
                line.name,
                round(100 * line.missing),
                line.deformation,
                line.modes,
                e3d,
                percent(trial["e3d_camera"]),
                percent(trial["e3d_sign_free"]),
                static,
                auto,
                trial["ms_per_frame"],
            )
        )
        missing = f", {line.missing:.0%} missing" if line.missing else ""
        others = f"paper, on its own flag: {PAPER_E3D}" if (line.file, line.missing) == (FLAG.file, PAPER_MISSING) else ""
        headlines.append(Headline(line.name + missing, line.setting, e3d, static, others))
        if trial.failure:
            remarks.append(f"{line.name}{missing}: {trial.failure}.")
    low, high = PAPER_BATCH_E3D
    published = Table(
        f"Published: {PAPER}; {PAPER_MISSING:.0%} missing, r = {PAPER_MODES}",
        ("method", "e3d %"),
        [("BA-MSI-ED", PAPER_E3D), ("sequential competitor", PAPER_SEQUENTIAL_E3D), ("batch methods", f"{low}–{high}")],
    )
    return Result([Table("Error against the true shapes", COLUMNS, rows), published], remarks=remarks, headlines=headlines)


def steps(_effort: Effort) -> int:
    """Two trials a line."""
    return 2 * len(LINES)


EXPERIMENT = Experiment(
    "accuracy",
    "Accuracy on given tracks",
    accuracy,
    steps,
    0.7,
    files=(FLAG.file, FLAG_PERSPECTIVE.file, FACE.file),
    paper="§6",
)
