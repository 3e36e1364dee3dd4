"""A point tracker that detects the loss of the surface, and relocalises it."""

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np

from tracking import Array, Flags, Image
from tracking.klt import PointTracker
from tracking.observation import Observation
from tracking.region.left_behind import LeftBehind
from tracking.relocalisation import Relocalisation

# A hand over the sheet leaves points around it, and comes within several frames; a cut leaves 0 to 20 % at once.
RECENT_FRAMES = 3  # whose best share of points seen is compared: a surface that leaves takes longer
COLLAPSED_SHARE = 0.5  # of that share: less in one frame, and ...
FEW_SHARE = 0.4  # ... less than this share of all points, looks like a cut
LOST_SHARE = 0.1  # share of the points below which the surface is lost, however slowly it went
MIN_POINTS, MIN_SHARE = 12, 0.5  # fewer, and it is lost, too; of few points, less than this share
FOUND_SHARE = 0.2  # share of the points that must look right to believe that the surface is back
SEARCH_EVERY_FRAME = 15  # so many frames it is searched for in each frame; later, to save time, ...
SEARCH_EVERY = 5  # ... in one out of so many
SOON_PARTLY = 0.9  # share of the points: when fewer are seen, the surface is described by its features beside the frames
PARTLY = 0.75  # share of the points: while fewer are seen, the others are looked for by their features, too, ...
REGAIN_EVERY, REGAIN_SELDOM = 8, 32  # ... in one out of so many frames, less and less often while that brings ...
REGAINED = 0.02  # ... less than this share, ...
UNCOVERED_EVERY = 2  # ... but no less often than in one out of so many while what is in front moves: ...
UNCOVERED = 0.1  # ... this share of the points has come into sight or gone since
REGAIN_SIDE_PX = 640  # of the picture, of which only the part around the others is taken: it must not take long
SAME_SHARE = 0.75  # of the share seen before: so many at the same place need no search


# What is around the surface tells a hand that comes quickly from a cut, where nothing stays as it was.
CELLS = (32, 24)  # of the picture that are compared: coarse enough for a camera that is not quite still
CELL_CHANGE = 10.0  # grey levels by which a cell may have changed
SAME_CELLS = 0.5  # share of the cells around the surface: less, and it was a cut
LEAST_BACKGROUND = 0.1  # share of the picture that must lie around the surface for this to say anything


class Change(Enum):
    """What happened between two frames."""

    NONE = "none"
    LOST = "lost"
    RECOVERED = "recovered"


@dataclass(frozen=True)
class Guarded:
    """What one frame shows, and what happened.

    Attributes:
        observation: the points; nothing is visible while the surface is lost.
        change: whether it was lost or found in this frame.
        reason: why, in words.
        cut: whether it was lost with everything around it, from one frame to the next.
        astray: (P,) points found never to have been on the surface; None where there are no new ones.
    """

    observation: Observation
    change: Change = Change.NONE
    reason: str = ""
    cut: bool = False
    astray: Flags | None = None


