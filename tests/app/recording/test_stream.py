"""The file of a recording: complete, or not there, and errors in words."""

import subprocess
import sys
from pathlib import Path

import pytest

from app.recording.recording import entities
from app.recording.stream import Stream
from app.terminal.errors import UsageError
from tests.app.recording.rows import frame, read, record
from tests.synthetic_run import STAGE_MS, Run, picture, verify


def test_a_file_is_not_replaced_silently(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "kept.rrd"
    path.write_bytes(run.path.read_bytes())
    with pytest.raises(UsageError, match=r"kept\.rrd exists: .*--overwrite"):
        record(path)
    assert path.read_bytes() == run.path.read_bytes()
    with record(path, overwrite=True) as recording:
        recording.observe(*frame(), phase="tracking")
    verify(path)
    assert path.stat().st_size < run.path.stat().st_size


def fail(path: Path, error: type[BaseException], run: Run | None = None) -> None:
    """A run that ends in an error after its first frame, whose shape is known if it is that of `run`."""
    with record(path) as recording:
        recording.observe(*frame(), phase="tracking")
        if run:
            recording.rest(run.basis, run.mesh, run.camera, picture(), run.pixels)
            recording.estimate(0, 0.0, run.estimates[0])
        raise error


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_run_that_fails_leaves_a_complete_file(run: Run, tmp_path: Path, error: type[BaseException]) -> None:
    path = tmp_path / "failed.rrd"
    with pytest.raises(error):
        fail(path, error, run)
    verify(path)
    assert (entities.SEEN, "Points2D:positions") in read(path)


def test_a_run_that_fails_without_a_shape_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError):
        fail(tmp_path / "failed.rrd", RuntimeError)
    assert not list(tmp_path.iterdir())


def test_an_interrupted_run_is_kept_without_a_shape(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        fail(tmp_path / "interrupted.rrd", KeyboardInterrupt)
    verify(tmp_path / "interrupted.rrd")


def test_a_run_without_a_frame_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "new" / "empty.rrd"
    with record(path):
        assert not path.exists()
    assert not path.exists()


@pytest.mark.parametrize("options", [{"connect": "127.0.0.1:1"}, {"connect": "nonsense://x"}, {"connect": "a:b"}])
def test_an_absent_viewer_is_an_error_and_leaves_no_file(tmp_path: Path, options: dict[str, str]) -> None:
    with pytest.raises(UsageError, match=r"--connect|no viewer answers at 127\.0\.0\.1:1"):
        record(tmp_path / "x.rrd", **options)
    assert not list(tmp_path.iterdir())


def test_an_unwritable_place_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match=r"cannot write .*x\.rrd: .*choose another place"):
        record(tmp_path / "file" / "x.rrd")
    with pytest.raises(UsageError, match="is a folder: choose another name"):
        record(tmp_path, overwrite=True)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_disk_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.recording.stream.FULL_BYTES", 2**60)
    with pytest.raises(UsageError, match=r"cannot write .* the disk is full"):
        Stream(tmp_path / "run.rrd", [])
    assert list(tmp_path.iterdir()) == []


def test_without_file_and_viewer_nothing_happens() -> None:
    with record(None) as recording:
        recording.observe(*frame(), phase="tracking")
        recording.timing(0, 0.0, STAGE_MS)
        recording.summary({})
    assert recording.path is None


def test_rerun_says_nothing_on_the_terminal(tmp_path: Path) -> None:
    target = tmp_path / "quiet.rrd"
    code = f"from pathlib import Path; from tests.synthetic_run import write_run; write_run(Path({str(target)!r}))"
    root = Path(__file__).parents[3]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, check=True)
    assert done.stdout == done.stderr == b""
