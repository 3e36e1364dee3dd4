"""The pictures of a recording, decoded one at a time: each a JPEG, or the video file as it is."""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import cast

import cv2
import numpy as np

from app.arrays import Image
from app.playback.reading.file import RecordingFile
from app.recording import entities
from app.terminal.errors import UsageError
from tracking import TrackingError
from tracking.video import Video

JPEG = "EncodedImage:blob"
JPEG_TYPE = "EncodedImage:media_type"
VIDEO = "AssetVideo:blob"
VIDEO_TYPE = "AssetVideo:media_type"
SUFFIXES = {"video/webm": ".webm", "video/x-matroska": ".mkv", "video/quicktime": ".mov"}  # else .mp4


def stored_images(file: RecordingFile, frames: list[int]) -> Iterator[tuple[int, Image | None]]:
    """Row and picture (H, W, 3) BGR of each of the source's frames, in their order; None where there is none.

    Raises:
        UsageError: the embedded video cannot be decoded.
    """
    rows = file.rows((entities.IMAGE, JPEG_TYPE), (entities.IMAGE, VIDEO_TYPE))
    videos = rows.last(entities.IMAGE, VIDEO_TYPE)
    if videos:
        media = cast(list[str], next(iter(videos.values())).value)[0]
        return from_video(file, frames, SUFFIXES.get(media, ".mp4"))
    newest = {row.id: frame for frame, row in rows.last(entities.IMAGE, JPEG_TYPE).items()}
    return from_jpegs(file, frames, newest)


def from_jpegs(file: RecordingFile, frames: list[int], newest: dict[bytes, int]) -> Iterator[tuple[int, Image | None]]:
    """Pictures stored one by one; `newest` are the rows that count."""
    there, found = set(newest.values()), jpegs(file, newest)
    waiting: dict[int, bytes] = {}  # still compressed; none as long as the file is in the order of the frames
    for i, frame in enumerate(frames):
        while frame in there and frame not in waiting:
            waiting.update([next(found)])
        blob = waiting.pop(frame, b"")
        yield i, decoded(blob)


def decoded(blob: bytes) -> Image | None:
    """A picture (H, W, 3) BGR; None if it is damaged, or too large for anybody."""
    try:
        return cast(Image | None, cv2.imdecode(np.frombuffer(blob, np.uint8), cv2.IMREAD_COLOR) if blob else None)
    except cv2.error:
        return None


def enlarged(image: Image | None, size: tuple[int, int] | None) -> Image | None:
    """A picture as wide and high as it was, if it was made smaller."""
    if image is None or size is None or image.shape[1::-1] == size:
        return image
    return cast(Image, cv2.resize(image, size, interpolation=cv2.INTER_LINEAR))


def jpegs(file: RecordingFile, newest: dict[bytes, int]) -> Iterator[tuple[int, bytes]]:
    """Frame and JPEG of the rows that count, in the order of the file."""
    for entity, _, rows in file.pieces((entities.IMAGE, JPEG)):
        if entity == entities.IMAGE:
            yield from ((row.frame, cast(bytes, row.value)) for row in rows if row.id in newest)


def from_video(file: RecordingFile, frames: list[int], suffix: str) -> Iterator[tuple[int, Image | None]]:
    """Pictures of the embedded video file: its frames have the numbers that they had in the source."""
    row_of, following = {frame: i for i, frame in enumerate(frames)}, 0
    with TemporaryDirectory() as folder:
        path = Path(folder, f"video{suffix}")
        asset = file.rows((entities.IMAGE, VIDEO))
        try:
            path.write_bytes(cast(bytes, asset.static(entities.IMAGE, VIDEO)))
        except OSError as error:
            raise UsageError(
                f"cannot unpack the video in {file.path} to {folder}: {error.strerror}; free some space"
            ) from error
        del asset
        try:
            with Video(str(path), frames[0], frames[-1] + 1) as video:
                for frame in video:
                    if frame.index not in row_of:
                        continue
                    i = row_of[frame.index]
                    yield from ((missing, None) for missing in range(following, i))
                    yield i, frame.image
                    following = i + 1
        except TrackingError as error:
            raise UsageError(f"the video in {file.path} cannot be decoded: {error}") from error
    yield from ((missing, None) for missing in range(following, len(frames)))
