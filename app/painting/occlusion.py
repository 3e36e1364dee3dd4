"""The occlusion mask: where something, a hand for instance, is in front of the surface.

A patch is a candidate if no change of light explains its difference to the prediction. It is in front if it came there by a
motion that is not the surface's, its colours are not the surface's, and neither a displacement of it nor seen points
explain it. Pixels are those of half the resolution.
"""

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np

from app.arrays import Array, Flags, Floats, Mask
from app.painting import colours, evidence
from app.painting.shading import View

PATCH_PX = 9  # side of the patches
MISMATCH = 6.0  # mean squared difference of a patch, in variances, that light does not explain
MISMATCH_BEFORE = 3.0  # the same where the mask of the frame before is set
DARKER, BRIGHTER = 0.5, 1.6  # largest change of light from one frame to the next
LEAST_PX = 30  # area of the smallest patch, and of the smallest hole in one
LEAST_INNER = 0.08  # share of the surface, of patches inside its outline: mouths and eyes are smaller
STAYS = 0.5  # log-likelihood by which a pixel is held on the side where it was
DISC = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (PATCH_PX, PATCH_PX))
SMALL = np.ones((3, 3), np.uint8)


@dataclass(frozen=True)
class Tracked:
    """The vertices in the part of the picture that is looked at.

    Attributes:
        places: (p, 2) half-resolution px.
        visible: (p,) which of them are seen.
    """

    places: Array
    visible: Flags


