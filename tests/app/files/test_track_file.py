import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.files.track_file import load_tracks, load_truth
from tracking import TrackingError
from tracking.tracks import Tracks, known_points

F, P = 5, 7
RNG = np.random.default_rng(0)
W = RNG.uniform(0, 100, (F, 2, P))
S = RNG.normal(size=(2, 3, P))
K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
COMPLETE: dict[str, Any] = {"W": W, "visible": np.ones((F, P), bool), "K": K, "S_gt": S, "gt_frames": np.array([1, 4])}
TRUTH: dict[str, Any] = {"W_px": W[:2], "S_gt": S, "gt_frames": np.array([1, 4]), "K": K}
NAN_W = np.where(np.arange(P) == 3, np.nan, W)


def write(folder: Path, **arrays: Any) -> Path:
    path = folder / "tracks.npz"
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return path


def test_saved_tracks_come_back(tmp_path: Path) -> None:
    visible = RNG.random((F, P)) < 0.7
    tracks = Tracks(np.where(visible[:, None], W, np.nan), visible, K, S, np.array([1, 4]))
    path = tmp_path / "any name"
    with path.open("wb") as file:
        tracks.save(file)
    loaded = load_tracks(path)
    for name in ("W", "visible", "K", "S_gt", "gt_frames"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(tracks, name))


def test_only_w_is_needed(tmp_path: Path) -> None:
    tracks = load_tracks(write(tmp_path, W=W.astype(np.float32)))
    assert tracks.W.dtype == np.float64
    assert tracks.visible.all()
    assert tracks.visible.shape == (F, P)
    assert tracks.K is tracks.S_gt is tracks.gt_frames is None


@pytest.mark.parametrize("told", [True, False])
def test_hidden_entries_may_be_nan(tmp_path: Path, *, told: bool) -> None:
    visible = {"visible": np.isfinite(NAN_W[:, 0]).astype(np.uint8)} if told else {}
    assert load_tracks(write(tmp_path, W=NAN_W, **visible)).visible.sum() == F * (P - 1)


def test_matrices_have_the_rows_of_frame_after_frame(tmp_path: Path) -> None:
    path = write(tmp_path, **COMPLETE | {"W": W.reshape(2 * F, P), "S_gt": S.reshape(-1, P)})
    tracks = load_tracks(path)
    np.testing.assert_array_equal(tracks.W, W)
    assert tracks.S_gt is not None
    np.testing.assert_array_equal(tracks.S_gt, S)


@pytest.mark.parametrize("axes", [(0, 2, 1), (1, 2, 0)])
def test_coordinates_may_come_last_or_first(tmp_path: Path, axes: tuple[int, int, int]) -> None:
    tracks = load_tracks(write(tmp_path, W=W.transpose(axes), S_gt=S.transpose(axes), gt_frames=COMPLETE["gt_frames"]))
    np.testing.assert_array_equal(tracks.W, W)
    np.testing.assert_array_equal(tracks.S_gt, S)


TIMES = np.linspace(0, 1, 20)[:, None, None]
TURNED = RNG.normal(size=(3, P)) + TIMES * RNG.normal(size=(3, P))  # (20, 3, P), each like the one before


@pytest.mark.parametrize("hidden", [np.nan, 0.0])
def test_matrices_may_have_all_x_before_all_y(tmp_path: Path, hidden: float) -> None:
    shapes = 300 + 100 * TURNED
    seen = np.where(RNG.random((20, 1, P)) < 0.3, hidden, shapes[:, :2])
    for blocks in (True, False):
        matrices = [A.swapaxes(0, 1) if blocks else A for A in (seen, shapes)]
        tracks = load_tracks(write(tmp_path, W=matrices[0].reshape(-1, P), S_gt=matrices[1].reshape(-1, P)))
        np.testing.assert_array_equal(tracks.W, seen)
        assert tracks.S_gt is not None
        np.testing.assert_array_equal(tracks.S_gt, shapes)


def test_true_shapes_alone_are_projected(tmp_path: Path) -> None:
    assert (
        load_tracks(write(tmp_path, P3_gt=TURNED.swapaxes(0, 1).reshape(-1, P))).note
        == "no W: the true shapes are looked at along z"
    )
    seen = load_tracks(write(tmp_path, S_gt=TURNED + np.array([[0.0], [0], [9]]), K=K)).W
    np.testing.assert_allclose(seen[3, :, 1], K[:2, 2] + 500 * TURNED[3, :2, 1] / (9 + TURNED[3, 2, 1]))


