"""The bare OpenCV loop: decode, gray, and the tracker's calls of Lucas-Kanade; a process of its own, which prints JSON."""

import json
import sys
from time import perf_counter
from typing import cast

import cv2
import numpy as np

from tracking import Image
from tracking.features import detect_corners
from tracking.flow import GUIDE_LEVELS, GUIDE_WINDOW_PX, GUIDES, WINDOW_PX, Grays, both_ways, spread_order
from tracking.region import region_mask


def bare_loop(video: str, roi: tuple[int, int, int, int], points: int, frames: int) -> float:
    """Seconds from the second frame to the last; points that leave stay where they were."""
    capture = cv2.VideoCapture(video)
    first = capture.read()[1]
    before = Grays.of(cast(Image, first))
    size = (first.shape[1], first.shape[0])
    found = detect_corners(before.full, region_mask(size, roi, None), points)
    at = found[spread_order(found)]
    still = np.zeros_like(at)
    started = perf_counter()
    for _ in range(frames - 1):
        good, image = capture.read()
        if not good:
            break
        now = Grays.of(cast(Image, image))
        both_ways(before.half, now.half, at[:GUIDES] / 2, still[:GUIDES], GUIDE_WINDOW_PX, GUIDE_LEVELS)
        there, _ = both_ways(before.full, now.full, at, still, WINDOW_PX, 0)
        inside = ((there > 0) & (there < size)).all(axis=1)
        at[inside] = there[inside]
        before = now
    return perf_counter() - started


def main() -> None:
    """Arguments: video, region (4), points, frames."""
    x, y, width, height, points, frames = map(int, sys.argv[2:])
    sys.stdout.write(json.dumps({"seconds": bare_loop(sys.argv[1], (x, y, width, height), points, frames)}) + "\n")


if __name__ == "__main__":
    main()
