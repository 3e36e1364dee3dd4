"""Video that OpenCV does not decode is told, with what to do about it."""

from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from tracking import TrackingError
from tracking.capture import interlaced
from tracking.video import Video

INTERLACED_DCT, INTERLACED_MOTION = 1 << 18, 1 << 29


def written(path: Path, *, lines: bool) -> Path:
    rng = np.random.default_rng(0)
    with av.open(str(path), "w") as file:
        stream = file.add_stream("mpeg2video", 25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        if lines:
            stream.codec_context.flags |= INTERLACED_DCT | INTERLACED_MOTION
        for _ in range(5):
            picture = rng.integers(0, 255, (48, 64, 3)).astype(np.uint8)
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        file.mux(stream.encode(None))
    return path


def test_what_cannot_be_decoded_is_told(tmp_path: Path) -> None:
    path = written(tmp_path / "old tape.ts", lines=True)
    assert interlaced(str(path))
    capture = cv2.VideoCapture(str(path))
    first, second = (capture.read()[1] for _ in range(2))
    if not np.array_equal(first, second):
        with Video(str(path)):
            return
    with pytest.raises(TrackingError, match=r"old tape\.ts is interlaced video.*ffmpeg -i '.*old tape\.ts' -vf bwdif"):
        Video(str(path))


def test_others_are_read(tmp_path: Path) -> None:
    path = written(tmp_path / "new.ts", lines=False)
    assert not interlaced(str(path))
    with Video(str(path)) as video:
        assert len(list(video)) == 5
