"""Mapping while frames come: the first model, and another one whenever the views have grown."""

import sys
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.rest_shape import RestShape
from reconstruction.camera import Camera
from reconstruction.mapping.first.bootstrap import bootstrap
from reconstruction.mapping.first_sight import first_sight
from reconstruction.mapping.keyframes import KEYFRAMES, Keyframes, spread_of
from reconstruction.mapping.map import Map, nearest_first
from reconstruction.mapping.maps import map_of
from reconstruction.mapping.selection import Kind
from reconstruction.mapping.solid.deforming.learned_map import with_deformations
from reconstruction.mapping.start import Start, at_once
from reconstruction.settings import FIRST_LOOKS, Settings

LATENCY = 90  # frames after which a map that another process makes is in force: three seconds of most videos
FIRST_LATENCY = 0.25  # the same of a first model, of the frames it is made of: it takes a fraction of the time
CATCH_UP, LIVE_CATCH_UP = 4, 2  # frames that get their shapes with each new one; live ones come on time meanwhile
FEWEST = 10  # keyframes for a map
FEW = 6  # for a first model
MORE = 2  # times as many keyframes of a solid at the end: what deforms must be seen from many sides
FEWEST_POINTS = 4  # that a frame shows, for a first model
GROWN = 1.3  # times as far apart as at the last map the keyframes are before there is another,
RENEWED = 4 / 3  # or so many times as many frames have been keyframes


@dataclass(frozen=True)
class Job:
    """A model that has been begun, and the frame from which on it is in force, if that is waited for."""

    future: "Future[Map | None]"
    due: int


