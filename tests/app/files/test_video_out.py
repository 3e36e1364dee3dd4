"""Videos keep the times of their frames."""

from io import BytesIO
from pathlib import Path

import av
import numpy as np
import pytest
from av.bitstream import BitStreamFilterContext
from numpy.typing import NDArray

from app.files.video_out import usual_fps, writable_video
from app.terminal.errors import UsageError
from tracking.video import Video

Image = NDArray[np.uint8]
Floats = NDArray[np.float64]


@pytest.mark.parametrize("ending", ["mp4", "webm"])
def test_every_frame_is_written_once_and_keeps_its_time(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"uneven.{ending}"
    shown = [(40, 5.0), (90, 5.1), (140, 5.4), (150, 5.41), (190, 7205.5)]
    with writable_video(path, (64, 48), 10.0) as sink:
        for level, time_s in shown:
            sink.write(np.full((48, 64, 3), level, np.uint8), time_s)
    with av.open(str(path)) as file:
        frames = list(file.decode(video=0))
    assert [frame.time for frame in frames] == pytest.approx([time_s - 5.0 for _, time_s in shown], abs=2e-3)
    levels = [frame.to_ndarray(format="gray").mean() for frame in frames]
    assert np.abs(np.array(levels) - [level for level, _ in shown]).max() < 5


def test_times_that_do_not_rise_go_on_at_the_usual_rate(tmp_path: Path) -> None:
    path = tmp_path / "standing.mp4"
    with writable_video(path, (63, 49), 20.0) as sink:
        for time_s in (1.0, 1.05, 1.05, 1.0, 1.3):
            sink.write(np.zeros((49, 63, 3), np.uint8), time_s)
    with Video(str(path)) as video:
        assert [frame.time_s for frame in video] == pytest.approx([0, 0.05, 0.1, 0.15, 0.3], abs=1e-3)
        assert video.size == (62, 48)


def test_pictures_tell_their_rate_to_who_decodes_them_without_the_file(tmp_path: Path) -> None:
    """Rerun's viewer does, with FFmpeg's program: by the ticks of the times, 90,000 a second, it shows none."""
    path = tmp_path / "bare.mp4"
    with writable_video(path, (64, 48), 20.0) as sink:
        for k in range(30):
            sink.write(np.full((48, 64, 3), 5 * k, np.uint8), k / 20)
    with av.open(str(path)) as file:
        bare = BitStreamFilterContext("h264_mp4toannexb", file.streams.video[0])
        stream = b"".join(bytes(one) for packet in file.demux(video=0) for one in bare.filter(packet))
    with av.open(BytesIO(stream), format="h264") as file:
        next(file.decode(video=0))
        assert file.streams.video[0].codec_context.framerate == 20


def test_a_video_without_frames_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"cannot write .*empty\.webm: there is no frame"), \
         writable_video(tmp_path / "empty.webm", (64, 48), 10.0):  # fmt: skip
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("times", "fps"), [([0, 0.1, 0.2, 0.3], 10), ([5, 5.1, 5.2, 5.5, 5.6], 10), ([2.0], 25), ([0, 0, 0], 25)]
)
def test_the_usual_rate(times: list[float], fps: float) -> None:
    assert usual_fps(np.array(times, float)) == pytest.approx(fps)