class GuardedTracker:
    """Tracks points as `PointTracker` does, and detects when the surface is lost.

    While it is lost, it is searched for where it was last seen, and by its features in the whole picture.

    Args:
        image_bgr: (H, W, 3) uint8 reference frame.
        points_px: (P, 2) the points in it.

    Attributes:
        lost: whether the surface is lost.
        frames_lost: for how many frames.
    """

    def __init__(self, image_bgr: Image, points_px: Array) -> None:
        self._reference = self._image = image_bgr  # until it is described, and the last that showed the surface
        self._points = self._reference_px = points_px
        self._tracker = PointTracker(image_bgr, points_px)
        self._least = min(MIN_POINTS, int(MIN_SHARE * len(points_px)))
        self._left_behind = LeftBehind(points_px)
        self._relocalisation: Relocalisation | Future[Relocalisation] | None = None
        self._regain_every, self._partly = REGAIN_EVERY, 0  # frames; of them those in which it is seen only partly
        self._seen_then = np.ones(len(points_px), np.bool_)  # when the others were looked for
        self._shares = deque([1.0], RECENT_FRAMES)  # of the points seen in the last frames
        self._last_px = points_px.copy()  # where the surface was last: seen or predicted
        self.lost = False
        self.frames_lost = 0

    def track(self, image_bgr: Image, predicted_px: Array | None = None) -> Guarded:
        """Find the points in the next frame; `predicted_px` (P, 2) as for `PointTracker.track`."""
        if self.lost:
            return self._search(image_bgr)
        expected_px = self._last_px if predicted_px is None else predicted_px
        observation = self._regained(self._tracker.track(image_bgr, predicted_px), image_bgr, expected_px)
        share = self._share(observation)
        just_now = max(self._shares)
        jumped = share < COLLAPSED_SHARE * just_now and share < FEW_SHARE
        if jumped or share < LOST_SHARE or observation.visible.sum() < self._least:
            self.lost, self.frames_lost = True, 1
            how = f"only {share:.0%} of the points are seen"
            how += f", {just_now:.0%} just before: a cut or a jump" if jumped else ": it is covered or has left the picture"
            cut = jumped and not same_background(self._image, image_bgr, self._last_px)
            self._image = self._image[:0].copy()
            return Guarded(self._nothing(), Change.LOST, how, cut)
        self._shares.append(share)
        self._image = image_bgr
        seen = observation.visible[:, None]
        self._last_px = np.where(seen, observation.points_px, expected_px)
        if observation.renewed and np.isfinite(self._last_px).all():
            self._reference, self._reference_px, self._relocalisation = image_bgr, self._last_px, None
        behind = self._left_behind.look(observation)
        if not behind:
            return Guarded(observation)
        self._tracker.give_up(self._left_behind.points)
        how = f"{behind} points stay behind while the surface moves: they are given up"
        return Guarded(observation, reason=how, astray=self._left_behind.points.copy())

    def seek(self, image_bgr: Image) -> Guarded:
        """Look for the surface in any later frame, as thoroughly as if it had just been lost."""
        self.frames_lost = 0
        return self._search(image_bgr)

    def _search(self, image_bgr: Image) -> Guarded:
        self.frames_lost += 1
        found = self._tracker.resume(image_bgr, self._last_px)
        how = "where it was"
        if self._good(found, SAME_SHARE * max(self._shares)) or not self._due:
            enough = self._good(found, FOUND_SHARE)
        else:
            places = self._features.find(image_bgr)
            if places is not None:
                relocated = self._tracker.resume(image_bgr, places)
                if relocated.visible.sum() > found.visible.sum():
                    found, how = relocated, "by its features"
                else:  # the tracker goes on from what is kept
                    found = self._tracker.resume(image_bgr, self._last_px)
            enough = self._good(found, FOUND_SHARE)
        if not enough:
            return Guarded(self._nothing())
        share = self._share(found)
        frames, self.lost, self.frames_lost = self.frames_lost - 1, False, 0
        self._shares.clear()
        self._shares.append(share)
        self._image = image_bgr
        self._last_px = np.where(found.visible[:, None], found.points_px, self._last_px)
        lasted = f", after {frames} frame{'s' if frames > 1 else ''}" if frames else ""
        return Guarded(found, Change.RECOVERED, f"found {how}, {share:.0%} of the points{lasted}")

    def _regained(self, observation: Observation, image_bgr: Image, expected_px: Array) -> Observation:
        """With points that have come into sight far from where they were expected, if it is time to look for them."""
        share = self._share(observation)
        if share < SOON_PARTLY:
            self._describe()
        self._partly = self._partly + 1 if LOST_SHARE < share < PARTLY else 0
        if not self._partly:
            self._regain_every = REGAIN_EVERY
        moves = np.mean(observation.visible != self._seen_then) > UNCOVERED
        if self._partly < (UNCOVERED_EVERY if moves else self._regain_every):
            return observation
        self._partly = 0
        places = self._features.find(image_bgr, REGAIN_SIDE_PX, expected_px[~observation.visible])
        regained = observation if places is None else self._tracker.regain(places)
        worth = self._share(regained) > share + REGAINED
        self._regain_every = REGAIN_EVERY if worth else min(2 * self._regain_every, REGAIN_SELDOM)
        self._seen_then = regained.visible
        return regained

    def _describe(self) -> None:
        """Begin to describe the surface by its features, in a thread: it takes longer than a frame."""
        if self._relocalisation is None:
            pool = ThreadPoolExecutor(1)  # OpenCV holds no lock of the interpreter's
            self._relocalisation = pool.submit(Relocalisation, self._reference, self._reference_px)
            pool.shutdown(wait=False)
            self._reference = self._reference[:0].copy()  # what is kept for long keeps no pictures

    @property
    def _features(self) -> Relocalisation:
        """Finds the surface by its features."""
        self._describe()
        if isinstance(self._relocalisation, Future):
            self._relocalisation = self._relocalisation.result()
        assert self._relocalisation is not None
        return self._relocalisation

    def __getstate__(self) -> dict[str, object]:
        """What goes to another process: no thread, but what it makes."""
        return self.__dict__ | ({} if self._relocalisation is None else {"_relocalisation": self._features})

    @property
    def _due(self) -> bool:
        return self.frames_lost <= SEARCH_EVERY_FRAME or self.frames_lost % SEARCH_EVERY == 0

    def _good(self, observation: Observation, share: float) -> bool:
        return self._share(observation) >= share and int(observation.visible.sum()) >= self._least

    def _share(self, observation: Observation) -> float:
        """Of the points that are on the surface those that are seen."""
        return float(observation.visible.sum() / max((~self._left_behind.points).sum(), 1))

    def _nothing(self) -> Observation:
        return Observation(np.full_like(self._points, np.nan), np.zeros(len(self._points), np.bool_))


def same_background(before_bgr: Image, now_bgr: Image, surface_px: Array) -> bool:
    """Whether most of what is around a surface, at (P, 2) px in the picture before, looks as it did; if there is enough."""
    surface = np.zeros(before_bgr.shape[:2], np.uint8)
    hull = cv2.convexHull(surface_px[np.isfinite(surface_px).all(axis=1)].astype(np.float32).reshape(-1, 1, 2))
    cv2.fillConvexPoly(surface, np.rint(hull).astype(np.int32), (255,))
    before, now, inside = (
        cv2.resize(image, CELLS, interpolation=cv2.INTER_AREA).astype(np.float64)
        for image in (before_bgr, now_bgr, surface)
    )
    around = inside == 0
    if not around.any():
        return False
    gain = np.median(now[around] + 1) / np.median(before[around] + 1)  # light may have changed
    change = np.abs(before * gain - now).max(axis=2)[around]
    return around.mean() > LEAST_BACKGROUND and bool(np.mean(change < CELL_CHANGE) > SAME_CELLS)