class Mapper:
    """What is known of the object so far, and when to look again.

    Args:
        settings: how to reconstruct.
        start: where models are made.
        frames: so many there will be, if that is known: what would be in force later is not begun.
        latency: so many frames after it was begun a map is in force, so that shapes depend on no machine's speed; a first
            model sooner. With 0 nothing goes on meanwhile.
        live: whether frames do not wait for models: each is in force as soon as it is there.
        given: a rest shape from elsewhere: no first model is looked for; maps keep it, and refine the lengths of a sheet.

    Attributes:
        start, latency: the same.
        first_frames: so many gave the first model.
        at_a_time: most frames that get shapes with a new one, once there is a model: all, if nothing goes on meanwhile.
    """

    def __init__(
        self,
        settings: Settings,
        start: Start = at_once,
        *,
        latency: int = 0,
        frames: int | None = None,
        live: bool = False,
        given: RestShape | None = None,
    ) -> None:
        self._settings, self.start, self.latency, self._live = settings, start, latency, live
        self.at_a_time = (LIVE_CATCH_UP if live else CATCH_UP) if latency else sys.maxsize
        self._frames = np.inf if frames is None else frames
        self._given = given
        refined = settings.refine_rest and settings.deformation in ("auto", "inextensible")
        mapped = settings.maps and (given is None or refined)
        self._keyframes = Keyframes() if mapped else None
        self._frame = -1
        # Frames, until they have given the first model.
        self._first: list[tuple[Array, Mask]] | None = [] if given is None else None
        self.first_frames = 0 if given is None else 1
        self._looks = FIRST_LOOKS if settings.bootstrap_frames == "auto" else (settings.bootstrap_frames,)
        self._looked = 0  # at so many first frames
        self._first_job: Job | None = None
        self._map_job: Job | None = None
        self._found: Map | None = None  # the last map
        self._final: Map | None = None  # the one of all frames
        self._begin: tuple[Array, Mask] | None = None  # the first frame
        self._known: Array | None = None  # the rest shape of the newest model
        self._version, self._extent = 0, 0.0  # of the keyframes when they were last looked at

    def add(self, W: Array, visible: Mask, camera: Camera, begin: tuple[Array, Mask]) -> Map | None:
        """Take the next frame; another model, if it is in force from now on.

        Args:
            W: its points (2, p) px.
            visible: (p,).
            camera: its focal length may be a guess, if it is to be estimated.
            begin: the same of the frame in which another model would begin: its first pose is near that.

        Raises:
            ReconstructionError: no rest shape can be had from the first frames.
        """
        self._frame += 1
        if self._begin is None and begin[1].sum() >= FEWEST_POINTS:
            self._begin = begin
        if self._keyframes is not None:
            self._keyframes.offer(self._frame, W, visible)
        if self._first is not None:
            if visible.sum() >= FEWEST_POINTS:
                self._first.append((W, visible))
            self._look_first(self._first, camera)
        self._look_again(camera)
        return self._in_force(begin)

    def finish(self, camera: Camera) -> Map | None:
        """The model of fewer frames than first ones are wanted, since no more come; None if there was one, or no frame.

        Raises:
            ReconstructionError: no rest shape can be had from them.
        """
        if not self._first:
            return None
        self.first_frames = max(self.first_frames, len(self._first))
        W, visible = stacked(self._first)
        found = self.final(camera, self._first) or (self._first_job and self._first_job.future.result())
        found = found or bootstrap(W, visible, camera, self._settings, True)
        return found and self._taken(found, self._begin or (W[0], visible[0]))

    def final(self, camera: Camera, frames: Iterable[tuple[Array, Mask]]) -> Map | None:
        """The map of the keyframes of all frames, posed first as in the first frame; None if they do not tell.

        Args:
            camera: as for `add`.
            frames: all of them once more, points (2, p) px and visible (p,); they are read if it is a solid.
        """
        if self._final or self._keyframes is None or not self._keyframes.frames:
            return self._final
        (W, visible, _), more = self._keyframes.spread(), cache(lambda: spread_of(frames, MORE * KEYFRAMES))
        found = map_of(W, visible, *self._told(camera, self.start), last=lambda: more()[:2])
        if found is not None and found.rest.kind == "rigid":
            found = with_deformations(found, self._settings, *more(), self.start)
        found = found or self._found
        self._final = found and self._begin and nearest_first(found, *self._begin)
        return self._final

    def _look_first(self, first: list[tuple[Array, Mask]], camera: Camera) -> None:
        """Begin a first model, if it is time."""
        n, settings = len(first), self._settings
        if self._first_job is None and n > self._looked and (n in self._looks or self._looked < self._looks[-1] < n):
            last = n >= self._looks[-1]
            frames = *stacked(first), camera, settings
            due = self._frame + int(FIRST_LATENCY * n if self.latency else 0)
            by_keyframes = last and settings.bootstrap_frames == "auto" and self._by_keyframes(first[0], camera)
            make = (first_of_all, *frames, by_keyframes) if by_keyframes else (bootstrap, *frames, last)
            # All frames of a file wait for it, and who has no other work makes the modes sooner.
            begun = self.start(with_modes, settings, *make) if self._live else self.start(*make)
            self._first_job = Job(begun, due)
            self.first_frames = self._looked = n

    def _by_keyframes(self, first: tuple[Array, Mask], camera: Camera) -> Callable[[], Map | None] | None:
        """What gives a first model by keyframes: all, or a few and the first frame, so that it comes soon."""
        if self._keyframes is None or len(self._keyframes.frames) < FEWEST:
            return None
        if not self.latency:
            return partial(on_the_way, *self._asked(camera))
        W, visible, _ = self._keyframes.spread(FEW)
        seen = np.stack([first[1], *visible])
        return partial(first_sight, np.where(seen[:, None], np.stack([first[0], *W]), np.nan), seen, camera, self._settings)

    def _look_again(self, camera: Camera) -> None:
        """Begin a map, if the keyframes have more to tell than when they were last looked at."""
        keyframes = self._keyframes
        if self._frame + self.latency >= self._frames:
            return
        if keyframes is None or self._map_job or self._frame + 1 < self._looks[-1] or len(keyframes.frames) < FEWEST:
            return
        if keyframes.extent > GROWN * self._extent or keyframes.version >= RENEWED * self._version:
            begun = self.start(with_modes, self._settings, on_the_way, *self._asked(camera))
            self._map_job = Job(begun, self._frame + self.latency)

    def _asked(self, camera: Camera) -> tuple[Any, ...]:
        """What `on_the_way` is to make a map of: the keyframes as they are now."""
        assert self._keyframes is not None
        self._version, self._extent = self._keyframes.version, self._keyframes.extent
        return self._settings, *self._keyframes.spread(), *self._told(camera, at_once)

    def _told(
        self, camera: Camera, start: Start
    ) -> tuple[Camera, bool, Array | None, Start, RestShape | None, Kind | None]:
        """What `map_of` is told beside the keyframes."""
        return camera, self._settings.estimate_focal, self._known, start, self._given, self._settings.kind

    def _in_force(self, begin: tuple[Array, Mask]) -> Map | None:
        """The model that is in force from now on, posed first as in the frame where it begins."""
        first = self._first is not None
        job = self._first_job if first else self._map_job
        if job is None or not (job.future.done() if self._live else self._frame >= job.due):
            return None
        self._first_job, self._map_job = (None, self._map_job) if first else (self._first_job, None)
        found = job.future.result()
        return found and self._taken(found, begin)

    def _taken(self, found: Map, begin: tuple[Array, Mask]) -> Map:
        """A model that is in force from now on, posed first as in the frame where it begins."""
        self._first, self._known = None, found.rest.motion.shape
        if found.evidence:
            self._found = found
        return nearest_first(found, *begin) if found.seen is not None else found  # by first frames, in their order


def stacked(frames: list[tuple[Array, Mask]]) -> tuple[Array, Mask]:
    """Frames' points as (F, 2, p) px, visible (F, p)."""
    return np.stack([W for W, _ in frames]), np.stack([visible for _, visible in frames])


def with_modes(settings: Settings, make: Callable[..., Map | None], *arguments: object) -> Map | None:
    """A map that is made with its modes, so that no frame has to wait for them."""
    found = make(*arguments)
    return found and replace(found, model=found.model or found.modelled(settings))


def on_the_way(settings: Settings, W: Array, visible: Mask, frames: Indices, *told: Any) -> Map | None:
    """The map of keyframes while more are to come; arguments as for `with_deformations` and `map_of`.

    Deformations learned from them give a better rest shape. The Gaussian does not stay: it knows none that are to come.
    """
    found = map_of(W, visible, *told)
    if found is None or found.rest.kind != "rigid":
        return found
    learned = with_deformations(found, settings, W, visible, frames, last=False)
    return replace(learned, deformations=None)


def first_of_all(
    W: Array, visible: Mask, camera: Camera, settings: Settings, by_keyframes: Callable[[], Map | None]
) -> Map | None:
    """The first model: what first frames are sure of, else what keyframes tell, else a guess by the first frames.

    Arguments as for `bootstrap`.
    """
    first = W, visible, camera, settings
    return bootstrap(*first, False) or by_keyframes() or bootstrap(*first, True)
