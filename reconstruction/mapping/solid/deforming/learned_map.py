"""The map of a solid that deforms, with what its keyframes tell of its deformations."""

from dataclasses import replace

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.model import Model
from reconstruction.mapping.map import Map
from reconstruction.mapping.outliers import without_outliers
from reconstruction.mapping.solid.bundle import seen_by
from reconstruction.mapping.solid.deforming.attempt import Attempt, Shown, among_all, begun, gone_on
from reconstruction.mapping.solid.deforming.deformations import Learned
from reconstruction.mapping.solid.deforming.learning import RIGHTED, learned
from reconstruction.mapping.solid.deforming.starts import likeliest
from reconstruction.mapping.solid.placing import well_spread
from reconstruction.mapping.start import Start, at_once
from reconstruction.settings import MORE_MODES, MOST_MODES, Settings
from reconstruction.window.robust import lengths
from reconstruction.window.statistics import residuals

HIDDEN = 0.15  # of what keyframes show, to see whether it is predicted
FEW_ROUNDS = 24  # of learning on the way
TRIAL = RIGHTED  # rounds after which that is plain, and poses are put right
COMPARED = 0.75  # quantile of what most of it does
ASTRAY = 0.034  # of the size: so far off rigid things have up to 1.1 % of their points, alike beside each other, too, ...
PART = 0.02  # ... and things with a part that moves by itself from 2.9 % on
BETTER = 0.5  # times what the rigid shape is off there


def with_deformations(
    found: Map,
    settings: Settings,
    W: Array,
    visible: Mask,
    frames: Indices,
    begin: Start = at_once,
    *,
    last: bool = True,
) -> Map:
    """A solid's map with its deformations, if these predict what keyframes show in points that they are not learned from.

    Args:
        found: the map of keyframes,
        settings: and how to reconstruct; a deformation, pull to rest or smoothness that was asked for stays.
        W: (K, 2, p) px the keyframes; anything where not visible.
        visible: (K, p).
        frames: (K,) their numbers.
        begin: where a part of the work is done, meanwhile.
        last: whether there will be no other map, so that time may be spent on it. Else fewer modes, which take a quarter of
            the time, in fewer rounds, since what they leave over leads astray in many, from the rigid shape alone.
    """
    if settings.deformation not in ("auto", "general") or settings.priors.keys() & {"rest", "smoothness"}:
        return found
    order = np.argsort(frames)
    W, visible = np.where(visible[:, None], W, 0.0)[order], visible[order]
    every = Shown(found.in_order(order), settings, W, visible, without_outliers(W, visible), frames[order])
    some = well_spread(every.rigid.rest.motion.shape, every.sound)
    shown = every if len(some) == W.shape[2] else every.of_points(some)
    W, visible, rigid = shown.W, shown.visible, shown.rigid
    try:
        model, first = begun(rigid, shown, MOST_MODES if last else MORE_MODES)
        hidden = shown.sound & (np.random.default_rng(0).random(visible.shape) < HIDDEN)
        trial = learned(model, W, visible & ~hidden, first, first.log_s, TRIAL)
        if not predicted(model, W, hidden, trial, rigid):
            return found
        start, otherwise = Attempt(model, trial, first.log_s), 0.0
        if last:
            end, otherwise = likeliest(start, shown, begin)
        else:
            end = gone_on(start, shown, MORE_MODES, FEW_ROUNDS)
        if shown is not every:
            end = among_all(end, some, every)
    except np.linalg.LinAlgError:  # of points that lie as none do
        return found
    known = end.about(every.rigid)
    assert known.deformations
    return replace(known, deformations=replace(known.deformations, otherwise=otherwise)).in_order(np.argsort(order))


def predicted(model: Model, W: Array, hidden: Mask, known: Learned, rigid: Map) -> bool:
    """Whether deformations predict the points (K, p) hidden from them much better than the rigid shape fits them.

    Nothing grossly wrong is among those points.
    """
    if not hidden.any():
        return False
    off = residuals(known.B, model.normalised(W), known.state.matrices(), model.focal)
    before = (seen_by(rigid.camera, rigid.rest.motion) - W) / model.radius_px
    return much_better(lengths(off)[hidden], lengths(before)[hidden])


def much_better(now: Array, then: Array) -> bool:
    """Whether points (n,) that were so far off before are now, of the size.

    Most of them, where all of it changes; or most of those that were further off than tracks drift, where a part moves by
    itself: a few of that are never predicted.
    """
    most = np.quantile(now, COMPARED) < BETTER * np.quantile(then, COMPARED)
    part = then > ASTRAY
    return bool(most or (part.mean() > PART and np.median(now[part]) < BETTER * np.median(then[part])))
