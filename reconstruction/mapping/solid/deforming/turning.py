"""Stretches of a video whose poses are mirrored in depth: in them a thing that goes on turning seems to turn back.

Reversed (`reversal`), it turns the other way about both axes across the line of sight, and the same way about that. Limbs
that swing hide from the keyframes, one by one, which of the two is right; how it turned before and after tells.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.model import Model
from reconstruction.camera import rotation_from_quaternion
from reconstruction.mapping.solid.deforming.attempt import Attempt, Shown, modelled
from reconstruction.mapping.solid.deforming.reversal import either, in_reverse
from reconstruction.mapping.solid.deforming.rounds import shifts
from reconstruction.mapping.solid.placing import well_spread
from reconstruction.state import State, join
from reconstruction.window.energy import build_energy
from reconstruction.window.solver import Solver, minimise
from reconstruction.window.statistics import image_statistics, residuals

MIRROR = np.array([-1.0, -1.0, 1.0])  # of a velocity of turning, in camera axes
WILD = 2.5  # times the usual speed: a step across the place where poses are reversed says nothing
RELUCTANT = 0.3  # of the usual speed, that a change of sides must gain
GOES_ROUND = np.pi / 3  # between two keyframes: what shows fewer sides may as well nod
SWEEPS = 2  # of the mean shape, whose depth moves images in perspective


def unsteadiness(state: State, frames: Indices) -> float:
    """How much the velocity of turning of keyframes in the order of time changes from step to step, over its usual size.

    Args:
        state: their poses (n = K).
        frames: (K,) their numbers.
    """
    velocity, usual = tame_steps(state, frames)[1:]
    return float(np.linalg.norm(np.diff(velocity, axis=0), axis=1).mean() / usual)


def turning_back(state: State, frames: Indices) -> Mask:
    """Which of the keyframes (K,) are to be reversed so that their velocity of turning changes least; fewer than half.

    None, if it shows few sides even then.

    Arguments as for `unsteadiness`.
    """
    tame, velocity, usual = tame_steps(state, frames)
    sides = np.stack([velocity, MIRROR * velocity], axis=1)
    jumps = np.linalg.norm(sides[1:, :, None] - sides[:-1, None], axis=3)  # (n - 1, side, side before)
    jumps += RELUCTANT * usual * (1 - np.eye(2))
    total, before = np.zeros(2), list[Indices]()
    for jump in jumps:
        before.append((jump + total).argmin(axis=1))
        total = (jump + total).min(axis=1)
    side = [int(total.argmin())]
    for best in before[::-1]:
        side.append(int(best[side[-1]]))
    of_keyframes = np.searchsorted(tame, np.arange(len(frames))).clip(max=len(tame) - 1)
    back = np.array(side[::-1], np.bool_)[of_keyframes]
    back = back if back.mean() <= 0.5 else ~back
    q = either(state, in_reverse(state), back).q
    apart = 2 * np.arccos(np.abs(q @ q.T).min().clip(0, 1))
    return back & (apart > GOES_ROUND)


def tame_steps(state: State, frames: Indices) -> tuple[Indices, Array, float]:
    """The steps (n,) from keyframe to keyframe that are no wild ones, how it turns in them (n, 3), and its usual speed."""
    R = rotation_from_quaternion(state.q)
    velocity = Rotation.from_matrix(R[1:] @ R[:-1].transpose(0, 2, 1)).as_rotvec() / np.diff(frames)[:, None]
    speed = np.linalg.norm(velocity, axis=1)
    usual = max(float(np.median(speed)), np.finfo(float).tiny)
    tame = np.flatnonzero(speed <= WILD * usual)
    return tame, velocity[tame], usual


def turned_on(attempt: Attempt, shown: Shown, modes: int, points: int) -> Attempt | None:
    """What is learned anew where no keyframe turns back, by the mean shape that suits such poses; None if none does now.

    Args:
        attempt: what tells how it turns.
        shown: the keyframes.
        modes: how many.
        points: at most, by which it is learned.
    """
    model, state, B = attempt.model, attempt.known.state, attempt.known.B.copy()
    back = turning_back(state, shown.frames)
    if not back.any():
        return None
    state = either(state, in_reverse(state), back)
    state, seen = replace(state, Lambda=np.zeros_like(state.Lambda)), model.normalised(shown.W)
    for _ in range(SWEEPS):
        off = residuals(B, seen, state.matrices(), model.focal)
        B[:3] += shifts(seen, off, shown.sound.astype(np.float64), state, model.focal)
    undeformed = replace(attempt, known=replace(attempt.known, B=B, state=state))
    with suppress(np.linalg.LinAlgError):
        again = modelled(undeformed.about(shown.rigid), shown, modes)
        first, log_s = deformed(again, undeformed.carried(again), shown, points), undeformed.scales(again)
        return Attempt(again, shown.learned(again, first, log_s, points=points), log_s)
    return None


def deformed(model: Model, state: State, shown: Shown, points: int) -> State:
    """Pose and Λ' of each keyframe by itself, from where it is (n = K), by so many points at most."""
    some = well_spread(model.B[:3], shown.sound, points)
    few = model.of_points(some)
    energy = build_energy(few, "general", shown.settings.priors)
    weights = shown.sound[:, some].astype(np.float64)
    data = [image_statistics(few, w, h) for w, h in zip(shown.W[:, :, some], weights, strict=True)]
    return join([minimise(energy, one, state[k : k + 1], None, Solver()).state for k, one in enumerate(data)])
