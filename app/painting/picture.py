"""The picture that is put on a surface: a still or a video, placed in the first frame, filtered for its size there."""

from pathlib import Path
from types import TracebackType
from typing import Self, cast

import cv2
import numpy as np

from app.arrays import Array, Floats, Image
from app.painting.shading import sampled
from app.painting.surface import homography
from app.terminal.errors import UsageError
from tracking import TrackingError
from tracking.video import Frame, Video

STILLS = frozenset((".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff"))
FINEST = 2.0  # texels kept per pixel of the first frame: enough for a surface at half the distance
SHARPEN = 0.3  # levels by which minification may exceed that of the level sampled
SPREAD = 0.35  # new pixels, of the blur before shrinking
OPPOSITE = (((0, 1), (3, 2)), ((0, 3), (1, 2)))  # corners at the ends of a picture's upper and lower, left and right side
STEP_PX = 4  # between the pixels whose minification is looked at


class Texture:
    """A picture or a video to be put on a surface; a context manager.

    Args:
        path: a picture, with or without an alpha channel, or a video, which is repeated when it ends.

    Raises:
        UsageError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise UsageError(f"no texture {path}: give a PNG, a JPEG or a video")
        self._path = path
        self._video = None if path.suffix.lower() in STILLS else self._opened()
        if self._video is None:
            self._picture = premultiplied(read_picture(path))
            return
        self._begun_s = 0.0  # when the video last started over
        self._rewind(self._video)

    def at(self, time_s: float) -> Image:
        """The picture shown at a time, which never decreases: (h, w, 4) BGR, premultiplied, and alpha."""
        if self._video is None:
            return self._picture
        while self._begun_s + self._until_s() <= time_s:
            if self._next is None:
                self._begun_s += self._until_s()
                self._video.close()
                self._video = self._opened()
                self._rewind(self._video)
            else:
                self._show(self._next)
        return self._picture

    def _until_s(self) -> float:
        """Time in the present round until which the picture is shown."""
        if self._next is not None:
            return self._next.time_s
        assert self._video is not None
        return self._shown_s + 1.0 / self._video.fps

    def _rewind(self, video: Video) -> None:
        self._frames = iter(video)
        self._show(next(self._frames))

    def _show(self, frame: Frame) -> None:
        self._shown_s = frame.time_s
        self._picture = premultiplied(frame.image)
        self._next: Frame | None = next(self._frames, None)

    def _opened(self) -> Video:
        try:
            return Video(str(self._path))
        except TrackingError as error:
            raise UsageError(f"the texture {self._path} is no picture and no video that can be read: {error}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Release a video; may be called again."""
        if self._video is not None:
            self._video.close()


