"""Writing pictures: an H.264 file, or numbered images."""

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np

from app.arrays import Image

FPS = 30


@dataclass(frozen=True)
class Storage:
    """How pictures are kept.

    Attributes:
        bit_rate: of H.264, bits a second; None for hardly any loss.
        pixel_aspect: width of a pixel over its height.
        left_out: the numbers of images that are missing; with any, images are written instead of a video.
    """

    bit_rate: int | None = None
    pixel_aspect: Fraction = Fraction(1)
    left_out: tuple[int, ...] = ()

    def write(self, folder: Path, pictures: Iterable[Image]) -> str:
        """Write them to a folder; what they are read by, a file or a pattern."""
        if self.left_out:
            pattern = folder / "img%04d.jpg"
            for number, picture in enumerate(pictures):
                if number not in self.left_out:
                    cv2.imwrite(pattern.as_posix() % number, picture, [cv2.IMWRITE_JPEG_QUALITY, 97])
            return str(pattern)
        path = folder / "clip.mp4"
        with av.open(str(path), "w") as file:
            stream: av.VideoStream | None = None
            for picture in pictures:
                if stream is None:
                    stream = self._stream(file, picture)
                file.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")))
            if stream is not None:
                file.mux(stream.encode(None))
        return str(path)

    def _stream(self, file: av.container.OutputContainer, picture: Image) -> av.VideoStream:
        options = {"preset": "veryfast"} | ({} if self.bit_rate else {"crf": "8"})
        stream = file.add_stream("libx264", FPS, options=options)
        stream.height, stream.width = picture.shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.codec_context.sample_aspect_ratio = self.pixel_aspect
        if self.bit_rate:
            stream.bit_rate = self.bit_rate
        return stream
