"""The bare OpenCV loop: decode, gray, Lucas-Kanade there and back; a process of its own, which prints JSON."""

import json
import sys
from time import perf_counter, process_time
from typing import Any, cast

import cv2
import numpy as np

from tracking import Array, Image
from tracking.features import detect_corners
from tracking.flow import GUIDES, LEVELS, Grays, spread_order
from tracking.region.mask import region_mask

WINDOW_PX, GUIDE_WINDOW_PX = 15, 11  # what a tracker needs that has nothing but this to go by


def bare_loop(video: str, roi: tuple[int, int, int, int], points: int, frames: int) -> tuple[float, float]:
    """Seconds from the second frame to the last, and those of processor time; points that leave stay where they were."""
    cv2.setNumThreads(1)
    capture = cv2.VideoCapture(video)
    first = capture.read()[1]
    before = Grays.of(cast(Image, first))
    size = (first.shape[1], first.shape[0])
    found = detect_corners(before.full, region_mask(size, roi, None), points)
    at = found[spread_order(found)]
    started, used = perf_counter(), process_time()
    for _ in range(frames - 1):
        good, image = capture.read()
        if not good:
            break
        now = Grays.of(cast(Image, image))
        there_and_back(before.half, now.half, at[:GUIDES] / 2, GUIDE_WINDOW_PX, LEVELS)
        there = there_and_back(before.full, now.full, at, WINDOW_PX, 0)
        inside = ((there > 0) & (there < size)).all(axis=1)
        at[inside] = there[inside]
        before = now
    return perf_counter() - started, process_time() - used


def there_and_back(before: Image, now: Image, points: Array, window: int, levels: int) -> Array:
    """Where points (n, 2) went."""
    options: Any = {
        "winSize": (window, window),
        "maxLevel": levels,
        "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
        "criteria": (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 30, 0.03),
    }
    start = points.astype(np.float32)
    there = cv2.calcOpticalFlowPyrLK(before, now, start, start.copy(), **options)[0]
    cv2.calcOpticalFlowPyrLK(now, before, there, there.copy(), **options)
    return np.asarray(there, np.float64)


def main() -> None:
    """Arguments: video, region (4), points, frames."""
    x, y, width, height, points, frames = map(int, sys.argv[2:])
    seconds, used_s = bare_loop(sys.argv[1], (x, y, width, height), points, frames)
    sys.stdout.write(json.dumps({"seconds": seconds, "used_s": used_s}) + "\n")


if __name__ == "__main__":
    main()
