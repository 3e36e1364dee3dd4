"""Options of `modeshape run`."""

import json
from pathlib import Path

import pytest

from app.options.model import Model
from app.options.run import Output, Run, configuration, parse_range
from app.terminal.errors import UsageError


@pytest.mark.parametrize(
    ("text", "frames"), [(":", (0, None)), ("5:", (5, None)), (":9", (0, 9)), ("3:4", (3, 4)), ("0:1", (0, 1))]
)
def test_a_range_of_frames(text: str, frames: tuple[int, int | None]) -> None:
    assert parse_range(text) == Run("a.mp4", frames=text).frame_range == frames


@pytest.mark.parametrize("text", ["", "7", "a:b", "4:4", "5:2", "-1:3", "1:2:3"])
def test_what_is_no_range(text: str) -> None:
    with pytest.raises(UsageError, match=r"--frames .*is no range: give A:B"):
        parse_range(text)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"points": 3}, "--points 3 is too few"),
        ({"duration": 0.0}, "--duration 0.0 is no time"),
        ({"place": (5, 5, 0, 9)}, "--place 5 5 0 9 has no area"),
        ({"opacity": 1.5}, "--opacity 1.5 is no opacity"),
    ],
)
def test_values_that_cannot_be_used(options: dict[str, object], what: str) -> None:
    with pytest.raises(UsageError, match=what):
        Run("a.mp4", **options)  # type: ignore[arg-type]


def test_a_video_cannot_be_split() -> None:
    with pytest.raises(UsageError, match="--split-minutes does not go with --image video"):
        Output(split_minutes=1.0, image="video")


def test_the_stored_configuration_has_no_groups_and_is_json() -> None:
    model = Model(modes=7, priors={"rest": 0.5})
    stored = configuration(Run("a.mp4", roi=(1, 2, 3, 4), rest_shape="plane", model=model, output=Output(Path("b.rrd"))))
    assert json.loads(json.dumps(stored)) == stored
    assert (stored["source"], stored["roi"], stored["out"]) == ("a.mp4", [1, 2, 3, 4], "b.rrd")
    assert (stored["modes"], stored["priors"], stored["rest_shape"], stored["json"]) == (7, "rest=0.5", "plane", False)
    assert not {"model", "output"} & stored.keys()
