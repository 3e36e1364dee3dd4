"""The bare OpenCV loop: decode, gray, and the tracker's calls of Lucas-Kanade; a process of its own, which prints JSON."""

import json
import sys
from time import perf_counter
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.features import detect_corners
from tracking.flow import GUIDE_LEVELS, GUIDE_WINDOW_PX, GUIDES, WINDOW_PX, spread_order
from tracking.region import region_mask
from tracking.video import Image

Points = NDArray[np.float32]

GUESSED = cv2.OPTFLOW_USE_INITIAL_FLOW


def bare_loop(video: str, roi: tuple[int, int, int, int], points: int, frames: int) -> float:
    """Seconds from the second frame to the last; points that leave stay where they were."""
    capture = cv2.VideoCapture(video)
    first = capture.read()[1]
    before = cv2.cvtColor(first, cv2.COLOR_BGR2GRAY)
    size = (first.shape[1], first.shape[0])
    found = detect_corners(cast(Image, before), region_mask(size, roi, None), points)
    at = found[spread_order(found)].astype(np.float32)
    started = perf_counter()
    for _ in range(frames - 1):
        good, image = capture.read()
        if not good:
            break
        now = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        both_ways(before, now, at[:GUIDES], GUIDE_WINDOW_PX, GUIDE_LEVELS)
        there = both_ways(before, now, at, WINDOW_PX, 0)
        inside = ((there > 0) & (there < size)).all(axis=1)
        at[inside] = there[inside]
        before = now
    return perf_counter() - started


def both_ways(before: cv2.typing.MatLike, now: cv2.typing.MatLike, at: Points, window: int, levels: int) -> Points:
    """Points (n, 2) followed forward, and back for the time it takes."""
    size = (window, window)
    there = cv2.calcOpticalFlowPyrLK(before, now, at, at.copy(), winSize=size, maxLevel=levels, flags=GUESSED)[0]
    cv2.calcOpticalFlowPyrLK(now, before, there, at.copy(), winSize=size, maxLevel=levels, flags=GUESSED)
    return np.asarray(there, np.float32)


def main() -> None:
    """Arguments: video, region (4), points, frames."""
    x, y, width, height, points, frames = map(int, sys.argv[2:])
    sys.stdout.write(json.dumps({"seconds": bare_loop(sys.argv[1], (x, y, width, height), points, frames)}) + "\n")


if __name__ == "__main__":
    main()
