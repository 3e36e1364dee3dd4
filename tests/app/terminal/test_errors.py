"""The option that an error is about, and the one that helps, are named once, here."""

import pytest

from app.terminal.errors import UsageError, in_a_line
from reconstruction import ReconstructionError
from reconstruction.settings import Settings
from tracking import TrackingError


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (UsageError("--out x is a folder"), "--out x is a folder"),
        (ReconstructionError("modes 40 does not fit 37 points: choose fewer", "modes"),
         "--modes 40 does not fit 37 points: choose fewer"),
        (ReconstructionError("cannot recover a rest shape: too few", "rest_shape"),
         "cannot recover a rest shape: too few; give --rest-shape solid: what turns later is found later; "
         "or --rest-shape plane or mesh.obj"),
        (ReconstructionError("energy paper needs an orthographic camera", "energy"),
         "--energy paper needs an orthographic camera; use --camera orthographic"),
        (TrackingError("a.mp4 is no camera", "drop_late"), "a.mp4 is no camera; leave --drop-late out"),
        (TrackingError("no file a.npz; check the path"), "no file a.npz; check the path"),
    ],
)  # fmt: skip
def test_a_line_names_the_option(error: Exception, line: str) -> None:
    assert in_a_line(error) == line


@pytest.mark.parametrize(
    ("field", "value"), [("modes", 0), ("window", 0), ("bootstrap_frames", 1), ("priors", {"rust": 1.0})]
)
def test_settings_say_which_field_cannot_be_used(field: str, value: object) -> None:
    with pytest.raises(ReconstructionError) as error:
        Settings(**{field: value})
    assert error.value.about == field
    assert "--" not in str(error.value)
