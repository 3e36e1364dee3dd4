"""Lists of numbers in any form, and guesses at what was meant."""

import pytest

from app.terminal.arguments import meant, numbers_in, spelled_out
from app.terminal.errors import UsageError

LIST = ["--roi", "195", "95", "325", "265"]


@pytest.mark.parametrize(
    "typed",
    [
        "--roi 195 95 325 265",
        "--roi 195,95,325,265",
        "--roi=195,95,325,265",
        "--roi 195, 95, 325, 265",
        "--roi (195;95;325;265)",
    ],
)
def test_numbers_in_any_form(typed: str) -> None:
    assert spelled_out(["run", *typed.split(), "a.mp4"]) == ["run", "a.mp4", *LIST]


@pytest.mark.parametrize("typed", ["--roi", "--roi 1", "--roi 1 2 3", "--roi 1 2 3 4 5", "--polygon 1 2 3 4"])
def test_too_few_or_too_many(typed: str) -> None:
    with pytest.raises(UsageError, match=f"{typed} has .* numbers: give X"):
        spelled_out(["run", "a.mp4", *typed.split()])


def test_a_polygon_may_have_many_corners() -> None:
    typed, meant_so = "--polygon 1,2 3,4 5,6 7,8 a.mp4", "a.mp4 --polygon 1 2 3 4 5 6 7 8"
    assert " ".join(spelled_out(typed.split())) == meant_so


def test_what_is_no_number() -> None:
    assert numbers_in("a,b") == numbers_in("") == numbers_in("1,b") == numbers_in("1:b") == []
    assert numbers_in("-1,+2.5") == ["-1", "+2.5"]


def test_what_was_meant() -> None:
    options = ["--roi", "--rest-shape", "--frames"]
    assert meant(["--rio", "1"], options) == "did you mean --roi?"
    assert meant(["--rest_shap=plane"], options) == "did you mean --rest-shape=plane?"
    assert meant(["runn"], options, ["run", "review"]) == "did you mean run?"
    assert meant(["1", "2", "3", "4"], options) == "did you mean --roi 1 2 3 4?"
    assert meant(["--nonsense"], options) == ""
