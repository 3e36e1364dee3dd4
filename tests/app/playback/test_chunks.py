"""Files that are cut off, damaged, or no recording."""

import contextlib
import gc
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from hypothesis import given, settings
from hypothesis import strategies as st

from app.playback.playback import Playback
from app.playback.reading.chunks import complete_bytes
from app.terminal.errors import UsageError
from tests.synthetic_run import write_run


@pytest.fixture(scope="module")
def long_recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Several flushes long."""
    return write_run(tmp_path_factory.mktemp("long") / "long.rrd", frames=250).path


def test_file_that_is_cut_off(tmp_path: Path, long_recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    whole = long_recording.read_bytes()
    path = tmp_path / "cut.rrd"
    with long_recording.open("rb") as file:
        between = complete_bytes(file, int(0.6 * len(whole)))
    path.write_bytes(whole[: between + 40])  # in the middle of a message
    before = path.read_bytes()
    playback, complete = Playback.load(path), Playback.load(long_recording)
    count = len(playback.frames)
    assert 50 < count < 250
    assert f"{count} frames, up to number {count - 1}, could be read" in playback.notes[0]
    assert np.array_equal(playback.frames, complete.frames[:count])
    assert np.array_equal(playback.W, complete.W[:count], equal_nan=True)
    both = playback.shaped
    assert both.sum() > 50
    assert np.array_equal(playback.shapes()[both], complete.shapes()[:count][both])
    assert path.read_bytes() == before
    del playback, complete
    gc.collect()
    assert not list((tmp_path / "temporary").iterdir()), "copies are left behind"


@settings(max_examples=12)
@given(share=st.floats(0.0, 0.999))
def test_cut_anywhere_it_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, long_recording: Path, share: float
) -> None:
    whole = long_recording.read_bytes()
    path = tmp_path_factory.mktemp("cut") / "cut.rrd"
    path.write_bytes(whole[: int(share * len(whole))])
    with contextlib.suppress(UsageError):  # any other exception fails
        playback = Playback.load(path)
        assert len(playback.frames) <= 250
        assert len(list(playback.images())) == len(playback.frames)


def foreign(path: Path) -> None:
    stream = rr.RecordingStream("somebody_elses")
    stream.save(path)
    stream.log("points", rr.Points3D([[1, 2, 3]]))
    stream.flush()
    stream.disconnect()


def scrambled(path: Path) -> None:
    data = bytearray(write_run(path.with_name("whole.rrd")).path.read_bytes())
    data[2000:-2000:7] = bytes(len(data[2000:-2000:7]))
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda _: None, "there is no recording"),
        (lambda path: path.mkdir(), "there is no recording"),
        (lambda path: path.touch(), "is not a recording"),
        (lambda path: path.write_text("dear diary"), "is not a recording"),
        (lambda path: path.write_bytes(b"\0\0\0\x18ftypmp42" + bytes(999)), "is not a recording"),
        (lambda path: path.write_bytes(b"RRF2" + bytes(3)), "contains no recording|is damaged"),
        (foreign, "recording of another application .somebody_elses."),
        (scrambled, "is damaged|contains no|cannot be read|cannot read|can read"),
    ],
    ids=["missing", "folder", "empty", "text", "mp4", "stub", "foreign", "scrambled"],
)
def test_what_is_no_recording(tmp_path: Path, make: object, words: str) -> None:
    path = tmp_path / "it.rrd"
    make(path)  # type: ignore[operator]
    with pytest.raises(UsageError, match=rf"it\.rrd.*({words})|({words}).*it\.rrd"):
        Playback.load(path)


def test_recording_of_an_older_format(tmp_path: Path) -> None:
    path = tmp_path / "old.rrd"
    stream = rr.RecordingStream("modeshape")
    stream.save(path)
    stream.set_time("frame", sequence=0)
    values = rr.DynamicArchetype("modeshape.Observation", components={"visible": [True, True], "phase": "tracking"})
    stream.log("observation", values)
    stream.log("world/camera/points/seen", rr.Points2D([[1, 2]]))
    stream.flush()
    stream.disconnect()
    with pytest.raises(UsageError, match=r"old\.rrd is not a recording that this version of modeshape can read"):
        Playback.load(path)
