"""Sources that cannot be opened are named, and OpenCV is silent."""

import re
import struct
import subprocess
import sys
import threading
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from tests.tracking.scene import texture
from tracking import TrackingError
from tracking.sources.capture import Reconnecting, pixel_aspect, probe
from tracking.sources.decoder import Decoder
from tracking.video import Frame, Video

AV1 = Path(__file__).with_name("data") / "av1.mp4"


def frames(source: Path, first: int = 0, stop: int | None = None) -> list[Frame]:
    with Video(str(source), first, stop) as video:
        return list(video)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("missing.mp4", None, "no video file {}; check the path"),
        ("text.mp4", b"this is not a video\n" * 9, "{} cannot be decoded"),
        ("empty.mp4", b"", "{} cannot be decoded"),
        ("img%04d.png", None, "no image file matches {}"),
        ("nowhere/img%04d.png", None, "no image file matches {}"),
    ],
)
def test_names_a_source_that_cannot_be_read(tmp_path: Path, name: str, content: bytes | None, says: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(TrackingError, match=re.escape(says.format(path))) as error:
        Video(str(path))
    assert "\n" not in str(error.value)


def test_av1_is_read() -> None:
    """The FFmpeg in OpenCV 5.0.0's wheel has no AV1 decoder, the one in 4.14.0's has, and so has PyAV's."""
    found = frames(AV1)
    assert [f.index for f in found] == [0, 1]
    assert abs(float(found[1].image.mean()) - 128) < 3


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
def test_both_decoders_give_the_same(tmp_path: Path, turn: int) -> None:
    path = encoded(tmp_path / "plain.mp4")
    turned = tmp_path / "turned.mp4"
    turned.write_bytes(with_rotation(path.read_bytes(), turn))
    capture, decoder = cv2.VideoCapture(str(turned)), Decoder(str(turned))
    for name in ("POS_MSEC", "FPS", "FRAME_COUNT", "SAR_NUM", "SAR_DEN", "BITRATE"):
        assert decoder.get(getattr(cv2, f"CAP_PROP_{name}")) == capture.get(getattr(cv2, f"CAP_PROP_{name}"))
    for _ in range(3):
        assert capture.grab()
        assert decoder.grab()
        assert decoder.get(cv2.CAP_PROP_POS_MSEC) == pytest.approx(capture.get(cv2.CAP_PROP_POS_MSEC))
        one, other = capture.retrieve()[1], decoder.retrieve()[1]
        assert one.shape == other.shape
        assert np.abs(one.astype(int) - other).mean() < 3
    decoder.release()


def with_rotation(file: bytes, degrees: int) -> bytes:
    """An MP4 file that is shown turned clockwise: the matrix in its track's header."""
    at = file.index(b"tkhd") + 4 + 40  # past version, times, number, duration, layer and volume
    c, s = round(np.cos(np.deg2rad(degrees))), round(np.sin(np.deg2rad(degrees)))
    matrix = struct.pack(">9i", c << 16, s << 16, 0, -s << 16, c << 16, 0, 0, 0, 1 << 30)
    return file[:at] + matrix + file[at + 36 :]


def test_a_folder_and_an_absent_camera(tmp_path: Path) -> None:
    with pytest.raises(TrackingError, match="is a folder"):
        Video(str(tmp_path))
    with pytest.raises(TrackingError, match="camera 97 cannot be opened"):
        Video("97")


def test_opencv_keeps_quiet(tmp_path: Path) -> None:
    (tmp_path / "text.mp4").write_text("no video")
    code = (
        "import sys\nfrom tracking import TrackingError\nfrom tracking.video import Video\n"
        "for source in sys.argv[1:]:\n"
        "    try:\n        Video(source)\n    except TrackingError:\n        pass\n"
    )
    command = [sys.executable, "-c", code, str(AV1), str(tmp_path / "text.mp4"), "97"]
    done = subprocess.run(command, cwd=Path(__file__).parents[3], capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""


def test_times_in_the_decoder_s_order_are_not_believed(shared_data: Path) -> None:
    assert probe(str(shared_data / "kinect_paper.mp4")).times_rise
    assert not probe(str(shared_data / "box.mp4")).times_rise
    with Video(str(shared_data / "box.mp4"), stop=40) as video:
        assert [frame.time_s for frame in video] == pytest.approx([k / video.fps for k in range(40)])


def encoded(path: Path, pixel_aspect: Fraction = Fraction(1), bit_rate: int | None = None, *, moving: bool = False) -> Path:
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", 30)
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        stream.codec_context.sample_aspect_ratio = pixel_aspect
        if bit_rate:
            stream.bit_rate = bit_rate
        for k in range(30):
            picture = np.roll(texture(), 3 * k if moving else 0, axis=1)
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        file.mux(stream.encode(None))
    return path


@pytest.mark.parametrize(("aspect", "size"), [((4, 3), (427, 240)), ((8, 9), (320, 270)), ((1, 1), (320, 240))])
def test_pixels_are_read_square(tmp_path: Path, aspect: tuple[int, int], size: tuple[int, int]) -> None:
    told: list[str] = []
    with Video(str(encoded(tmp_path / "wide.mp4", Fraction(*aspect))), log=told.append) as video:
        assert video.size == size
        assert {frame.image.shape[1::-1] for frame in video} == {size}
    assert ["times as wide as high" in line for line in told] == [True] * (aspect != (1, 1))


def test_a_poor_bit_rate_is_told(tmp_path: Path) -> None:
    told: list[str] = []
    Video(str(encoded(tmp_path / "poor.mp4", bit_rate=5_000)), log=told.append).close()
    assert "bits a pixel" in "".join(told)
    Video(str(encoded(tmp_path / "usual.mp4"))).close()
    assert len(told) == 1


@pytest.mark.parametrize("turn", [90, 270])
def test_pixels_of_an_upright_video_are_stretched_the_other_way(tmp_path: Path, turn: int) -> None:
    turned = tmp_path / "turned.mp4"
    turned.write_bytes(with_rotation(encoded(tmp_path / "wide.mp4", Fraction(4, 3)).read_bytes(), turn))
    with Video(str(turned)) as video:
        assert video.size == (240, 427)
    assert pixel_aspect(Decoder(str(turned))) == pytest.approx(3 / 4)


def test_a_damaged_packet_costs_its_own_frames_alone(tmp_path: Path) -> None:
    path = tmp_path / "damaged.mp4"
    encoded(path, moving=True)
    with av.open(str(path)) as file:
        at, size = next((packet.pos, packet.size) for k, packet in enumerate(file.demux(video=0)) if k == 9)
    data = bytearray(path.read_bytes())
    data[at : at + size] = bytes(size)
    path.write_bytes(data)
    decoder = Decoder(str(path))
    assert sum(decoder.grab() for _ in range(40)) > 20


class Repeated:
    """A stream of three pictures that is as new whenever it is opened."""

    def __init__(self) -> None:
        self.gone = 0

    def grab(self) -> bool:
        self.gone += 1
        return self.gone <= 3

    def retrieve(self) -> tuple[bool, np.ndarray]:
        return True, texture(seed=self.gone)

    def get(self, propId: int, /) -> float:
        raise NotImplementedError(propId)

    def release(self) -> None:
        self.gone = 9


def test_a_file_from_a_server_that_tells_no_length_is_not_shown_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tracking.sources.capture.open_url", lambda _: Repeated())
    monkeypatch.setattr("tracking.sources.capture.RETRY_S", 0.0)
    stream = Reconnecting("http://here/film.webm", Repeated(), threading.Event(), lambda _: None)
    assert [stream.grab() for _ in range(5)] == [True] * 3 + [False] * 2
