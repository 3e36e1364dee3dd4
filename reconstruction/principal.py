"""What points do together in several frames: probabilistic principal components, with gaps (Tipping and Bishop 1999)."""

import numpy as np

from reconstruction.arrays import Array, Mask

SWEEPS = 10  # of expectation and maximisation


def principal(tracks: Array, visible: Mask, count: int) -> tuple[Array, float]:
    """Ways in which points move.

    Args:
        tracks: (K, 2, p); anything where not visible.
        visible: (K, p), gross errors not among it.
        count: of ways, at most.

    Returns:
        how much each point takes part in each of the ways, (d, p), in units of the tracks, ways being unit vectors over all
        frames; and what share of the squares of all that is seen they explain, from 0 to 1.
    """
    K, _, p = tracks.shape
    seen = np.repeat(visible, 2, axis=0)
    known = np.where(seen, tracks.reshape(2 * K, p), 0.0)
    filled, count, total = known, min(count, p, 2 * K), max(int(seen.sum()), 1)
    tiny = np.finfo(float).tiny ** 0.5
    noise = whole = (known**2).sum() / total + tiny
    for _ in range(SWEEPS):
        variances, ways = (found[..., -count:] for found in np.linalg.eigh(filled @ filled.T / p))
        gram = np.einsum("fi,fp,fj->pij", ways, seen, ways, optimize=True)
        inverse = np.linalg.inv(gram + np.diag(noise / np.maximum(variances, tiny)))
        places = (inverse @ (ways.T @ known).T[:, :, None])[:, :, 0].T
        filled = np.where(seen, known, ways @ places)
        taken = float(np.einsum("pij,pji->", inverse, gram))  # by the places, of what is known
        noise = ((known - ways @ places)[seen] ** 2).sum() / max(total - taken, 1.0) + tiny
    return places, float(np.clip(1 - noise / whole, 0.0, 1.0))
