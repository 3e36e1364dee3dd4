"""The sample video as bad cameras and bad days deliver it, and the errors of runs over it, frame by frame."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from app.files.track_file import load_truth
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.terminal.progress import Progress
from reconstruction.basis.mesh import mesh_from_faces
from reconstruction.evaluation import e3d, followed
from tests.tracking.scene import texture
from tracking.video import Video

Image = NDArray[np.uint8]
Array = NDArray[np.float64]
Change = Callable[[int, Image], Image]

FRAMES = 150  # of the sample, where half of it will do; it bends from frame 60 on
OCCLUDED = range(120, 150)
COVERED = 0.4  # of the sheet


@dataclass(frozen=True)
class Result:
    """What a run over a video with known shapes gave.

    Attributes:
        words: its summary.
        frames: (K,) truth frames with a shape.
        e3d: (K,) error of each.
        visible: (F, P) points seen, by frame.
    """

    words: dict[str, object]
    frames: NDArray[np.int64]
    e3d: Array
    visible: NDArray[np.bool_]

    def error(self, frames: Iterable[int]) -> float:
        """Mean error over the truth frames among these."""
        chosen = np.isin(self.frames, list(frames))
        assert chosen.any()
        return float(self.e3d[chosen].mean())


def run(video: Path, truth: Path, roi: tuple[int, int, int, int] | None, folder: Path, frames: str = ":") -> Result:
    """Run the whole pipeline over frames of a video, without a recording's pictures."""
    output = Output(
        out=folder / "run.rrd",
        tracks_out=folder / "tracks.npz",
        shapes_out=folder / "shapes.npz",
        overwrite=True,
        image="none",
    )
    config = Run(source=str(video), roi=roi, ground_truth=truth, output=output, frames=frames)
    words = Session(config, Progress()).run().as_dict()
    with np.load(folder / "tracks.npz") as tracks:
        visible = tracks["visible"]
    frames, errors = errors_by_frame(folder / "shapes.npz", truth)
    return Result(words, frames, errors, visible)


def errors_by_frame(shapes: Path, truth: Path) -> tuple[NDArray[np.int64], Array]:
    """The truth frames (K,) that have a shape, and the e3d (K,) of each, one scale and depth sign for all."""
    known = load_truth(truth)
    with np.load(shapes) as file:
        row = {int(f): k for k, f in enumerate(file["frames"]) if np.isfinite(file["s"][k])}
        chosen = np.array([k for k, f in enumerate(known.frames) if int(f) in row])
        S = file["S"][[row[int(f)] for f in known.frames[chosen]]]
        image = file["K"] @ S
        projections = (image[:, :2] / image[:, 2:]).transpose(0, 2, 1)
        points, _, inside = followed(S, projections, file["rest"], mesh_from_faces(file["faces"]), known.W_px[chosen[0]].T)
    return known.frames[chosen], e3d(points, known.S[chosen][:, :, inside])


def write(path: Path, pictures: Iterable[Image], size: tuple[int, int]) -> Path:
    """A video nearly without loss, 30 frames a second."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, size)
    writer.set(cv2.VIDEOWRITER_PROP_QUALITY, 98)
    for picture in pictures:
        writer.write(picture)
    writer.release()
    return path


def changed(video: Path, *changes: Change, frames: int | None = None) -> Iterator[Image]:
    """The first pictures of a video, or all of them, each changed."""
    with Video(str(video)) as source:
        for frame in itertools.islice(source, frames):
            image = frame.image
            for change in changes:
                image = change(frame.index, image)
            yield image


def blurred(length_px: int) -> Change:
    """Motion blur along a direction that turns slowly."""

    def change(index: int, image: Image) -> Image:
        kernel = np.zeros((length_px + 5, length_px + 5), np.float32)
        middle = (length_px + 5) // 2
        step = 0.5 * (length_px - 1) * np.array([np.cos(index / 20), np.sin(index / 20)])
        a, b = (tuple(np.rint((middle + sign * step) * 16).astype(int).tolist()) for sign in (-1, 1))
        cv2.line(kernel, a, b, (1.0,), 1, cv2.LINE_AA, shift=4)
        return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()), np.uint8)

    return change


def flickering(share: float) -> Change:
    """Brightness that swings by a share to both sides, once in 50 frames."""
    return lambda index, image: np.asarray(
        cv2.convertScaleAbs(image, alpha=1.0 + share * np.sin(2 * np.pi * index / 50)), np.uint8
    )


def noisy(sigma: float) -> Change:
    """Gaussian noise of so many grey levels."""

    def change(index: int, image: Image) -> Image:
        noise = np.random.default_rng(index).normal(0.0, sigma, image.shape)
        return np.clip(image + noise, 0, 255).astype(np.uint8)

    return change


def compressed(quality: int) -> Change:
    """JPEG."""

    def change(_index: int, image: Image) -> Image:
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)

    return change


def occluded(truth: Path, where: str = "disc") -> Change:
    """Something textured that wanders over 40 % of the sheet, there at once and gone at once.

    It lies in the middle (disc), across the middle (band) or over one side (side).
    """
    known = load_truth(truth)
    cover = texture(9, (1000, 900))
    measure = {
        "disc": lambda x, y, centre: np.hypot(x - centre[0], y - centre[1]),
        "band": lambda x, y, centre: np.abs(x - centre[0] + 0.3 * (y - centre[1])),
        "side": lambda x, y, centre: x - centre[0] + 0.0 * y,
    }[where]

    def change(index: int, image: Image) -> Image:
        if index not in OCCLUDED:
            return image
        k = int(np.searchsorted(known.frames, index))
        after, before = known.W_px[min(k, len(known.frames) - 1)], known.W_px[k - 1]
        share = (index - known.frames[k - 1]) / float(np.diff(known.frames[k - 1 : k + 1])[0])
        places = (1.0 - share) * before + share * after
        centre = places.mean(axis=1)
        reach = np.quantile(measure(*places, centre), COVERED)
        y, x = np.mgrid[: image.shape[0], : image.shape[1]]
        covered = measure(x, y, centre) <= reach
        shift = 3 * (index - OCCLUDED.start)
        image = image.copy()
        image[covered] = cover[shift : shift + image.shape[0], 200 - shift : 200 - shift + image.shape[1]][covered]
        return image

    return change


def thinned(video: Path, truth: Path, folder: Path, share: float) -> tuple[Path, Path]:
    """A video that lost a share of its first frames at random, and the truth of those that are left."""
    known = load_truth(truth)
    rng = np.random.default_rng(0)
    with Video(str(video)) as frames:
        kept = [frame for frame in itertools.islice(frames, FRAMES) if frame.index == 0 or rng.random() >= share]
    number = {frame.index: k for k, frame in enumerate(kept)}
    left = [k for k, f in enumerate(known.frames) if int(f) in number]
    where = folder / "thinned.npz"
    renumbered = [number[int(known.frames[k])] for k in left]
    np.savez(where, W_px=known.W_px[left], S_gt=known.S[left], gt_frames=renumbered, K=known.K)
    size = kept[0].image.shape[1::-1]
    return write(folder / "thinned.avi", (frame.image for frame in kept), size), where
