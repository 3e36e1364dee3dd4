"""Pictures as a recording stores them: frames as JPEG, the video file as it is, the mesh's texture."""

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, cast

import cv2
import numpy as np
import rerun as rr

from app.arrays import Array, Image, Indices
from app.recording.columns import Values
from app.terminal.errors import UsageError
from tracking.sources.capture import Capture, pixel_aspect
from tracking.video import Video

JPEG_QUALITY = 75  # of a video that was compressed before; 85 looks the same and takes 1.4 times as much


def reduced(size: tuple[int, int], width: int | None) -> tuple[int, int]:
    """The (width, height) of pictures of a size, no wider than a width."""
    width = min(size[0], width or size[0])
    return width, max(round(size[1] * width / size[0]), 1)


def jpeg(image: Image, size: tuple[int, int]) -> dict[str, Values]:
    """An image (H, W, 3) BGR, compressed, of another (width, height): a row of an EncodedImage."""
    if size != image.shape[1::-1]:
        image = cast(Image, cv2.resize(image, size, interpolation=cv2.INTER_AREA))
    encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    return {"blob": rr.components.BlobBatch([encoded.tobytes()]).as_arrow_array(), "media_type": ["image/jpeg"]}


def embedded_video(video: Path | None) -> tuple[rr.AssetVideo, Indices]:
    """A video file, and its frames' time stamps (F,) in nanoseconds.

    The file as it is; where it says that its pictures are to be turned, or its pixels not square, which viewers do not
    know, a copy that is.

    Raises:
        UsageError: not a file, or not a container and codec that Rerun knows.
    """
    if video is None or not video.is_file():
        raise UsageError("--image video needs a video file as the source: use --image jpeg")
    try:
        asset = rr.AssetVideo(path=video) if as_it_is(video) else upright(video)
        return asset, np.sort(np.asarray(asset.read_frame_timestamps_nanos(), np.int64))
    except (RuntimeError, ValueError, OSError) as error:
        raise UsageError(f"--image video cannot store {video} ({error}): use --image jpeg") from error


def as_it_is(video: Path) -> bool:
    """Whether a video's pictures are shown as they are stored."""
    capture = cv2.VideoCapture(str(video))
    try:
        return capture.get(cv2.CAP_PROP_ORIENTATION_META) % 360 == 0 and pixel_aspect(cast(Capture, capture)) == 1
    finally:
        capture.release()


def upright(video: Path) -> rr.AssetVideo:
    """A copy of a video with its pictures as they are to be shown."""
    from app.files.video_out import VideoSink, writable_video  # PyAV takes its time to load

    with TemporaryDirectory() as folder, ExitStack() as files:
        copy = Path(folder) / "upright.mp4"
        frames = files.enter_context(Video(str(video)))
        sink: VideoSink | None = None
        for frame in frames:
            sink = sink or files.enter_context(writable_video(copy, frame.image.shape[1::-1], frames.fps))
            sink.write(frame.image, frame.time_s)
        files.close()
        return rr.AssetVideo(contents=copy.read_bytes(), media_type="video/mp4")


def cropped(image: Image, points_px: Array) -> tuple[Image, Indices]:
    """The part of an image (H, W, 3) that points (p, 2) cover, 2 px wider, and its origin (2,) there."""
    size = np.array(image.shape[1::-1])
    low = np.clip(np.floor(points_px.min(axis=0)).astype(np.int64) - 2, 0, size - 1)
    high = np.clip(np.ceil(points_px.max(axis=0)).astype(np.int64) + 3, low + 1, size)
    return image[low[1] : high[1], low[0] : high[0]], low


def texture(crop: Image, points_px: Array, faces: Indices) -> rr.Mesh3D:
    """Triangles (m, 3) and their texture, of an image (h, w, 3) BGR and the vertices' pixels (p, 2) in it."""
    height, width = crop.shape[:2]
    model: Literal["RGB"] = "RGB"
    return rr.Mesh3D.from_fields(
        triangle_indices=faces.astype(np.uint32),
        # Without normals the viewer does not light the mesh: the texture keeps its colours, from both sides.
        vertex_texcoords=((points_px + 0.5) / (width, height)).astype(np.float32),  # pixel centres are at .5 there
        albedo_texture_buffer=cv2.cvtColor(crop, cv2.COLOR_BGR2RGB).tobytes(),
        albedo_texture_format=rr.components.ImageFormat(width, height, color_model=model, channel_datatype="U8"),
    )