class Occlusion:
    """The mask, carried from frame to frame.

    Args:
        size: (width, height) of the picture at half the resolution.

    Attributes:
        mask: (height, width) 0 or 1, of the last frame.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        width, height = size
        self.mask: Mask = np.zeros((height, width), np.uint8)
        self._moved = np.zeros((height, width), np.float32)
        self._colours = colours.Colours()

    def update(
        self, part: tuple[slice, ...], view: View, shade: Floats, moved: evidence.Moved, tracked: Tracked
    ) -> tuple[Mask, Floats]:
        """The mask (h, w) of a part of a new frame, and how well that agrees with its prediction, (h, w) 0 … 1.

        Args:
            part: rows and columns of it; there is no mask elsewhere.
            view: the frame against its prediction.
            shade: (h, w) shading of the frame before.
            moved: the frame before, moved as the surface has.
            tracked: the vertices.
        """
        before = self.mask[part].copy()
        patches, agreement = candidates(view, shade, before, evidence.threshold_factor(before.shape, *astuple(tracked)))
        mask = np.zeros_like(before)
        motion = self._motion(part, view, moved) if patches.any() else None
        patches = across_outline(patches, view.inside)
        if motion is not None and patches.any():
            patches = self._in_front(patches, before, view, shade, motion, tracked)
        if patches.any():
            mask = self._refined(patches, before, view, shade)
        self.mask[:] = 0
        self.mask[part] = mask
        if not mask.any():
            self._colours.forget()
        return mask, agreement

    def _motion(self, part: tuple[slice, ...], view: View, moved: evidence.Moved) -> Floats:
        """How far pixels (h, w) have not moved as the surface has, in this frame or lately."""
        self._moved *= evidence.FADES
        here = self._moved[part]
        np.maximum(here, moved.mismatch(view), out=here)
        return here

    def _in_front(self, patches: Mask, before: Mask, view: View, shade: Floats, motion: Floats, tracked: Tracked) -> Mask:
        """The components of a mask that something in front is to be seen in."""
        count, found = cv2.connectedComponents(patches, connectivity=8)
        label = found.astype(np.int64)
        area = np.maximum(np.bincount(label.ravel(), minlength=count), 1)
        known = np.bincount(label.ravel(), before.ravel(), minlength=count) / area > evidence.KNOWN
        came = np.bincount(label.ravel(), (motion > evidence.MOTION).ravel(), minlength=count) / area > evidence.CAME
        came &= area > evidence.LEAST * view.inside.sum()
        share = evidence.seen_share(label, count, tracked.places, tracked.visible)
        kept = (known & (share <= evidence.SEEN)) | (~known & came & (share <= evidence.SEEN_OF_NEW))
        kept[0] = False
        new = kept & ~known
        if new.any():
            some = cast(Mask, new[label].astype(np.uint8))
            explained = evidence.displaced(view, shade, some)
            other = colours.foreign(view, shade, some)
            same = np.bincount(label.ravel(), explained.ravel(), minlength=count) / area > evidence.DISPLACED
            own = np.bincount(label.ravel(), other.ravel(), minlength=count) / area < evidence.FOREIGN
            kept &= ~(new & (same | own))
        return cast(Mask, kept[label].astype(np.uint8))

    def _refined(self, patches: Mask, before: Mask, view: View, shade: Floats) -> Mask:
        """The mask at the pixels' resolution: where the occluder's colours are likelier than the surface as predicted."""
        zone = cast(Mask, cv2.dilate(patches, DISC) * (view.inside > 0).astype(np.uint8))
        likelihood = self._colours.ratio(view, shade, patches, zone)
        held = STAYS * (2.0 * before.astype(np.float32) - 1.0)
        score = cv2.GaussianBlur(np.clip(likelihood, -5, 5), (0, 0), 0.8) + held
        smooth = cast(Mask, cv2.medianBlur(((zone > 0) & (score > 0)).astype(np.uint8), 5))
        mask = across_outline(without_specks(smooth), view.inside)
        # On to the pixels that show the surface in part.
        return np.where(view.inside > 0, mask, cv2.dilate(mask, np.ones((5, 5), np.uint8))).astype(np.uint8)


def astuple(tracked: Tracked) -> tuple[Array, Flags]:
    """Places and visibility."""
    return tracked.places, tracked.visible


def candidates(view: View, shade: Floats, before: Mask, factor: Floats) -> tuple[Mask, Floats]:
    """Patches that are not as predicted, (h, w) 0 or 1; and how well the frame agrees with its prediction, (h, w) 0 … 1.

    Args:
        view: the frame against its prediction.
        shade: (h, w) shading of the frame before.
        before: (h, w) mask of the frame before.
        factor: (h, w) of the threshold.
    """
    weight = view.inside / view.variance
    predicted, seen = view.predicted, view.seen
    pp, ip, ii = (
        weight * np.einsum("hwc,hwc->hw", a, b) for a, b in ((predicted, predicted), (seen, predicted), (seen, seen))
    )
    sums = cv2.boxFilter(cv2.merge([pp, ip, ii, view.inside]), -1, (PATCH_PX, PATCH_PX), normalize=False)
    light = np.clip(sums[..., 1] / np.maximum(sums[..., 0], 1e-3), DARKER * shade, BRIGHTER * shade)
    count = 3.0 * np.maximum(sums[..., 3], 1.0)
    mismatch = (sums[..., 2] - 2 * light * sums[..., 1] + light**2 * sums[..., 0]) / count
    limit = np.where(before > 0, MISMATCH_BEFORE, MISMATCH) * factor
    agreement = (1.0 / (1.0 + (mismatch / MISMATCH) ** 2)).astype(np.float32)
    patches = ((mismatch > limit) & (view.inside > 0)).astype(np.uint8)
    return cast(Mask, cv2.morphologyEx(patches, cv2.MORPH_OPEN, SMALL)), agreement


def without_specks(mask: Mask) -> Mask:
    """A mask without components and holes that are smaller than a patch may be."""
    for side in (0, 1):
        _count, label, stats, _ = cv2.connectedComponentsWithStats((mask == side).astype(np.uint8), connectivity=4)
        small = stats[:, cv2.CC_STAT_AREA] < LEAST_PX
        small[0] = False
        if small.any():
            mask = np.where(small[label], 1 - side, mask).astype(np.uint8)
    return mask


def across_outline(mask: Mask, inside: Floats) -> Mask:
    """The components of a mask that cross the surface's outline, as an arm does, or are very large."""
    count, label, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    inner = cv2.erode(
        (inside > 0).astype(np.uint8), np.ones((7, 7), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0
    )
    at_edge = np.bincount(label[inner == 0], minlength=count) > 0
    area = stats[:, cv2.CC_STAT_AREA]
    kept = (area >= LEAST_PX) & (at_edge | (area > LEAST_INNER * inside.sum()))
    kept[0] = False
    return kept[label].astype(np.uint8)
