"""Mapping while frames come: the first model, and another one whenever the views have grown."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.bootstrap import bootstrap
from reconstruction.mapping.keyframes import Keyframes, difference
from reconstruction.mapping.map import Map, map_of
from reconstruction.settings import Settings

FIRST_LOOKS = (30, 60)  # frames after which a first model is looked for; the last decides
FIRST_LATENCY, LATENCY = 30, 90  # frames after which a first model and another one are in force, if they are waited for
FEWEST = 10  # keyframes for a map
GROWN = 1.3  # times as far apart as at the last map the keyframes are before there is another,
RENEWED = 4 / 3  # or so many times as many frames have been keyframes

Start = Callable[..., "Future[Any]"]
"""Begins a call (function, *arguments) somewhere."""


def at_once(function: Callable[..., Any], *arguments: object) -> "Future[Any]":
    """A call made here and now."""
    future: Future[Any] = Future()
    try:
        future.set_result(function(*arguments))
    except Exception as error:
        future.set_exception(error)
    return future


class Mapper:
    """What is known of the object so far, and when to look again.

    Args:
        settings: how to reconstruct.
        start: where models are made.
        wait: whether a model is in force a fixed number of frames after it was begun, waiting for it if need be, so that
            shapes depend on no machine's speed; else as soon as it is there.

    Attributes:
        first_frames: so many gave the first model.
    """

    def __init__(self, settings: Settings, start: Start = at_once, *, wait: bool = False) -> None:
        self._settings, self._start, self._wait = settings, start, wait
        self._keyframes = Keyframes() if settings.maps else None
        self._frame, self._due = -1, 0
        self._job: Future[Map | None] | None = None
        self._first: list[tuple[Array, Mask]] | None = []  # frames, until they have given the first model
        self.first_frames = 0
        self._seen: tuple[Array, Mask, Indices] | None = None  # the keyframes of the last map,
        self._found: Map | None = None  # and what they showed
        self._version, self._extent = 0, 0.0  # of the keyframes when they were last looked at

    def add(self, W: Array, visible: Mask, camera: Camera, begin: tuple[Array, Mask]) -> Map | None:
        """Take the next frame; another model, if it is in force from now on.

        Args:
            W: its points (2, p) px.
            visible: (p,).
            camera: as known so far.
            begin: the same of the frame in which another model would begin: its first pose is near that.

        Raises:
            ReconstructionError: no rest shape can be had from the first frames.
        """
        self._frame += 1
        if self._keyframes is not None:
            self._keyframes.offer(self._frame, W, visible)
        if self._first is not None:
            self._first.append((W, visible))
        found = self._result()
        if found is None and self._job is None:
            self._look(camera)
            found = self._result()
        return found if found is None or self._seen is None else nearest_first(found, *self._seen[:2], *begin)

    def finish(self, camera: Camera) -> Map | None:
        """The model of fewer first frames than are wanted, since no more come; None if there was one, or no frame.

        Raises:
            ReconstructionError: no rest shape can be had from them.
        """
        if not self._first:
            return None
        self.first_frames = max(self.first_frames, len(self._first))
        W, visible = stacked(self._first)
        found = self._job.result() if self._job is not None else None
        self._first = None
        return found or bootstrap(W, visible, camera, self._settings, last=True)

    def final(self, camera: Camera) -> Map | None:
        """The map of the keyframes of all frames, posed in the first of them first; None if they do not tell."""
        if self._keyframes is None:
            return None
        if self._seen is None or self._job is not None or self._version != self._keyframes.version:
            self._seen = self._keyframes.spread()
            self._found = map_of(*self._seen[:2], camera, self._settings.estimate_focal) or self._found
        return self._found and in_order(self._found, np.argsort(self._seen[2]))

    def _look(self, camera: Camera) -> None:
        """Begin another model, if it is time."""
        if self._first is not None:
            wanted = self._settings.bootstrap_frames
            looks = FIRST_LOOKS if wanted == "auto" else (wanted,)
            n = len(self._first)
            if n in looks or n > looks[-1]:
                self._job = self._start(bootstrap, *stacked(self._first), camera, self._settings, n >= looks[-1])
                self.first_frames, self._due = n, self._frame + FIRST_LATENCY
        elif self._keyframes is not None and self._grown(self._keyframes):
            self._seen = self._keyframes.spread()
            self._version, self._extent = self._keyframes.version, self._keyframes.extent
            self._job = self._start(map_of, *self._seen[:2], camera, self._settings.estimate_focal)
            self._due = self._frame + LATENCY

    def _grown(self, keyframes: Keyframes) -> bool:
        """Whether the keyframes have more to tell than when they were last looked at."""
        if len(keyframes.frames) < FEWEST:
            return False
        return keyframes.extent > GROWN * self._extent or keyframes.version >= RENEWED * self._version

    def _result(self) -> Map | None:
        """What has been begun, once it is in force."""
        if self._job is None or not (self._frame >= self._due if self._wait else self._job.done()):
            return None
        job, self._job = self._job, None
        found = job.result()
        if found is not None and self._first is not None:
            self._first = None
        elif found is not None:
            self._found = found
        return found


def stacked(frames: list[tuple[Array, Mask]]) -> tuple[Array, Mask]:
    """Frames' points as (F, 2, p) px, visible (F, p)."""
    return np.stack([W for W, _ in frames]), np.stack([visible for _, visible in frames])


def nearest_first(found: Map, keyframes: Array, keyframes_visible: Mask, W: Array, visible: Mask) -> Map:
    """A map of keyframes (K, 2, p) px, posed in that one first which is most like an image (2, p) px."""
    known = np.where(keyframes_visible[:, None], keyframes, 0.0)
    apart = difference(np.where(visible, W, 0.0), visible, known, keyframes_visible)
    return in_order(found, np.argsort(apart, kind="stable"))


def in_order(found: Map, frames: Indices) -> Map:
    """The same with the poses (K,) in another order."""
    return replace(found, rest=replace(found.rest, motion=found.rest.motion.in_order(frames)))
