"""The search for the surface in the first frames: points of the whole region are followed until enough has moved."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from tracking import Array, Flags, Image, TrackingError
from tracking.features import detect_corners
from tracking.flow import CONVERGED_PX, FEW_GUIDES, WINDOW_PX, Grays, levels_of, lucas_kanade, returned
from tracking.region.background import AGREED, STILL_PX, by_first_camera
from tracking.region.border import at_colours, inset
from tracking.region.groups import TENTH
from tracking.region.surface import FAR_ENOUGH, Surface, middling, surfaces
from tracking.video import Frame

MOST_FRAMES = 90  # are looked at
LEAST_FRAMES = 6  # the same: a thing that rushes in is blurred, and one motion or two tell hardly what moves together
MIDDLE = 0.5  # of a region that was drawn: nearer to its middle than to its border
SEEN = 0.5  # of the points: fewer left say nothing of the others, or it is another picture
CLEARER = 2.0  # times the contrast of the first frame: it was still fading in
PARALLAX = 0.15  # of how far the camera's motion takes what is behind, things nearer by may go otherwise, and be still
MOSTLY = 0.4  # of the border's points by one motion: of a room they are by several, but that is most of it
ALONE = 0.05  # of the points go another way than the camera takes them: fewer are nothing
COMPARED = 20  # of those frames that are compared
WIDE_PX = 31  # leads points that do not come back: fast ones. It sees across borders, so the other has the last word
FEWEST, POINTS = 50, 800
MOST_WAITED = 300  # frames, and what there is by then is taken: no more are waited for texture, or between cuts


@dataclass(frozen=True)
class Found:
    """What the first frames show.

    Attributes:
        first: the first frame with texture.
        region: (H, W) uint8, 255 where points are to be detected in that frame.
        surface: what moves most; None in a still scene.
        others: what else moves, best first.
        frames: how many were looked at.
        narrowed: whether the region is smaller than it was.
    """

    first: Frame
    region: Image
    surface: Surface | None
    others: list[Surface]
    frames: int
    narrowed: bool


class Search:
    """Follows points of a region from its first frame on.

    Args:
        image_bgr: that frame, (H, W, 3) uint8.
        region: (H, W) uint8, 255 where to look.

    Attributes:
        frames: looked at so far.

    Raises:
        TrackingError: too few corners.
    """

    def __init__(self, image_bgr: Image, region: Image) -> None:
        self._region, self._grays = region, Grays.of(image_bgr)
        self._first = self._last = image_bgr
        # Points nearer to each other are seen by the same windows: their motion blurs across borders.
        most = int(np.clip(np.count_nonzero(region) // WINDOW_PX**2, FEWEST, POINTS))
        self._tracks = [detect_corners(self._grays.full, region, most, faint=True)]
        self._way = np.zeros(len(self._tracks[0]))  # of each point so far, at most
        middle = middling(self._tracks[0], region) >= MIDDLE
        self._middle = middle if middle.any() else ~middle
        self._contrast = self._contrast_now()

    @property
    def frames(self) -> int:
        """Looked at so far."""
        return len(self._tracks)

    @property
    def moved_px(self) -> float:
        """How far the farthest tenth of what is in the middle has moved."""
        return farthest_px(self._way[self._middle])

    @property
    def enough(self) -> bool:
        """Whether further frames would not tell more."""
        return self.frames >= MOST_FRAMES or (self.frames >= LEAST_FRAMES and self._far(self._way))

    def add(self, image_bgr: Image) -> bool:
        """Look at the next frame; False if most points are lost, or it is much clearer: nothing of it is kept."""
        before, self._grays, last = self._grays, Grays.of(image_bgr), self._tracks[-1]
        self._last = image_bgr
        moved, seen = np.full_like(last, np.nan), np.flatnonzero(np.isfinite(last[:, 0]))
        there, good = followed(before, self._grays, last[seen])
        if good.mean() < FEW_GUIDES:  # a change of light is no motion
            evened, also = followed(before.evened, self._grays.evened, last[seen])
            there, good = (evened, also) if also.sum() > good.sum() else (there, good)
        moved[seen[good]] = there[good]
        if good.sum() < SEEN * len(last) or self._contrast_now() > CLEARER * self._contrast:
            return False
        self._tracks.append(moved)
        way = np.linalg.norm(moved - self._tracks[0], axis=1)
        if self._far(way):  # unless it is the camera that went, and something else goes its own way
            (_, now), _ = still([self._tracks[0], moved], self._region, MOSTLY)
            own = np.linalg.norm(now - self._tracks[0], axis=1)
            way = own if np.nanmean(own > STILL_PX) > ALONE else way
        self._way = np.fmax(self._way, way)
        return True

    def found(self) -> tuple[Image, list[Surface]]:
        """Where what moves most was in the first frame, (H, W) uint8, and all that moves, by the frames so far."""
        return found(self._tracks, self._region, self._first)

    def region_now(self) -> Image:
        """Where what moves most is in the last frame, (H, W) uint8.

        Raises:
            TrackingError: nothing moves.
        """
        last = np.isfinite(self._tracks[-1][:, 0])
        region, moving = found([seen[last] for seen in reversed(self._tracks)], self._region, self._last)
        if not moving:
            raise TrackingError(f"nothing moves in {self.frames} frames")
        return region

    def _far(self, way: Array) -> bool:
        """Whether that is enough, by how far (P,) px each point went."""
        return farthest_px(way[self._middle]) > FAR_ENOUGH * max(self._region.shape)

    def _contrast_now(self) -> float:
        """Standard deviation of the grey levels in the region."""
        return float(self._grays.half[self._region[::2, ::2] > 0].std())


def farthest_px(way: Array) -> float:
    """How far the farthest tenth of points went, by the way (P,) px of each, NaN where that is not known."""
    return float(np.nanquantile(way, TENTH)) if np.isfinite(way).any() else 0.0


def still(tracks: list[Array], region: Image, agreed: float = AGREED) -> tuple[list[Array], float]:
    """As `by_first_camera`; tracks (P, 2) as they are in a region (H, W) that somebody chose, which may be all surface."""
    return by_first_camera(tracks, (region.shape[1], region.shape[0]), agreed) if region.all() else (tracks, 0.0)


def compared(tracks: list[Array]) -> list[Array]:
    """Tracks (P, 2) in frames well spread, most of them early: what is soon covered shows only there how it goes."""
    chosen = np.unique(((len(tracks) - 1) * np.linspace(0, 1, COMPARED) ** 2).round().astype(int))
    return [tracks[k] for k in chosen]


def found(tracks: list[Array], region: Image, image_bgr: Image) -> tuple[Image, list[Surface]]:
    """What moves in a region (H, W) uint8, the best first, and the part of the region where that is.

    That is the whole region, where nothing moves, or all of it together.

    Args:
        tracks: of points (P, 2) px each, the first in the picture whose region it is.
        region: (H, W) uint8.
        image_bgr: (H, W, 3) uint8, that picture.
    """
    W = compared(tracks)
    by_first, camera_px = still(W, region)
    moving = surfaces(np.stack(by_first), region, max(STILL_PX, PARALLAX * camera_px))
    if not moving and camera_px:  # what is at the border is all there is
        moving = surfaces(np.stack(W), region)
    if moving:
        best = moving[0]
        left_out = ~best.own if region.all() else best.other  # nobody has chosen a picture's corners
        if left_out.any():
            mask = at_colours(best.mask, image_bgr, tracks[0][best.own]) & region
            moving[0] = best = replace(best, mask=inset(mask, region))
            return best.mask, moving
    return region, moving


def followed(before: Grays, now: Grays, points_px: Array) -> tuple[Array, Flags]:
    """Where points (n, 2) went, and whether that is known; without guides: what has no texture would go where they go."""

    def follow(some: Array, guess: Array, window: int, levels: int) -> tuple[Array, Flags]:
        there, good = lucas_kanade(before.full, now.full, some, guess, window, levels, CONVERGED_PX)
        return there, good & returned(before.full, now.full, some, there, guess, window, levels)

    levels = levels_of(now.full)
    there, good = follow(points_px, np.zeros_like(points_px), WINDOW_PX, levels)
    lost = np.flatnonzero(~good)
    if len(lost):
        led, found = follow(points_px[lost], np.zeros((len(lost), 2)), WIDE_PX, levels)
        lost, led = lost[found], led[found]
    if len(lost):
        there[lost], good[lost] = follow(points_px[lost], led - points_px[lost], WINDOW_PX, 0)
    return there, good


def farther(one: tuple[Search, Frame] | None, other: tuple[Search, Frame] | None) -> tuple[Search, Frame] | None:
    """The one that has moved more, the former if neither has."""
    return max(filter(None, (one, other)), key=lambda looked: looked[0].moved_px, default=None)


def search(frames: Iterable[Frame], region: Image) -> Found:
    """Look for the surface in a region (H, W) uint8 of the first frames.

    Past those without texture, those that fade in, and a picture that is cut away before it moved half of what is enough.

    Raises:
        TrackingError: no frame has enough corners.
    """
    begun: tuple[Search, Frame] | None = None
    earlier = begun  # of what was cut away what had moved most, if nothing better comes after it
    blank = TrackingError("there is no frame")
    for frame in islice(frames, MOST_WAITED):
        if begun is not None:
            same = begun[0].add(frame.image)
            if same:
                if begun[0].enough:
                    break
                continue
            looked_at = begun[0].frames >= LEAST_FRAMES
            if looked_at and begun[0].moved_px > 0.5 * FAR_ENOUGH * max(region.shape):
                break
            earlier, begun = farther(earlier, begun), None
        try:
            begun = Search(frame.image, region), frame
        except TrackingError as error:
            blank = error
    else:  # nothing was enough
        begun = farther(earlier, begun)
    if begun is None:
        raise blank
    looked, first = begun
    part, moving = looked.found()
    best = moving[0] if moving else None
    return Found(first, part, best, moving[1:], looked.frames, narrowed=part is not region)
