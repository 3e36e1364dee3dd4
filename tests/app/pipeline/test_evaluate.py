"""Evaluation: whatever the units of image and rest shape are, the outcome is the same."""

from pathlib import Path

import numpy as np
import pytest

from app.options.evaluate import Evaluate
from app.options.model import Model
from app.pipeline.evaluate import Evaluation, evaluate
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from reconstruction.basis.mesh import triangulate
from tests.reconstruction.mapping.bending import CAMERA, waving_sheet
from tests.reconstruction.runs import swelling_hill
from tracking import TrackingError

MILLI, KILO = 1e-3, 1e3
SLOW = pytest.mark.slow
UNITS = ((MILLI, 1.0), (KILO, 1.0), (1.0, MILLI), (1.0, KILO), (MILLI, MILLI), (KILO, MILLI))  # of shapes, of images


def scaled(source: Path, folder: Path, shape: float = 1.0, image: float = 1.0) -> Path:
    """Tracks whose true shapes and images are so many times as large."""
    with np.load(source) as arrays:
        tracks = dict(arrays)
    tracks["S_gt"] = shape * tracks["S_gt"]
    tracks["W"] = image * tracks["W"]
    if "K" in tracks:
        tracks["K"] = np.diag([image, image, 1.0]) @ tracks["K"]
    np.savez(folder / "tracks.npz", **tracks)
    return folder / "tracks.npz"


def evaluated(source: Path, folder: Path, rest: str, shape: float = 1.0, image: float = 1.0) -> Evaluation:
    """The outcome for such tracks; as a mesh, the rest shape is the first true one."""
    tracks = scaled(source, folder, shape, image)
    if rest == "mesh":
        rest = str(folder / "rest.obj")
        with np.load(tracks) as arrays:
            write_mesh(Path(rest), arrays["S_gt"][0])
    return evaluate(Evaluate(tracks, rest_shape=rest), Progress())


def write_mesh(path: Path, shape: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> None:
    """A shape (3, p) as Wavefront OBJ."""
    vertices = "".join(f"v {x:.17g} {y:.17g} {z:.17g}\n" for x, y, z in shape.T)
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in triangulate(shape[:2].T).faces + 1)
    path.write_text(vertices + faces)


@pytest.mark.parametrize(
    ("file", "rest", "units"),
    [
        ("flag250", "first-truth", ((MILLI, 1.0), (1.0, KILO))),
        pytest.param("flag250_perspective", "mesh", ((KILO, MILLI),), marks=SLOW),
        pytest.param("flag250_perspective", "mesh", ((MILLI, 1.0),), marks=SLOW),
        ("face37", "rigid", ((1.0, MILLI),)),
        pytest.param("flag250", "first-truth", UNITS, marks=SLOW),
        pytest.param("flag250_perspective", "first-truth", UNITS, marks=SLOW),
        pytest.param("face37", "first-truth", ((KILO, MILLI),), marks=SLOW),
        pytest.param("face37", "rigid", UNITS, marks=SLOW),
        pytest.param("face37", "auto", ((KILO, MILLI),), marks=SLOW),
        pytest.param("flag250", "auto", ((KILO, MILLI),), marks=SLOW),
        # A regular grid has ties, which rounding decides (2e-6 in the error): powers of two have none.
        pytest.param("flag250_perspective", "auto", ((1.0, 2.0**-10),), marks=SLOW),
        pytest.param("flag250_perspective", "auto", ((1.0, 2.0**10),), marks=SLOW),
        # Facing an orthographic camera a sheet is on a saddle, where rounding decides: powers of two have none.
        pytest.param("flag250", "plane", ((1.0, 2.0**-10), (1.0, 2.0**10)), marks=SLOW),
    ],
)
def test_units_do_not_matter(
    shared_data: Path, tmp_path: Path, file: str, rest: str, units: tuple[tuple[float, float], ...]
) -> None:
    source = shared_data / f"{file}.npz"
    usual = evaluated(source, tmp_path, rest)
    assert usual.score is not None
    for shape, image in units:
        other = evaluated(source, tmp_path, rest, shape, image)
        assert other.score is not None
        assert other.score.e3d == pytest.approx(usual.score.e3d, abs=1e-6), (shape, image)
        assert other.rest_shape == usual.rest_shape


@pytest.mark.slow
def test_a_rest_shape_gives_the_shapes_its_units(shared_data: Path, tmp_path: Path) -> None:
    shapes = []
    for unit in (1.0, MILLI):
        out, tracks = tmp_path / f"shapes{unit}.npz", scaled(shared_data / "flag250_perspective.npz", tmp_path, shape=unit)
        evaluate(Evaluate(tracks, rest_shape="first-truth", shapes_out=out), Progress())
        with np.load(out) as arrays:
            shapes.append(arrays["S"])
    np.testing.assert_allclose(shapes[1], MILLI * shapes[0], rtol=1e-6)


