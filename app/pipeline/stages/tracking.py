"""The stage that reads the source and follows points in it."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from app.arrays import Array, Image
from app.files.on_disk import OnDisk
from app.pipeline.stages.first_look import first_look
from app.pipeline.stages.messages import RECOVERED, Asked, Begun, Footage, Opened, Seen
from app.pipeline.stages.working_copy import WorkingCopy
from reconstruction.camera import Camera
from tracking import TrackingError
from tracking.features import detect_corners
from tracking.guarded import Change, Guarded, GuardedTracker
from tracking.region.mask import outline, region_mask
from tracking.region.search import Search
from tracking.video import Frame, Video


class TrackingStage:
    """From what is asked to what is seen, frame by frame.

    Args:
        footage: source, region and number of points.

    Raises:
        TrackingError: the source cannot be read.
    """

    def __init__(self, footage: Footage) -> None:
        self._footage = footage
        self._told: list[str] = []
        self.video = Video(
            footage.source,
            *footage.frame_range,
            duration_s=footage.duration,
            drop_late=footage.drop_late,
            log=self._told.append,
        )
        self._copy = WorkingCopy.of(footage, self.video.size)
        if self._copy.factor > 1:
            followed, kept = ("{}x{}".format(*size) for size in (self._copy.size, self._copy.kept))
            self._told.append(f"pictures are kept at {kept} px, points followed at {followed}: --full-size takes all")
        self._frames: Iterator[Frame] | None = None
        self._trackers: dict[int, GuardedTracker] = {}
        self._region: Image | None = None  # where the next object begins, if that is known
        self._search: Search | None = None  # for that
        self._resting: dict[int, OnDisk[GuardedTracker]] = {}  # of objects that were followed before: 6 MB each
        self._number = 0

    @property
    def opened(self) -> Opened:
        """What is known before the first frame."""
        return Opened(self.video.size, self._copy.kept, self.video.fps, self.video.frame_count)

    def next(self, asked: Asked, keep: Callable[[int, Image], None]) -> Seen | None:
        """The next frame; None at the end of the source. `keep` takes its number and picture before it is looked at.

        Raises:
            UsageError, TrackingError: the source breaks off, or a region, mask or mesh does not fit the picture.
        """
        if self._frames is None:
            look = first_look(self._footage, self.video)
            self._frames, self._region, self.video = look.frames, look.region, look.video
            self._told += look.notes
        began = perf_counter()
        frame = next(self._frames, None)
        if frame is None:
            return None
        keep(self._number, frame.image)
        decoded, read_s = perf_counter(), self.video.arrived_s(frame)
        wanted = {*asked.expected_px, *asked.kept}
        self._trackers = {one: tracker for one, tracker in self._trackers.items() if one in wanted}
        self._resting = {one: tracker for one, tracker in self._resting.items() if one in asked.kept}
        image = self._copy.picture(frame.image)
        if all(one in self._trackers for one in asked.expected_px):
            self._search = None
        objects = {
            one: found
            for one, expected in asked.expected_px.items()
            if (found := self._object(one, frame.index, image, expected)) is not None
        }
        objects |= {one: found for one in asked.kept if (found := self._earlier(one, image, sought=one == asked.sought))}
        tracked = perf_counter()
        told = tuple(self._told)
        del self._told[: len(told)]  # another thread may be adding
        milliseconds = {"decode": 1e3 * (decoded - began), "track": 1e3 * (tracked - decoded)}
        self._number += 1
        return Seen(self._number - 1, frame.index, frame.time_s, read_s, objects, told, milliseconds)

    def _earlier(self, one: int, image: Image, *, sought: bool) -> Guarded | None:
        """An object that was followed before, in the (copy of the) picture; None if nobody looks for it."""
        tracker = self._trackers.get(one)
        if tracker is not None and not tracker.lost:
            return self._copy.guarded(tracker.track(image))
        if tracker is not None:
            self._resting[one] = OnDisk[GuardedTracker]()
            self._resting[one].add(one, self._trackers.pop(one))
        if not sought:
            return None
        tracker = self._resting[one][one]
        found = self._copy.guarded(tracker.seek(image))
        if not tracker.lost:
            self._trackers[one] = tracker
        return found

    def _object(
        self, one: int, index: int, image: Image, expected_px: Array | None
    ) -> Begun | Guarded | TrackingError | None:
        """One of the objects in the (copy of the) picture of a frame of that index; None while it is looked for."""
        if one in self._trackers:
            expected = None if expected_px is None else self._copy.points(expected_px)
            guarded = self._copy.guarded(self._trackers[one].track(image, expected))
            if guarded.change is Change.NONE and guarded.reason:
                self._told.append(f"frame {index}: {guarded.reason}")
            return guarded
        try:
            region = self._looked_for(image) if self._region is None else self._region
            if region is None:
                return None
            footage = replace(self._footage, rest_shape="auto") if one else self._footage  # a mesh is the first one's
            points_px = first_points(footage, image, region, self._copy)
        except TrackingError as error:
            self._search = None
            return error
        self._region = None
        self._trackers[one] = GuardedTracker(image, self._copy.points(points_px))
        return Begun(points_px, outline(region))

    def _looked_for(self, image: Image) -> Image | None:
        """Where in the (copy of the) picture another object is, by what has moved since the first look; None until then.

        Raises:
            TrackingError: there are too few corners, or nothing moves.
        """
        given = self._footage
        region = region_mask(self.video.size, given.roi, given.mask, given.outline)  # it may be anywhere in it
        if not given.search or given.outline is not None:
            return region
        if self._search is None or not self._search.add(image):
            self._search = Search(image, self._copy.picture(region))
        if not self._search.enough:
            return None
        search, self._search = self._search, None
        return self._copy.region(search.region_now())


def first_points(footage: Footage, image: Image, region: Image, copy: WorkingCopy) -> Array:
    """The points (P, 2) px of an object that begins in a picture, by its copy, in a region (H, W) uint8 of the picture.

    Raises:
        UsageError, TrackingError: a mesh that does not fit the picture, or too few corners.
    """
    gray = cast(NDArray[np.uint8], cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
    points_px = copy.in_picture(detect_corners(gray, copy.picture(region), footage.points))
    if footage.rest_shape in RECOVERED:
        return points_px
    from app.files.mesh_file import rest_of_surface  # trimesh takes its time to load

    return points_px[rest_of_surface(Path(footage.rest_shape), points_px, Camera())[1]]
