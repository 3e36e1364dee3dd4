"""The sample's files: complete, made once, and again when something is missing."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import strategies as st

from app import demo
from app.demo import store
from app.demo.motion import HEIGHT_MM, WIDTH_MM
from app.terminal.errors import UsageError

FRAMES = st.integers(0, demo.FRAMES - 1)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> demo.Sample:
    """The sample."""
    return demo.sample(tmp_path_factory.mktemp("cache"))


def test_video_has_all_frames_at_true_times_and_clean(made: demo.Sample) -> None:
    video = cv2.VideoCapture(str(made.video))
    for frame in range(demo.FRAMES):
        read, picture = video.read()
        assert read
        assert video.get(cv2.CAP_PROP_POS_MSEC) == pytest.approx(1000 * frame / demo.FPS, abs=1)
        if frame % 50 == 0:
            assert cv2.PSNR(picture, demo.render(frame)) > 33
    assert not video.read()[0]


def test_truth_has_the_agreed_arrays(made: demo.Sample) -> None:
    with np.load(made.truth) as truth:
        frames, points = truth["gt_frames"], len(truth["uv"])
        assert frames.tolist() == list(range(0, demo.FRAMES, demo.TRUTH_EVERY))
        assert points >= 300
        assert truth["W_px"].shape == (len(frames), 2, points)
        assert truth["S_gt"].shape == (len(frames), 3, points)
        image = truth["K"] @ truth["S_gt"]
        np.testing.assert_allclose(image[:, :2] / image[:, 2:], truth["W_px"], atol=1e-9)
        assert truth["K"][0, 0] != demo.SIZE[0]
        assert truth["uv"].min() == 0
        assert truth["uv"].max() == 1
        assert truth["faces"].max() == points - 1
        assert truth["shading"].shape == (len(frames), points)
        assert truth["shading"].min() > 0.2
        np.testing.assert_array_equal(truth["occluder"][54], demo.occluder(216))
    texture = cv2.imread(str(made.texture))
    assert texture.shape[1] / texture.shape[0] == pytest.approx(WIDTH_MM / HEIGHT_MM)


def test_region_lies_on_the_sheet(made: demo.Sample) -> None:
    x, y, w, h = made.roi
    corners = demo.project(demo.true_shape(0))
    assert (corners.min(axis=0) < (x, y)).all()
    assert (corners.max(axis=0) > (x + w, y + h)).all()
    assert w * h > 0.75 * np.prod(np.ptp(corners, axis=0))


def test_made_once(made: demo.Sample) -> None:
    calls: list[tuple[int, int]] = []
    again = demo.sample(made.video.parents[1], progress=lambda *done: calls.append(done))
    assert again == made
    assert calls == []
    assert sorted(path.name for path in made.video.parent.iterdir()) == [
        "sheet.mp4",
        "sheet.png",
        "sheet_gt.npz",
    ]


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples of a few frames."""
    monkeypatch.setattr(store, "FRAMES", 5)


@pytest.mark.usefixtures("quick")
def test_made_again_when_a_file_is_missing(tmp_path: Path) -> None:
    calls: list[tuple[int, int]] = []
    first = demo.sample(tmp_path, progress=lambda *done: calls.append(done))
    assert calls == [(frame + 1, 5) for frame in range(5)]
    first.truth.unlink()
    assert demo.sample(tmp_path) == first
    assert first.truth.is_file()


@pytest.mark.usefixtures("quick")
def test_interrupted_run_leaves_nothing_that_passes_for_a_sample(tmp_path: Path) -> None:
    def interrupt(done: int, _total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        demo.sample(tmp_path, progress=interrupt)
    assert not list(tmp_path.rglob("sheet*"))
    assert demo.sample(tmp_path).video.is_file()


@pytest.mark.usefixtures("quick")
def test_other_version_is_another_sample(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = demo.sample(tmp_path)
    monkeypatch.setattr(cv2, "__version__", "0.0")
    assert demo.sample(tmp_path).video != first.video


@pytest.mark.usefixtures("quick")
def test_default_folder_is_the_users_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert demo.sample().video.parents[1] == tmp_path / "modeshape"


def test_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(UsageError, match=r"cannot write .*file.*XDG_CACHE_HOME"):
        demo.sample(tmp_path / "file")