def test_points_whose_truth_is_not_known(tmp_path: Path) -> None:
    truth = np.repeat(S[:1], F, axis=0)
    truth[1, 2, 4] = np.nan
    truth[2, :, 5] = 0
    truth[3, :, : P - 2] = np.nan
    tracks = load_tracks(write(tmp_path, W=W, S_gt=truth))
    assert tracks.gt_frames is not None
    assert tracks.gt_frames.tolist() == [0, 1, 2, 4]
    assert tracks.S_gt is not None
    known = known_points(tracks.S_gt)
    assert np.argwhere(~known).tolist() == [[1, 4], [2, 5]]
    assert load_truth(write(tmp_path, W_px=W, S_gt=truth, gt_frames=np.arange(F))).W_px.shape == (4, 2, P)


def test_visibility_may_have_a_row_for_each_point(tmp_path: Path) -> None:
    visible = RNG.random((F, P)) < 0.7
    np.testing.assert_array_equal(load_tracks(write(tmp_path, W=W, visible=visible.T)).visible, visible)


def test_true_shapes_of_all_frames_need_no_numbers(tmp_path: Path) -> None:
    tracks = load_tracks(write(tmp_path, W=W, S_gt=np.repeat(S[:1], F, axis=0)))
    assert tracks.gt_frames is not None
    assert tracks.gt_frames.tolist() == list(range(F))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"W": None}, "has no array W (frames, 2, points), only K, S_gt, gt_frames, visible"),
        ({"W": None, "W_px": W[:2]}, "with W_px it is a file of truth only"),
        ({"W": W[0, :1]}, "W has the shape (1, 7), but (frames, 2, points) is needed"),
        ({"W": W.reshape(F, P, 2, 1)}, "W has the shape (5, 7, 2, 1), but (frames, 2, points) is needed"),
        ({"W": RNG.random((F, 3, P))}, "W has the shape (5, 3, 7), but (frames, 2, points) is needed"),
        ({"W": W[:0]}, "W has the shape (0, 2, 7), but"),
        ({"W": NAN_W}, "W has 5 visible entries that are not finite (first: frame 0, point 3)"),
        ({"W": W.astype(str)}, "W holds <U32, but numbers are needed"),
        ({"W": W * 1j}, "W holds complex128, but numbers are needed"),
        ({"visible": np.ones((P, F + 1), bool)}, "visible has the shape (7, 6), but (5, 7) as in W is needed"),
        ({"visible": np.full((F, P), 0.5)}, "visible holds float64, but true or false is needed"),
        ({"K": np.eye(4)}, "K has the shape (4, 4), but (3, 3) is needed"),
        ({"K": -K}, "its focal lengths K[0, 0] and K[1, 1] must be positive"),
        ({"K": K * np.nan}, "K is no camera matrix"),
        ({"S_gt": None}, "S_gt and gt_frames belong together"),
        ({"gt_frames": None}, "S_gt and gt_frames belong together"),
        ({"S_gt": S[:, :, :4]}, "S_gt has the shape (2, 3, 4), but (true frames, 3, 7) as there are 7 points"),
        ({"S_gt": S[:, :2]}, "S_gt has the shape (2, 2, 7), but"),
        ({"S_gt": S * np.inf}, "S_gt has infinite entries; NaN tells that a point is not known"),
        ({"S_gt": S * np.nan}, "S_gt knows fewer than 3 points of its shape 0: leave it out"),
        ({"gt_frames": np.arange(3)}, "gt_frames has the shape (3,), but (2,) as S_gt has 2 shapes is needed"),
        ({"gt_frames": np.array([1, 5])}, "gt_frames goes to 5, but W has only the frames 0 to 4"),
        ({"gt_frames": np.array([-1, 4])}, "gt_frames must ascend from 0"),
        ({"gt_frames": np.array([4, 1])}, "gt_frames must ascend from 0"),
        ({"gt_frames": np.array([1.5, 3])}, "gt_frames holds frame numbers that are not whole"),
    ],
)
def test_tracks_that_do_not_fit(tmp_path: Path, change: dict[str, Any], says: str) -> None:
    path = write(tmp_path, **{**COMPLETE, **change})
    with pytest.raises(TrackingError, match=re.escape(says)) as error:
        load_tracks(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("load", [load_tracks, load_truth])
@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "no file {}; check the path"),
        (b"", "{} is not an .npz file"),
        (b"W = 1, 2, 3", "{} is not an .npz file"),
    ],
)
def test_files_that_are_no_npz(tmp_path: Path, load: Callable[[Path], object], content: bytes | None, says: str) -> None:
    path = tmp_path / "tracks.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(TrackingError, match=re.escape(says.format(path))):
        load(path)


