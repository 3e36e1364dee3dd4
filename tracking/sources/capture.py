"""Opening what frames come from: a file, an image pattern, a camera, or a stream that may break."""

import os
import re
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Protocol, cast

import cv2
import numpy as np

from tracking import Image, TrackingError
from tracking.sources.decoder import Decoder, interlaced
from tracking.sources.images import ImageFiles

Log = Callable[[str], None]

PATIENCE_S = 60.0  # a broken stream is waited for
RETRY_S = 0.5  # between two attempts
MOST_ASPECT, LEAST_ASPECT = 4.0, 0.005  # of pixels: beyond is a mistake, below is rounding
FEW_BITS = 0.01  # a pixel: H.264 of so few has lost most texture; usual videos have 0.05 to 0.2
PROBED = 12  # frames: more than a decoder reorders
TIMEOUT_MS = 5000  # a server that says nothing for so long is gone


class Capture(Protocol):
    """What is needed of a cv2.VideoCapture."""

    def grab(self) -> bool: ...  # noqa: D102
    def retrieve(self) -> tuple[bool, Image]: ...  # noqa: D102
    def get(self, propId: int, /) -> float: ...  # noqa: D102
    def release(self) -> None: ...  # noqa: D102


class Reconnecting:
    """A stream without end that is connected to again when it breaks; reads like a cv2.VideoCapture.

    Args:
        url: its address.
        capture: the stream, open.
        closing: set when nobody wants it any more.
        log: told in words when it breaks and resumes; called in the thread that grabs.
    """

    def __init__(self, url: str, capture: Capture, closing: threading.Event, log: Log) -> None:
        self._url, self._capture, self._closing, self._log = url, capture, closing, log
        self._first: Image | None = None  # its first picture

    def grab(self) -> bool:
        """Go to the next picture; False if the stream never gave one, or stays broken."""
        if self._capture.grab():
            if self._first is None:
                self._first = self._capture.retrieve()[1]
            return True
        if self._first is None or self._closing.is_set():
            return False
        broken = monotonic()
        self._log(f"{self._url} broke: connecting again")
        while not self._closing.wait(RETRY_S) and monotonic() - broken < PATIENCE_S:
            self._capture.release()
            self._capture = open_url(self._url)
            if self._capture.grab():
                again = self._capture.retrieve()[1]
                if again.std() > 0 and np.array_equal(again, self._first):  # a file that does not say how long it is
                    self._capture.release()
                    self._first = None
                    return False
                self._log(f"{self._url} resumed after {monotonic() - broken:.1f} s")
                return True
        if not self._closing.is_set():
            self._log(f"{self._url} did not come back in {PATIENCE_S:.0f} s: ending")
        return False

    def retrieve(self) -> tuple[bool, Image]:
        """Decode the picture gone to."""
        return self._capture.retrieve()

    def get(self, propId: int, /) -> float:
        """A property of the stream as it is now."""
        return self._capture.get(propId)

    def release(self) -> None:
        """Disconnect."""
        self._capture.release()


class SquarePixels:
    """A video whose pixels are not square, stretched as players show it; reads like a cv2.VideoCapture.

    Args:
        capture: the video.
        aspect: width of a pixel over its height.
    """

    def __init__(self, capture: Capture, aspect: float) -> None:
        self._capture, self._wider, self._higher = capture, max(aspect, 1.0), max(1.0 / aspect, 1.0)
        self.grab, self.get, self.release = capture.grab, capture.get, capture.release

    def retrieve(self) -> tuple[bool, Image]:
        """Decode the picture gone to."""
        ok, image = self._capture.retrieve()
        return ok, self.stretched(image) if ok and image is not None and image.size else image

    def stretched(self, image: Image) -> Image:
        """A picture with square pixels: larger, so that nothing is lost."""
        size = round(image.shape[1] * self._wider), round(image.shape[0] * self._higher)
        return cast(Image, cv2.resize(image, size, interpolation=cv2.INTER_CUBIC))


def pixel_aspect(capture: Capture) -> float:
    """Width of a video's pixels over their height; 1 where it does not say, or what nobody believes."""
    wide, high = capture.get(cv2.CAP_PROP_SAR_NUM), capture.get(cv2.CAP_PROP_SAR_DEN)
    aspect = wide / high if wide > 0 and high > 0 else 1.0
    if capture.get(cv2.CAP_PROP_ORIENTATION_META) % 180 == 90:  # pictures come upright, their pixels as they are stored
        aspect = 1 / aspect
    return aspect if 1 / MOST_ASPECT < aspect < MOST_ASPECT else 1.0


def bits_per_px(capture: Capture) -> float | None:
    """What a video's encoder spends on a pixel; None where it does not say."""
    size, fps = (
        [capture.get(side) for side in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)],
        capture.get(cv2.CAP_PROP_FPS),
    )
    bits, pixels = 1000 * capture.get(cv2.CAP_PROP_BITRATE), size[0] * size[1] * fps
    return bits / pixels if bits > 0 and pixels > 0 else None


