"""A file that grows has its name once it is worth one, and nobody else's is replaced."""

from pathlib import Path

import pytest

from app.files.growing import GrowingFile
from app.files.locks import locked
from app.files.writing import check_free, check_outputs, writable
from app.terminal.errors import UsageError


def test_until_it_is_shown_there_is_nothing_to_see(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    check_free(path, overwrite=False)
    file = GrowingFile(path)
    file.path.write_bytes(b"first")
    assert not path.exists()
    file.show()
    assert path.read_bytes() == b"first"
    file.close(keep=True)
    assert [one.name for one in tmp_path.iterdir()] == ["run.rrd"]


@pytest.mark.parametrize("shown", [False, True])
def test_one_that_is_not_kept_leaves_nothing(tmp_path: Path, shown: bool) -> None:
    file = GrowingFile(tmp_path / "run.rrd")
    if shown:
        file.show()
    file.close(keep=False)
    assert list(tmp_path.iterdir()) == []


def test_where_files_need_names_one_is_hidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("os.O_TMPFILE")
    file = GrowingFile(tmp_path / "run.rrd")
    assert [one.name[0] for one in tmp_path.iterdir()] == ["."]
    file.show()
    file.close(keep=True)
    assert [one.name for one in tmp_path.iterdir()] == ["run.rrd"]


def test_the_second_of_two_is_told(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    path.write_text("before")
    check_free(path, overwrite=True)
    first, second = GrowingFile(path), GrowingFile(path)
    first.show()
    with pytest.raises(UsageError, match="being written by another run"):
        check_free(path, overwrite=True)
    with pytest.raises(UsageError, match="being written by another run"):
        second.show()
    first.close(keep=True)
    check_free(path, overwrite=True)
    second.close(keep=False)
    assert path.exists()


def test_what_appeared_meanwhile_stays(tmp_path: Path) -> None:
    path = tmp_path / "shapes.npz"
    check_free(path, overwrite=False)
    path.write_text("somebody's")
    with pytest.raises(UsageError, match=r"shapes-2\.npz"), writable(path) as file:
        file.write(b"ours")
    assert path.read_text() == "somebody's"
    assert (tmp_path / "shapes-2.npz").read_bytes() == b"ours"
    recording = GrowingFile(path)
    with pytest.raises(UsageError, match="written by somebody meanwhile"):
        recording.show()
    recording.close(keep=True)
    assert path.read_text() == "somebody's"


def test_a_hard_link_to_what_is_read_is_no_place(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_text("a video")
    (tmp_path / "b.mp4").hardlink_to(tmp_path / "a.mp4")
    with pytest.raises(UsageError, match="is read from"):
        check_outputs({"--out": tmp_path / "b.mp4"}, [tmp_path / "a.mp4"], overwrite=True)


def test_a_folder_has_one_batch(tmp_path: Path) -> None:
    with (
        locked(tmp_path, "one is there"),
        pytest.raises(UsageError, match="one is there"),
        locked(tmp_path, "one is there"),
    ):
        pass