@SLOW
@pytest.mark.parametrize(
    ("file", "rest"),
    [
        ("flag250_perspective", "first-truth"),
        ("flag250", "auto"),
        ("flag250_perspective", "auto"),
        ("face37", "auto"),
        ("waving_3", "auto"),
    ],
)
def test_errors_are_as_large_as_predicted(shared_data: Path, file: str, rest: str) -> None:
    config = Evaluate(shared_data / f"{file}.npz", rest_shape=rest, model=Model(uncertainty=True))
    score = evaluate(config, Progress()).score
    assert score is not None
    assert score.error_over_sigma is not None
    assert 0.5 < score.error_over_sigma < 2


@SLOW
def test_tracks_without_a_camera_say_which(tmp_path: Path) -> None:
    path = tmp_path / "tracks.npz"
    W, S = waving_sheet(np.random.default_rng(5), 60)
    np.savez(path, W=W, S_gt=S)
    found, told = (evaluate(Evaluate(path, camera=camera), Progress()) for camera in ("auto", "orthographic"))
    assert told.focal_px is None
    assert found.focal_px == pytest.approx(CAMERA.focal_px, rel=0.1)
    assert found.score is not None
    assert told.score is not None
    assert found.score.e3d < 0.02 < 0.05 < told.score.e3d


def hostile(name: str, W: np.ndarray, visible: np.ndarray) -> dict[str, np.ndarray]:
    """Tracks that cannot come of a surface, made of some that do."""
    F, _, P = W.shape
    unseen = np.zeros((F, P), bool)
    return {
        "never seen": {"W": W, "visible": unseen},
        "at one place": {"W": np.zeros_like(W), "visible": visible},
        "denormal": {"W": W / np.abs(W).max() * 1e-310, "visible": visible},
        "too large": {"W": W / np.abs(W).max() * 1e300, "visible": visible},
        "on a line": {"W": np.stack([W[:, 0], W[:, 0] / 2], axis=1), "visible": visible},
        "mirrored camera": {"W": W, "visible": visible, "K": np.diag([500.0, 500.0, -1.0])},
        "skewed camera": {"W": W, "visible": visible, "K": np.array([[500.0, 100, 0], [0, 500, 0], [0, 0, 1]])},
    }[name]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("never seen", "no frame shows 4 points"),
        ("at one place", "at one place"),
        ("denormal", "at one place"),
        ("too large", "values beyond"),
        ("on a line", "on one line"),
        ("mirrored camera", "no camera matrix"),
        ("skewed camera", "without skew"),
    ],
)
def test_tracks_that_show_nothing_are_refused(tmp_path: Path, name: str, says: str) -> None:
    W, _ = swelling_hill()
    np.savez(tmp_path / "tracks.npz", **hostile(name, W, np.ones((len(W), W.shape[2]), bool)))
    with pytest.raises(TrackingError, match=says):
        evaluate(Evaluate(tmp_path / "tracks.npz"), Progress())


def test_a_first_shape_that_lacks_points_is_refused(tmp_path: Path) -> None:
    W, S = swelling_hill()
    S[0, 2, 7] = np.nan
    np.savez(tmp_path / "tracks.npz", W=W, S_gt=S)
    with pytest.raises(UsageError, match="lacks points: choose another --rest-shape"):
        evaluate(Evaluate(tmp_path / "tracks.npz", rest_shape="first-truth"), Progress())


def test_tracks_of_which_nearly_all_is_hidden_are_refused(tmp_path: Path) -> None:
    W, _ = swelling_hill()
    np.savez(tmp_path / "tracks.npz", W=W[:, :, :40])
    with pytest.raises(TrackingError, match="no frame shows 4 points"):
        evaluate(Evaluate(tmp_path / "tracks.npz", missing=0.99), Progress())


@pytest.mark.parametrize("unseen", [slice(5, 6), pytest.param(slice(0, 15), marks=SLOW)])
def test_frames_that_show_nothing_do_not_stop_a_run(tmp_path: Path, unseen: slice) -> None:
    W = swelling_hill()[0][:40, :, ::5]
    visible = np.ones((len(W), W.shape[2]), bool)
    visible[unseen] = False
    visible[:, 3] = False  # a point that is never seen is left out
    np.savez(tmp_path / "tracks.npz", W=W, visible=visible)
    words = evaluate(Evaluate(tmp_path / "tracks.npz", shapes_out=tmp_path / "shapes.npz"), Progress())
    assert (words.frames, words.points) == (len(W), W.shape[2] - 1)
    with np.load(tmp_path / "shapes.npz") as shapes:
        assert np.isfinite(shapes["S"]).all()