def few_bits(source: str) -> float | None:
    """Bits that a file spends on a pixel, if they are so few that hardly any texture is left; else None."""
    if not Path(source).is_file():
        return None
    capture = cv2.VideoCapture(source)
    bits = few_bits_of(cast(Capture, capture)) if capture.isOpened() else None
    capture.release()
    return bits


def few_bits_of(capture: Capture) -> float | None:
    """The same of an open video."""
    bits = bits_per_px(capture)
    return bits if bits is not None and bits < FEW_BITS else None


def squared(capture: Capture, source: str, log: Log) -> Capture:
    """A capture of square pixels; `log` is told where the video's are not."""
    aspect = pixel_aspect(capture)
    if abs(aspect - 1) < LEAST_ASPECT:
        return capture
    log(f"the pixels of {source} are {aspect:.3g} times as wide as high: it is read with square ones, as players show it")
    return SquarePixels(capture, aspect)


def open_capture(source: str, closing: threading.Event, log: Log, *, decodes: bool) -> Capture:
    """Open a source; `closing` and `log` as for `Reconnecting`, `decodes`, of a file, whether OpenCV does.

    Raises:
        TrackingError: it is missing or cannot be decoded.
    """
    if is_camera(source):
        camera = cv2.VideoCapture(int(source))
        if not camera.isOpened():
            raise TrackingError(f"camera {source} cannot be opened; is it connected, and free of other programs?")
        return cast(Capture, camera)
    if "://" in source:
        capture = open_url(source)
        if not cast(cv2.VideoCapture, capture).isOpened():
            raise TrackingError(
                f"{source} cannot be decoded; check the address, or download it: its server may not serve parts of files"
            )
        return squared(capture, source, log) if announced_frames(capture) else Reconnecting(source, capture, closing, log)
    path = Path(source)
    if re.search(r"%0?\d*d", source) and not path.exists():
        return ImageFiles(source, log)
    if path.is_dir():
        raise TrackingError(f"{source} is a folder; give the images in it by a pattern, as {source}/img%04d.png")
    if not path.is_file():
        raise TrackingError(f"no video file {source}; check the path")
    if not os.access(path, os.R_OK):
        raise TrackingError(f"{source} cannot be read: permission denied")
    file = cast(Capture, cv2.VideoCapture(source)) if decodes else Decoder(source)
    if (bits := few_bits_of(file)) is not None:
        log(f"{source} is compressed to {bits:.2g} bits a pixel: little texture is left to follow; export it with more")
    return squared(file, source, log)


@dataclass(frozen=True)
class Probe:
    """What the first frames of a file show.

    Attributes:
        decodes: whether OpenCV makes pictures of them: it may lack the decoder, and of some interlaced video it gives the
            same memory again and again.
        times_rise: of some it tells them in the decoder's order.
    """

    decodes: bool
    times_rise: bool


def probe(source: str) -> Probe:
    """Look at the first frames of a file."""
    capture = cv2.VideoCapture(source)
    times: list[float] = []
    pictures: list[Image] = []
    while len(times) < PROBED and capture.grab():
        times.append(capture.get(cv2.CAP_PROP_POS_MSEC))
        if len(pictures) < 2:
            ok, picture = capture.retrieve()
            pictures += [cast(Image, picture)] if ok else []
    capture.release()
    alike = len(pictures) == 2 and np.array_equal(pictures[0], pictures[1])
    return Probe(bool(pictures) and not (alike and interlaced(source)), bool((np.diff(times) > 0).all()))


def is_camera(source: str) -> bool:
    """Whether a source is the index of a camera."""
    return re.fullmatch(r"[0-9]{1,9}", source) is not None


def open_url(url: str) -> Capture:
    """A capture that gives up on a silent server; open or not."""
    limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, TIMEOUT_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, TIMEOUT_MS]
    return cast(Capture, cv2.VideoCapture(url, cv2.CAP_FFMPEG, limits))


def announced_frames(capture: Capture) -> int | None:
    """The number of frames a source says it has; None where it does not say."""
    announced = capture.get(cv2.CAP_PROP_FRAME_COUNT)
    return int(announced) if 0 < announced < 2**31 else None


def as_bgr(image: Image) -> Image:
    """The picture as (H, W, 3) uint8, whatever depth and channels the decoder gave."""
    if image.dtype != np.uint8:
        image = cast(Image, cv2.convertScaleAbs(image, alpha=1.0 / 256.0 if image.dtype == np.uint16 else 1.0))
    if image.ndim == 2 or image.shape[2] == 1:
        return cast(Image, cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    if image.shape[2] == 4:
        return cast(Image, cv2.cvtColor(image, cv2.COLOR_BGRA2BGR))
    return image
