"""Files appear only when complete, and nothing is replaced unasked."""

import os
from pathlib import Path

import pytest

from app.files.writing import check_free, check_free_folder, check_outputs, writable, writable_folder
from app.terminal.errors import UsageError


def test_a_file_appears_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    with writable(path) as file:
        file.write(b"1,2\n")
        assert not path.exists()
    assert path.read_bytes() == b"1,2\n"


def test_what_fails_leaves_the_file_of_before(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("before")

    def fail() -> None:
        with writable(path) as file:
            file.write(b"1,2\n")
            raise OSError(28, "No space left on device")

    with pytest.raises(UsageError, match=r"cannot write .*table\.csv: No space left"):
        fail()
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [("table.csv", "before")]


def test_a_place_is_seen_to_before_the_work(tmp_path: Path) -> None:
    path = tmp_path / "new" / "table.csv"
    check_free(None, overwrite=False)
    check_free(path, overwrite=False)
    assert list(path.parent.iterdir()) == []
    path.write_text("somebody's work")
    with pytest.raises(UsageError, match=r"table\.csv exists: replace it with --overwrite"):
        check_free(path, overwrite=False)
    check_free(path, overwrite=True)
    assert path.read_text() == "somebody's work"
    with pytest.raises(UsageError, match="cannot write"):
        check_free(path / "table.csv", overwrite=False)


def test_an_empty_file_that_was_there_stays(tmp_path: Path) -> None:
    path = tmp_path / "empty.npz"
    path.touch()
    check_free(path, overwrite=True)
    assert path.exists()


def test_a_folder_is_filled_when_all_is_there_and_keeps_what_is_not_ours(tmp_path: Path) -> None:
    folder = tmp_path / "meshes"
    check_free_folder(folder, overwrite=False)
    assert list(tmp_path.iterdir()) == []
    folder.mkdir()
    for name in ("frame_9.obj", "notes.txt"):
        (folder / name).write_text("before")
    with pytest.raises(UsageError, match="meshes exists: replace what is in it with --overwrite"):
        check_free_folder(folder, overwrite=False)
    check_free_folder(folder, overwrite=True)
    with writable_folder(folder, ["frame_*.obj"]) as unfinished:
        (unfinished / "frame_1.obj").write_text("now")
        assert not (folder / "frame_1.obj").exists()
    assert {path.name for path in folder.iterdir()} == {"frame_1.obj", "notes.txt"}
    assert list(tmp_path.iterdir()) == [folder]


def test_a_device_stays_a_device(tmp_path: Path) -> None:
    device = tmp_path / "pipe"
    os.mkfifo(device)
    with pytest.raises(UsageError, match="no regular file"):
        check_free(device, overwrite=True)
    with pytest.raises(UsageError, match="is a folder"):
        check_free(tmp_path, overwrite=True)


def test_what_is_read_is_not_written_and_no_two_are_the_same(tmp_path: Path) -> None:
    video, other = tmp_path / "a.mp4", tmp_path / "b.rrd"
    video.write_bytes(b"somebody's work")
    (tmp_path / "link.mp4").symlink_to(video)
    for path in (video, tmp_path / "link.mp4"):
        with pytest.raises(UsageError, match=r"--out .* is read from"):
            check_outputs({"--out": path}, [str(video), None], overwrite=True)
    with pytest.raises(UsageError, match="--out and --csv are the same file"):
        check_outputs({"--out": other, "--csv": tmp_path / "." / "b.rrd"}, [video], overwrite=True)
    assert video.read_bytes() == b"somebody's work"


def test_folders_and_files_of_somebody_else_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "x.part").mkdir()
    (tmp_path / "x.part" / "mine.txt").write_text("mine")
    with writable_folder(tmp_path / "x", ["*.obj"]) as folder:
        (folder / "1.obj").write_text("")
    assert (tmp_path / "x.part" / "mine.txt").read_text() == "mine"
    assert [path.name for path in (tmp_path / "x").iterdir()] == ["1.obj"]
    assert {path.name for path in tmp_path.iterdir()} == {"x", "x.part"}
