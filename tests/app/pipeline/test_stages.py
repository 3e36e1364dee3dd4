"""Stages in processes of their own: the same as in one, and when one is killed nothing is lost or left."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.options.model import Model
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.playback.playback import Playback
from app.processes.child import shared_file
from app.processes.ring import FEWEST, Ring
from app.terminal.errors import UsageError
from app.terminal.progress import Progress


def config(videos: Path) -> Run:
    return Run(
        source=str(videos / "turning.mp4"),
        points=120,
        model=Model(modes=6, bootstrap_frames=10),
        output=Output(out=Path("run.rrd"), tracks_out=Path("tracks.npz"), shapes_out=Path("shapes.npz")),
        jobs=2,
    )


class Killing(Progress):
    """Kills a stage after some frames."""

    def __init__(self, stage: str) -> None:
        super().__init__()
        self.stage, self.left = stage, 5 if stage == "maps" else 30  # when it is needed again

    def advance(self, phase: str, error_px: float | None = None) -> None:
        super().advance(phase, error_px)
        self.left -= 1
        if self.left == 0:
            process = {
                "tracking": lambda: session._tracking._remote,  # type: ignore[attr-defined]
                "maps": lambda: session._begin_map.__self__._remote,  # type: ignore[attr-defined]
                "recording": lambda: session._recording,
            }[self.stage]()
            process._process.kill()
            process._process.wait()


session: Session


@pytest.fixture(autouse=True)
def in_folder(here: Path) -> None:
    """Recordings go to a folder of their own."""


def test_in_one_process_shapes_are_the_same(videos: Path) -> None:
    known, pictures = [], []
    for jobs in (1, 2):
        written = Output(out=Path(f"run{jobs}.rrd"), shapes_out=Path(f"shapes{jobs}.npz"))
        Session(replace(config(videos), jobs=jobs, output=written), Progress()).run()
        with np.load(f"shapes{jobs}.npz") as shapes:
            known.append(shapes["S"])
        pictures.append([image for _, image in Playback.load(Path(f"run{jobs}.rrd")).images()])
        assert sum(image is not None for image in pictures[-1]) == len(known[-1])
    np.testing.assert_allclose(known[0], known[1], rtol=1e-9)
    for here, apart in zip(*pictures, strict=True):
        np.testing.assert_array_equal(here, apart)


@pytest.mark.parametrize(
    ("stage", "does"),
    [("tracking", "follows the points"), ("maps", "makes the models"), ("recording", "writes the recording")],
)
def test_a_killed_stage_ends_the_run_with_everything_kept(videos: Path, stage: str, does: str) -> None:
    global session
    session = Session(config(videos), Killing(stage))
    with pytest.raises(UsageError, match=f"the process that {does} has ended"):
        session.run()
    with np.load("tracks.npz") as tracks:
        assert len(tracks["W"]) >= (5 if stage == "maps" else 30)
    if stage != "maps":
        with np.load("shapes.npz") as shapes:
            assert len(shapes["S"]) >= 30
    if stage == "tracking":
        assert Playback.load(Path("run.rrd")).shaped.sum() >= 20
    allowed = {"run.rrd", "tracks.npz", "shapes.npz"}
    assert {path.name for path in Path().iterdir()} <= allowed


def ring(write: Callable[[Ring], None]) -> Ring:
    file = shared_file()
    try:
        writer, reader = Ring(file, (2000, 2000)), Ring(file, (2000, 2000))
    finally:
        os.close(file)
    write(writer)
    return reader


def test_pictures_are_where_their_numbers_say() -> None:
    def write(writer: Ring) -> None:
        for number in range(FEWEST):
            writer.write(number, np.full((2000, 2000, 3), number, np.uint8))

    reader = ring(write)
    assert [int(reader.picture(number)[7, 7, 1]) for number in range(FEWEST)] == list(range(FEWEST))


def test_a_picture_that_was_released_makes_room_for_another() -> None:
    def write(writer: Ring) -> None:
        for number in range(3 * FEWEST):
            writer.write(number, np.full((2000, 2000, 3), number, np.uint8))
            writer.release(number)

    assert int(ring(write).picture(3 * FEWEST - 1)[0, 0, 0]) == 3 * FEWEST - 1
