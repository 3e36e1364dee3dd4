"""What a run begins with: the surface in the first frames, unless the region is to be taken as it is given."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import cast

import cv2

from app.arrays import Image
from app.pipeline.stages.messages import Footage
from app.pipeline.stages.working_copy import SIDE_PX, WorkingCopy
from tracking.region.mask import region_mask
from tracking.region.search import Found, search
from tracking.region.surface import Surface
from tracking.video import Frame, Video

MOST_BYTES = 300 * 2**20  # of the first pictures that are kept while the surface is looked for: all it takes of full HD
PLAIN_PX = 1280  # of the width; wider ones are kept as videos have them, with half of the colours across and down
LEADING = 10  # of those, when late ones are left out, lead from the first to the newest


@dataclass(frozen=True)
class FirstLook:
    """Where to begin.

    Attributes:
        frames: the frames of the run.
        video: that gives them: another one if they are read again.
        region: (H, W) uint8, 255 where the surface is in the first of them.
        notes: what was found and how to overrule it, a line each.
    """

    frames: Iterator[Frame]
    video: Video
    region: Image
    notes: list[str]


def first_look(footage: Footage, video: Video) -> FirstLook:
    """Look for the surface in the first frames of a video, which are kept meanwhile, or read again if too large.

    Raises:
        TrackingError: no frame with texture, or a region or mask that does not fit the picture.
    """
    copy, region = WorkingCopy.of(footage, video.size), region_mask(video.size, footage.roi, footage.mask, footage.outline)
    frames: Iterator[Frame] = map(copy.keep, video)
    if not footage.search or footage.outline is not None:  # drawn by hand
        return FirstLook(frames, video, region, [])
    kept = deque[Frame]()
    small = WorkingCopy(video.size, large_px=2 * SIDE_PX)  # however large the pictures are that points are followed in
    found = small.found(search(copies(keeping(frames, kept, ends=video.live), small), small.picture(region)))
    if footage.drop_late:
        kept = deque(frame for frame in kept if frame.index >= found.first.index)
        kept = deque(list(kept)[:: len(kept) // LEADING + 1])
    notes = notes_on(found, video.first_index)
    if not kept:
        video.close()
        video = Video(footage.source, *footage.frame_range, duration_s=footage.duration)
    frames = chain(emptied(kept), frames) if kept else map(copy.keep, video)
    begun = next(frame for frame in frames if frame.index >= found.first.index)
    return FirstLook(chain([begun], frames), video, found.region, notes)


def keeping(frames: Iterator[Frame], kept: deque[Frame], *, ends: bool) -> Iterator[Frame]:
    """The frames, kept as they come; when they fill the memory there is for them, they end, or none are kept."""
    full = False
    for count, frame in enumerate(frames, 1):
        if not full:
            kept.append(replace(frame, image=pack(frame.image)))
            full = count * kept[-1].image.nbytes > MOST_BYTES
            if full and not ends:
                kept.clear()
        yield frame
        if full and ends:
            return


def emptied(kept: deque[Frame]) -> Iterator[Frame]:
    """The frames; what has been taken is kept no more."""
    while kept:
        frame = kept.popleft()
        yield replace(frame, image=unpack(frame.image))


def pack(image: Image) -> Image:
    """A picture (H, W, 3) BGR in half the memory, if it is large: (3 H / 2, W)."""
    if image.shape[1] <= PLAIN_PX or image.shape[0] % 2 or image.shape[1] % 2:
        return image
    return cast(Image, cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420))


def unpack(image: Image) -> Image:
    """The picture (H, W, 3) BGR again."""
    return image if image.ndim == 3 else cast(Image, cv2.cvtColor(image, cv2.COLOR_YUV2BGR_I420))


def copies(frames: Iterable[Frame], copy: WorkingCopy) -> Iterator[Frame]:
    """The frames with smaller pictures, if those are large."""
    return (replace(frame, image=copy.picture(frame.image)) for frame in frames)


def notes_on(found: Found, began: int) -> list[str]:
    """What was found, in words, a line each; nothing where the region is taken as it was given.

    Args:
        found: that.
        began: number of the first frame looked at.
    """
    blank = found.first.index - began
    past = f"the first {blank} frames show nothing to follow, or what is soon gone: begins with frame {found.first.index}"
    notes = [past] if blank else []
    if found.surface is None:
        still = f"no surface is seen to move in {found.frames} frames: the whole region is taken; choose by --roi X Y W H"
        return [*notes, still]
    if not found.narrowed:
        return notes
    note = f"surface found by what moves together in {found.frames} frames: {as_roi(found.surface)}"
    if found.others:
        note += f"; others: {', '.join(as_roi(other) for other in found.others)}"
    return [*notes, f"{note}; choose by --roi X Y W H, --no-search takes it as it is"]


def as_roi(surface: Surface) -> str:
    """The option that stands for a surface."""
    return "--roi " + " ".join(map(str, surface.box))
