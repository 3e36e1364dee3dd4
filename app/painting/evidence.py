"""What speaks for something in front of the surface, and what against: motion, and the points.

Pixels are those of half the resolution.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import cv2
import numpy as np

from app.arrays import Array, Flags, Floats, Indices, Mask
from app.painting.shading import View

MOTION = 4.0  # variances by which pixels differ from the frame before, moved as the surface has
FADES = 0.9  # of that, from frame to frame: what moves slowly shows over several
CAME = 0.5  # share of a component that has to have moved so
LEAST = 0.01  # share of the surface that something new has to cover
KNOWN = 0.3  # share of a component where the mask was set before: the same thing
DISPLACED = 0.5  # share of a component that a displacement of the surface explains: it is the surface
EXPLAINED = 0.5  # of the difference has to be gone by it
FARTHEST_PX = 8.0  # of such a displacement
SEEN, SEEN_OF_NEW = 0.6, 0.4  # largest share of a component's points that are seen, if they are behind it
FOREIGN = 1.4  # mean logarithm of the ratio of colours, of a new component against the surface
FEWEST = 3  # points that can say so
POINTS_PX = 12.0  # reach of a tracked point
VISIBLE_FACTOR, MISSING_FACTOR = 3.0, 0.4  # of a threshold, where points are seen and where they are not
PATCH_PX = 5


@dataclass(frozen=True)
class Moved:
    """The frame before, and where pixels of the surface were in it.

    Attributes:
        before: (H, W, 3) all of the frame before; None: there is none.
        displacement: gives how far they have come (h, w, 2), px of half the resolution.
        corner: x, y of the part in the picture.
    """

    before: Floats | None
    displacement: Callable[[], Floats]
    corner: tuple[int, int]

    def mismatch(self, view: View) -> Floats:
        """How far patches (h, w) differ from what the surface's motion makes of the frame before, in variances."""
        h, w = view.inside.shape
        if self.before is None:
            return np.zeros((h, w), np.float32)
        x, y = self.corner
        across, down = np.meshgrid(np.arange(x, x + w, dtype=np.float32), np.arange(y, y + h, dtype=np.float32))
        places = np.dstack([across, down]) - self.displacement()
        one_map_for_both: Any = None
        seen = cv2.remap(self.before, places, one_map_for_both, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return cast(
            Floats, cv2.boxFilter(differences(view.seen, cast(Floats, seen), view.variance), -1, (PATCH_PX, PATCH_PX))
        )


def differences(a: Floats, b: Floats, variance: Floats) -> Floats:
    """Mean squared difference (h, w) of two pictures' channels, in variances."""
    off = a - b
    return cast(Floats, np.einsum("hwc,hwc->hw", off, off) / (3.0 * variance))


def displaced(view: View, shade: Floats, where: Mask) -> Mask:
    """Where (h, w) 0 or 1 a small displacement of the surface explains a part that is not as predicted."""
    rows, columns = (np.flatnonzero(where.any(axis=axis)) for axis in (1, 0))
    margin = 2 * int(FARTHEST_PX)
    part = tuple(slice(max(int(at[0]) - margin, 0), int(at[-1]) + margin + 1) for at in (rows, columns))
    predicted, seen = view.predicted[part] * shade[part][..., None], view.seen[part]
    explained = np.zeros_like(where)
    if min(seen.shape[:2]) < 2 * margin:
        return explained
    grey = [cv2.cvtColor(np.clip(image, 0, 255).astype(np.uint8), cv2.COLOR_BGR2GRAY) for image in (seen, predicted)]
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST).calc(grey[0], grey[1], cast(Any, None))
    h, w = grey[0].shape
    across, down = np.meshgrid(np.arange(w, dtype=np.float32), np.arange(h, dtype=np.float32))
    one_map_for_both: Any = None
    places = cast(Floats, np.dstack([across, down]) + flow)
    moved = cv2.remap(predicted, places, one_map_for_both, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    was, now = (
        cv2.boxFilter(differences(seen, image, view.variance[part]), -1, (PATCH_PX, PATCH_PX))
        for image in (predicted, cast(Floats, moved))
    )
    near = np.linalg.norm(flow, axis=2) < FARTHEST_PX
    explained[part] = (now < EXPLAINED * was) & near
    return explained


def seen_share(label: Indices, count: int, places: Array, visible: Flags) -> Array:
    """Share (count,) of the points (p, 2) that are seen, of each component that `label` (h, w) numbers; 0 of too few."""
    h, w = label.shape
    cell = np.rint(places).astype(np.int64)
    within = ((cell >= 0) & (cell < (w, h))).all(axis=1)
    number = label[cell[within, 1], cell[within, 0]]
    points = np.bincount(number, minlength=count)
    seen = np.bincount(number[visible[within]], minlength=count)
    return np.where(points >= FEWEST, seen / np.maximum(points, 1), 0.0)


def threshold_factor(shape: tuple[int, ...], points: Array, visible: Flags) -> Floats:
    """Factor (h, w) of the threshold: larger where points are seen, smaller where they are missing."""
    h, w = shape
    step = 4
    size = (h // step + 1, w // step + 1)
    cell = np.rint(points / step).astype(np.int64)
    within = ((cell >= 0) & (cell < size[::-1])).all(axis=1)
    number = cell[within, 1] * size[1] + cell[within, 0]
    maps = [np.bincount(number, flags[within].astype(float), minlength=size[0] * size[1]) for flags in (visible, ~visible)]
    near = cv2.GaussianBlur(np.stack(maps, axis=-1).reshape(*size, 2), (0, 0), POINTS_PX / 2 / step)
    share = (near[..., 0] + 1e-3) / (near.sum(axis=-1) + 2e-3)
    factor = MISSING_FACTOR * (VISIBLE_FACTOR / MISSING_FACTOR) ** share
    return cast(Floats, cv2.resize(factor.astype(np.float32), (w, h), interpolation=cv2.INTER_LINEAR))
