"""Pictures of a thing before a desk, in the light of a lamp, as a video with its truth."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial import Delaunay

from app.arrays import Array, Floats, Image
from app.demo.camera import DESK, SIZE, K, project
from app.painting.raster import Rasteriser
from app.painting.shading import sampled
from app.synthetic.places import ASPECT, grid
from app.synthetic.scene import Scene

COLUMNS, ROWS = 97, 73  # of the mesh that is drawn
TEXTURE_PX = 480  # width
BLOBS_PX = (2.0, 4.0, 10.0)
LAMP = np.array([-0.4, -0.5, -0.77])  # where the light comes from
AMBIENT = 0.4
NOISE = 1.5  # grey levels
TRUTH_EVERY = 4
INSET = 0.05  # of the region's width, off the thing's outline


@dataclass(frozen=True)
class Filmed:
    """A video, its truth as `--ground-truth` takes it, and the region x, y, width, height px of the thing in frame 0."""

    video: Path
    truth: Path
    roi: tuple[int, int, int, int]


class Renderer:
    """Draws the frames of a scene."""

    def __init__(self, scene: Scene) -> None:
        rng = np.random.default_rng(scene.seed)
        self._scene = scene
        self._places = grid(COLUMNS, ROWS)
        self._texture = blobs(rng)
        on_texture = (self._places / (1.0, ASPECT) + 0.5) * (np.array(self._texture.shape[1::-1]) - 1)
        faces = Delaunay(on_texture).simplices.astype(np.int64)
        self._raster = Rasteriser(faces, on_texture, SIZE, perspective=True)
        desk = cv2.imread(str(DESK))
        assert desk is not None
        self._desk = desk.astype(np.float32)

    def render(self, frame: int) -> Image:
        """The picture (480, 640, 3) of a frame; the same frame gives the same bytes."""
        points = self._scene.points(self._places, frame)
        picture = self._desk.copy()
        surface = self._raster.map(project(points), np.linalg.norm(points, axis=1))
        if surface is not None:
            colour = sampled(self._texture, surface.uv, cv2.BORDER_REPLICATE).astype(np.float32)
            scale = np.array([COLUMNS - 1, ROWS - 1]) / (np.array(self._texture.shape[1::-1]) - 1)
            colour *= sampled(self._light(points), (surface.uv * scale).astype(np.float32), cv2.BORDER_REPLICATE)[..., None]
            cover = surface.cover[..., None]
            picture[surface.region] += cover * (colour - picture[surface.region])
        picture += np.random.default_rng([self._scene.seed, frame]).normal(0, NOISE, picture.shape)
        return np.clip(np.rint(picture), 0, 255).astype(np.uint8)

    def _light(self, points: Array) -> Floats:
        """Light (ROWS, COLUMNS) on the mesh's vertices."""
        net = points.reshape(ROWS, COLUMNS, 3)
        normal = np.cross(np.gradient(net, axis=0), np.gradient(net, axis=1))
        facing = (normal @ LAMP) / np.linalg.norm(normal, axis=2)
        return (AMBIENT + (1 - AMBIENT) * facing.clip(0)).astype(np.float32)


def blobs(rng: np.random.Generator) -> Image:
    """A texture of grey blobs of several sizes."""
    size = (round(TEXTURE_PX * ASPECT), TEXTURE_PX)
    layers = [cv2.GaussianBlur(rng.normal(0.0, sigma, size), (0, 0), sigma) for sigma in BLOBS_PX]
    total = np.sum(layers, axis=0)
    grey = np.clip(140.0 + 45.0 * total / total.std(), 0, 255).astype(np.uint8)
    return np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), np.uint8)


def write_video(scene: Scene, folder: Path) -> Filmed:
    """Make NAME.mp4 and NAME.npz in a folder."""
    stem = scene.name.replace(" ", "-")
    filmed = Filmed(folder / f"{stem}.mp4", folder / f"{stem}.npz", region(scene))
    renderer = Renderer(scene)
    writer = cv2.VideoWriter(str(filmed.video), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, SIZE)
    try:
        for frame in range(scene.frames):
            writer.write(renderer.render(frame))
    finally:
        writer.release()
    frames = np.arange(0, scene.frames, TRUTH_EVERY)
    places = grid(27, 19)
    places = places[scene.faces_camera(places, 0) > 0]  # those on its far side would be taken for near ones before them
    shapes = np.stack([scene.points(places, int(frame)) for frame in frames])
    W = np.stack([project(shape).T for shape in shapes])
    np.savez_compressed(filmed.truth, W_px=W, S_gt=shapes.transpose(0, 2, 1), gt_frames=frames, K=K)
    return filmed


def region(scene: Scene) -> tuple[int, int, int, int]:
    """Where the thing is in frame 0, a little inside its outline."""
    outline = project(scene.points(grid(27, 19) * (1 - 2 * INSET), 0))
    (left, top), (right, bottom) = np.ceil(outline.min(axis=0)), np.floor(outline.max(axis=0))
    return int(left), int(top), int(right - left), int(bottom - top)
