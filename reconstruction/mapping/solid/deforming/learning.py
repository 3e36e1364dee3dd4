"""Which deformations a solid shows, learned from its keyframes: a Gaussian of Λ', by expectation maximisation.

An image says nothing about depth. But a face opens its mouth again and again, seen from here and from there: which
coefficients go together, and how far, tells of every frame what its image leaves open. Torresani, Hertzmann and Bregler
(PAMI 2008) found this for points that are free to move; here it is done in the space of the paper's modes, and in
perspective.

Depth comes to light in hundreds of rounds (`rounds`); every two of them tell where they lead to. Early on, poses that are
mirrored in depth are put right (`reversal`).
"""

from dataclasses import replace

from reconstruction.arrays import Array, Mask
from reconstruction.basis.model import Model
from reconstruction.mapping.solid.deforming.deformations import Learned
from reconstruction.mapping.solid.deforming.reversal import righted
from reconstruction.mapping.solid.deforming.rounds import Rounds, robust, shifts
from reconstruction.mapping.solid.placing import well_spread
from reconstruction.mapping.solid.spikes import without_new_spikes
from reconstruction.state import State
from reconstruction.window.statistics import residuals

ROUNDS = 40
RIGHTED = 4  # the round after which poses are put right
POINTS = 400  # by which it is learned: dense ones are placed afterwards


def learned(
    model: Model, W: Array, visible: Mask, state: State, log_s: Array, rounds: int = ROUNDS, points: int = POINTS
) -> Learned:
    """The Gaussian, and the rest shape about which it is, from where the keyframes were found to be so far.

    Args:
        model: a solid with its modes.
        W: (K, 2, p) px; finite.
        visible: (K, p).
        state: pose and Λ' of each (n = K).
        log_s: (K,) to which scales are held.
        rounds: of expectation and maximisation.
        points: at most, by which it is learned.

    Raises:
        LinAlgError: no Gaussian holds the points.
    """
    seen, some = model.normalised(W), well_spread(model.B[:3], visible, points)
    learning = Rounds(model, some, seen[:, :, some], visible[:, some], log_s)
    path = [learning.begun(model.B, state)]
    for k in range(1, rounds + 1):
        path.append(learning.round(path[-1]))
        if k == RIGHTED:
            path = [righted(path[-1], learning)]
        if len(path) == 3:
            path = [learning.further(*path) if k < rounds - 1 else path[-1]]
    found = learning.judged(path[-1])
    B = found.B.copy()
    if len(some) < B.shape[1]:
        off = residuals(B, seen, found.state.matrices(), model.focal)
        h = visible * robust(found.deformations.noise).weight((off**2).sum(axis=1))
        B[:3] += shifts(seen, off, h, found.state, model.focal)
    B[:3] = without_new_spikes(B[:3], model.B[:3], visible)
    return replace(found, B=B)