def test_damaged_files_are_never_a_traceback(tmp_path: Path) -> None:
    path = write(tmp_path, **COMPLETE)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(200):
        broken = bytearray(whole)
        for i in rng.integers(0, len(whole), 4):
            broken[i] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(broken[: rng.integers(len(whole) // 2, len(whole) + 1)]))
        try:
            load_tracks(path)
        except TrackingError:
            refused += 1
    assert refused > 100


def test_an_npz_of_objects_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "tracks.npz"
    np.savez(path, W=np.array([{"a": 1}], object))
    with pytest.raises(TrackingError, match="holds objects that are not arrays"):
        load_tracks(path)


def test_truth_comes_with_pixels_or_in_a_track_file(tmp_path: Path) -> None:
    for arrays in (TRUTH, {**COMPLETE, "W": np.insert(W[:2], [1, 1, 1], W[2:], axis=0)[[2, 0, 2, 3, 4]]}):
        truth = load_truth(write(tmp_path, **arrays))
        np.testing.assert_array_equal(truth.S, S)
        np.testing.assert_array_equal(truth.frames, [1, 4])
        np.testing.assert_array_equal(truth.W_px, arrays["W_px"] if "W_px" in arrays else arrays["W"][[1, 4]])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"W_px": None}, "is no truth: no array W_px, only K, S_gt, gt_frames"),
        ({"S_gt": None, "gt_frames": None}, "is no truth: no array S_gt, gt_frames, only K, W_px"),
        ({"W_px": W}, "W_px has the shape (5, 2, 7), but (2, 2, 7) as in S_gt is needed"),
        ({"W_px": W[:, :1]}, "W_px has the shape (5, 1, 7), but (true frames, 2, points) is needed"),
        ({"W_px": W[:2] * np.nan}, "W_px has entries that are not finite"),
        ({"S_gt": S[..., :3]}, "S_gt has the shape (2, 3, 3), but"),
        ({"gt_frames": np.array([1, 1])}, "gt_frames must ascend"),
        ({"K": np.eye(2)}, "K has the shape (2, 2), but (3, 3) is needed"),
    ],
)
def test_truth_that_does_not_fit(tmp_path: Path, change: dict[str, Any], says: str) -> None:
    with pytest.raises(TrackingError, match=re.escape(says)):
        load_truth(write(tmp_path, **{**TRUTH, **change}))


def test_shared_files_load(shared_data: Path) -> None:
    truth = load_truth(shared_data / "kinect_paper_gt.npz")
    assert truth.W_px.shape == (23, 2, 301)
    assert truth.K is not None
    with pytest.raises(TrackingError, match="truth only"):
        load_tracks(shared_data / "kinect_paper_gt.npz")
    for name, shape in (("flag250", (30, 2, 250)), ("flag250_perspective", (30, 2, 250)), ("face37", (74, 2, 37))):
        assert load_tracks(shared_data / f"{name}.npz").W.shape == shape
        assert load_truth(shared_data / f"{name}.npz").W_px.shape[2] == shape[2]


def test_pixels_that_are_not_square_become_square(tmp_path: Path) -> None:
    high = K * [[1.0], [1.5], [1.0]]
    stretched = W.copy()
    stretched[:, 1] = high[1, 2] + 1.5 * (W[:, 1] - K[1, 2])
    tracks = load_tracks(write(tmp_path, W=stretched, K=high))
    assert tracks.K is not None
    np.testing.assert_allclose(tracks.W[:, 1] - tracks.K[1, 2], W[:, 1] - K[1, 2], atol=1e-9)
    assert tracks.K[0, 0] == tracks.K[1, 1] == K[0, 0]


def test_shapes_that_were_estimated_are_no_truth(tmp_path: Path) -> None:
    path = write(tmp_path, W=W, S=RNG.normal(size=(F, 3, P)), Upsilon=RNG.normal(size=(3, P)))
    assert load_tracks(path).S_gt is None
