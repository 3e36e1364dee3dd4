"""Where learning a solid's deformations begins: at the rigid shape, or at another mean shape that few modes speak for."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from reconstruction.basis.rest_shape import RigidMotion, apart
from reconstruction.camera import nearest_rotation
from reconstruction.mapping.first.factorization import rotations_from_rows
from reconstruction.mapping.solid.bundle import Bundle
from reconstruction.mapping.solid.deforming.attempt import Attempt, Shown, begun, gone_on
from reconstruction.mapping.solid.deforming.learning import POINTS, RIGHTED
from reconstruction.mapping.solid.deforming.low_rank import posed
from reconstruction.mapping.solid.deforming.turning import turned_on, unsteadiness
from reconstruction.mapping.start import Start, at_once
from reconstruction.settings import USUAL_MODES

STARTS = (2, 10.0), (4, 10.0), (2, 1e3), (3, 1e3)  # so many shapes; points so many deviations off may be wrong, or swing
FEW_POINTS = 100  # by which it is seen whether they have
DEPTHS = 1.0, 0.5, 0.7  # times as deep as the rigid shape
LIKELIER = 0.1  # of minus the log likelihood of an image point: less is for errors of tracks
ALIKE = 0.15  # of it: shapes that are less likely by less are to be reckoned with


def likeliest(start: Attempt, shown: Shown, begin: Start = at_once) -> tuple[Attempt, float]:
    """Where many modes lead to from there, or from another mean shape if that makes much likelier what keyframes show.

    And how far apart (`apart`) shapes are that few modes find about as likely.

    Many modes explain wrong poses by deformations. So all are compared by few modes and few points: what many have found,
    told by few, with what few find themselves. Mean shapes are the rigid one, by factorisation (`low_rank`), or shallower.
    But few modes cannot follow small folds, and then wrong poses suit them best: many modes must find the best of them
    likelier, too, unless they would explain anything.
    Last comes what is learned where poses do not turn back (`turning`), if it turns more steadily and few modes find it
    about as likely.

    Args:
        start: where learning about the rigid shape has begun.
        shown: the keyframes.
        begin: where a part of the work is done.

    Raises:
        LinAlgError: no Gaussian holds the points.
    """
    motion, camera = shown.rigid.rest.motion, shown.rigid.camera
    seen = shown.W - camera.center_px[:, None], shown.visible, Bundle(motion, 1 / camera.focal_px)
    try_one = partial(tried, shown)
    first, *flatter = [partial(shallower, motion, depth) for depth in DEPTHS]
    elsewhere = begin(each, try_one, [first, *(partial(posed, *seen, *one) for one in STARTS)])
    usual = gone_on(start, shown)
    told = gone_on(usual, shown, USUAL_MODES, RIGHTED, FEW_POINTS)
    here = each(try_one, flatter)
    finds = [one for one in (*elsewhere.result(), *here) if one]
    best = min(finds, key=lambda one: one.unlikeliness, default=told)
    one, end = told, usual
    if best.unlikeliness < told.unlikeliness - LIKELIER:
        one, end = further(best, shown, (one, end))
    if turned := turned_on(end, shown, USUAL_MODES, FEW_POINTS):
        finds.append(turned)
        steadier = unsteadiness(turned.known.state, shown.frames) < unsteadiness(end.known.state, shown.frames)
        if steadier and turned.unlikeliness < one.unlikeliness + LIKELIER:
            one, end = further(turned, shown, (one, end))
    if end is usual and finds:
        one = finds[0]  # of few modes by themselves: those of many differ from all of theirs
    alike = [other for other in finds if other.unlikeliness < one.unlikeliness + ALIKE]
    mirrored = not camera.perspective
    otherwise = max((apart(one.known.shapes, other.known.shapes, mirrored=mirrored) for other in alike), default=0.0)
    return end, otherwise


def further(one: Attempt, shown: Shown, known: tuple[Attempt, Attempt]) -> tuple[Attempt, Attempt]:
    """What few modes have found, and what many make of it; what is known in both ways if many do not find it likelier."""
    end = gone_on(one, shown)
    return (one, end) if end.unlikeliness < known[1].unlikeliness or explains_anything(end, shown) else known


def explains_anything(attempt: Attempt, shown: Shown) -> bool:
    """Whether the Λ' of a keyframe has as many unknowns as the usual image has coordinates."""
    points = min(float(np.median(shown.visible.sum(axis=1))), POINTS)
    return bool(3 * len(attempt.model.basis.eigenvalues) >= 2 * points)


def each(
    make: Callable[[Callable[[], RigidMotion]], Attempt | None], means: Sequence[Callable[[], RigidMotion]]
) -> list[Attempt | None]:
    """What is made of each."""
    return [make(mean) for mean in means]


def tried(shown: Shown, mean: Callable[[], RigidMotion]) -> Attempt | None:
    """What few modes and points tell about another mean shape; None if no Gaussian holds the points."""
    with suppress(np.linalg.LinAlgError):
        rigid = shown.rigid
        found = replace(rigid, rest=replace(rigid.rest, motion=mean()), model=None)
        model, first = begun(found, shown, USUAL_MODES, FEW_POINTS)
        return Attempt(model, shown.learned(model, first, first.log_s, points=FEW_POINTS), first.log_s)
    return None


def shallower(motion: RigidMotion, factor: float) -> RigidMotion:
    """A shape so many times as deep along the usual line of sight, and turned further for that (bas-relief).

    What swells while it turns may look like either.
    """
    usual = nearest_rotation(motion.R.sum(axis=0))
    rows = (motion.R @ usual.T)[:, :2]
    rows[:, :, 2] /= factor
    return replace(motion, shape=np.diag([1.0, 1.0, factor]) @ usual @ motion.shape, R=rotations_from_rows(rows))
