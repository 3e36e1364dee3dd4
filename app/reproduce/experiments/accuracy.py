"""Accuracy of given tracks in the settings that are reported throughout."""

from dataclasses import replace

from app.options.evaluate import Evaluate
from app.options.model import Model
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
CALIBRATED = ("flag250", "flag250_perspective", "face37", "waving_3", "waving_5", "waving_7", "waving_9")


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
    tables = [Table("Error against the true shapes", COLUMNS, rows), published]
    if not work.effort.quick:
        tables.append(calibration(work))
    return Result(tables, remarks=remarks, headlines=headlines)


def calibration(work: Work) -> Table:
    """True errors over standard deviations, nothing chosen."""
    rows = []
    for name in CALIBRATED:
        path = work.data / f"{name}.npz"
        if path.is_file():
            trial = work.evaluated(Evaluate(path, model=Model(uncertainty=True)))
            rows.append((name, percent(trial["e3d"]), trial["error_over_sigma"]))
    columns = ("data", "e3d %", "true error / standard deviation")
    return Table("Standard deviations of the vertices (`--uncertainty`): RMS of a frame, its median", columns, rows)


def steps(effort: Effort) -> int:
    """Two trials a line, and those of the standard deviations."""
    return 2 * len(LINES) + (0 if effort.quick else len(CALIBRATED))


EXPERIMENT = Experiment(
    "accuracy",
    "Accuracy on given tracks",
    accuracy,
    steps,
    0.7,
    files=(FLAG.file, FLAG_PERSPECTIVE.file, FACE.file),
    paper="§6",
)
