"""Interlaced video, which OpenCV does not decode."""

from pathlib import Path

import av
import numpy as np
import pytest

from tracking.sources.decoder import Decoder, interlaced
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


def test_interlaced_video_is_read_and_its_combs_are_gone(tmp_path: Path) -> None:
    path = written(tmp_path / "old tape.ts", lines=True)
    assert interlaced(str(path))
    with Video(str(path)) as video:
        frames = list(video)
    assert len(frames) == 5
    assert not np.array_equal(frames[0].image, frames[1].image)


def test_lines_in_between_are_reckoned_anew(tmp_path: Path) -> None:
    """A bar that moves between the two fields of a frame is combed as it is stored."""
    path = tmp_path / "bar.ts"
    with av.open(str(path), "w") as file:
        stream = file.add_stream("mpeg2video", 25)
        stream.width, stream.height, stream.pix_fmt, stream.bit_rate = 128, 96, "yuv420p", 4_000_000
        stream.codec_context.flags |= INTERLACED_DCT | INTERLACED_MOTION
        for k in range(8):
            picture = np.full((96, 128, 3), 40, np.uint8)
            for field in (0, 1):
                at = 8 + 10 * k + 5 * field
                picture[field::2, at : at + 20] = 220
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        file.mux(stream.encode(None))
    with av.open(str(path)) as file:
        combed = [comb(frame.to_ndarray(format="gray8")) for frame in file.decode(video=0)]
    decoder = Decoder(str(path))
    smooth = []
    while decoder.grab():
        smooth.append(comb(decoder.retrieve()[1][:, :, 0]))
    assert len(smooth) == 8
    assert np.mean(smooth) < 0.5 * np.mean(combed)


def comb(gray: np.ndarray) -> float:
    """How much lines differ from those next but one."""
    lines = gray.astype(float)
    return float(np.abs(2 * lines[1:-1] - lines[:-2] - lines[2:]).mean())


def test_others_are_read(tmp_path: Path) -> None:
    path = written(tmp_path / "new.ts", lines=False)
    assert not interlaced(str(path))
    with Video(str(path)) as video:
        assert len(list(video)) == 5


def test_times_begin_at_0_whatever_clock_the_stream_has(tmp_path: Path) -> None:
    """That of a transport stream begins at 1.4 s."""
    with Video(str(written(tmp_path / "tape.ts", lines=True))) as video:
        assert [frame.time_s for frame in video] == pytest.approx([0.0, 0.04, 0.08, 0.12, 0.16])