class Pyramid:
    """An image pyramid (mipmap) of a picture that lies on the first frame.

    Args:
        picture: (h, w, 4) premultiplied.
        corners: (4, 2) px of the first frame: its top left, top right, bottom right and bottom left.
    """

    def __init__(self, picture: Image, corners: Array) -> None:
        self._corners = corners
        h, w = picture.shape[:2]
        wide, tall = (max(np.linalg.norm(corners[a] - corners[b]) for a, b in ends) for ends in OPPOSITE)
        most = (max(1, round(FINEST * wide)), max(1, round(FINEST * tall)))
        if w > most[0] or h > most[1]:
            picture = shrunk(picture, (min(w, most[0]), min(h, most[1])))
        self._levels = [picture]
        while max(self._levels[-1].shape[:2]) > 1:
            h, w = self._levels[-1].shape[:2]
            self._levels.append(shrunk(self._levels[-1], (max(1, w // 2), max(1, h // 2))))

    def sampled(self, uv: Floats, cover: Floats) -> Image:
        """The picture (h, w, 4) where the places uv (h, w, 2) of the first frame are seen, as far as covered."""
        level = self._level(uv, cover)
        low, high = int(np.floor(level.min())), int(np.ceil(level.max()))
        seen = self._at_level(low, uv)
        if high > low:
            full = cv2.resize(level, cover.shape[::-1], interpolation=cv2.INTER_LINEAR)
        for k in range(low, high):
            share = np.clip(full - np.float32(k), 0.0, 1.0)
            seen = cast(Image, cv2.blendLinear(seen, self._at_level(k + 1, uv), 1.0 - share, share))
        return seen

    def _at_level(self, level: int, uv: Floats) -> Image:
        picture = self._levels[level]
        places = cv2.perspectiveTransform(uv, self._to_level(level))
        return sampled(picture, cast(Floats, places), cv2.BORDER_CONSTANT)

    def _to_level(self, level: int) -> Array:
        """The homography (3, 3) from the first frame to a level's texels."""
        h, w = self._levels[level].shape[:2]
        return homography(self._corners, np.array(((0, 0), (w, 0), (w, h), (0, h)), float) - 0.5)

    def _level(self, uv: Floats, cover: Floats) -> Floats:
        """The level wanted, on a coarse grid: smooth, so that no step between levels is seen."""
        coarse, inside = uv[::STEP_PX, ::STEP_PX], cover[::STEP_PX, ::STEP_PX] == 1
        texels = cv2.perspectiveTransform(np.ascontiguousarray(coarse), self._to_level(0))
        wanted, known = np.zeros(inside.shape, np.float32), np.zeros(inside.shape, np.float32)
        for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
            step = np.linalg.norm(texels[b] - texels[a], axis=-1) / STEP_PX
            both = inside[a] & inside[b]
            wanted[a] = np.maximum(wanted[a], np.where(both, np.log2(np.maximum(step, 1.0)), 0.0))
            known[a] = np.maximum(known[a], both)
        total = cv2.GaussianBlur(wanted * known, (0, 0), 4.0) / np.maximum(cv2.GaussianBlur(known, (0, 0), 4.0), 1e-3)
        return cast(Floats, np.clip(total - SHARPEN, 0.0, len(self._levels) - 1.0).astype(np.float32))


def shrunk(picture: Image, size: tuple[int, int]) -> Image:
    """The picture in a smaller size (width, height); averaging areas alone would alias fine stripes."""
    factors = (picture.shape[1] / size[0], picture.shape[0] / size[1])
    spread = [SPREAD * factor if factor > 1 else 1e-3 for factor in factors]
    smooth = cv2.GaussianBlur(picture, (0, 0), sigmaX=spread[0], sigmaY=spread[1])
    return cast(Image, cv2.resize(smooth, size, interpolation=cv2.INTER_AREA))


def first_picture(path: Path) -> Image:
    """A picture, or a video's first, as (h, w, 4) premultiplied.

    Raises:
        UsageError: it cannot be read.
    """
    with Texture(path) as texture:
        return texture.at(0.0)


def read_picture(path: Path) -> Image:
    """A picture file as (h, w, 3) BGR or (h, w, 4) with alpha.

    Raises:
        UsageError: it cannot be read.
    """
    try:
        encoded = np.fromfile(path, np.uint8)
    except OSError as error:
        raise UsageError(f"cannot read the texture {path}: {error.strerror}") from error
    picture = cv2.imdecode(encoded, cv2.IMREAD_UNCHANGED) if encoded.size else None
    if picture is not None and (picture.ndim == 2 or picture.shape[2] == 3):  # turned as the camera was held
        picture = cv2.imdecode(encoded, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
    if picture is None:
        raise UsageError(f"the texture {path} is not a picture that can be read: save it as PNG")
    if picture.dtype == np.uint16:
        picture = cv2.convertScaleAbs(picture, alpha=1.0 / 257.0)
    if picture.dtype != np.uint8:
        raise UsageError(f"the texture {path} has {picture.dtype} values: save it as PNG with 8 bits a channel")
    if picture.ndim == 2 or picture.shape[2] == 1:
        picture = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    return cast(Image, picture)


def premultiplied(picture: Image) -> Image:
    """A picture as (h, w, 4): colours multiplied by alpha, so that filtering mixes in no transparent pixels."""
    if picture.shape[2] == 3:
        return cast(Image, cv2.cvtColor(picture, cv2.COLOR_BGR2BGRA))
    alpha = picture[..., 3]
    colours = [cv2.multiply(picture[..., k], alpha, scale=1.0 / 255.0) for k in range(3)]
    return cast(Image, cv2.merge([*colours, alpha]))
