"""The focal length under which a sheet keeps its lengths best."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.mapping.isometric.adjustment import by_part, on_smooth_images, with_focal
from reconstruction.mapping.isometric.lengths import robust_lengths
from reconstruction.mapping.isometric.sheet import IsometricSheet
from reconstruction.mapping.start import Start, at_once

FACTORS = (0.4, 0.55, 0.7, 0.85, 1.0, 1.2, 1.45, 1.8, 2.3, 3.0, 4.0)  # of the focal length that are tried first
CLOSER = 1.05  # ... and then, by all frames, in steps of this factor
MOST = 9  # of those
RISE = 1.3  # times the least change of length, to which it must rise on both sides
ALIKE = 1.02  # times the least change of length, up to which the focal length assumed so far is as good
FRAMES = 15  # those that differ most tell it roughly
EXACT = 1e-9  # change of length that is none
WELL = 0.003  # change of lengths: less is not to be had
FAR_OFF = 1.15  # times another focal length
ENOUGH = 1.1 * RISE  # ... and beyond which no focal length is tried on that side


@dataclass(frozen=True)
class FocalSearch:
    """What a sheet says about the focal length.

    Attributes:
        focal_px: under which lengths change least.
        known: whether they change clearly more on both sides, or under the focal length assumed so far.
    """

    focal_px: float
    known: bool


def typical_strain(sheet: IsometricSheet) -> float:
    """Change of length of the typical edge: the geometric mean, so that the few that are on no sheet do not decide."""
    change = robust_lengths(sheet.edges, sheet.edges.log_lengths(sheet.coefficients))[2]
    return float(np.exp(np.log(np.maximum(change, EXACT)).mean()))


def focal(sheet: IsometricSheet) -> FocalSearch:
    """Focal length by the change of length: least at the true one."""
    tried: dict[float, float] = {}

    def look(focal_px: float, start: IsometricSheet) -> IsometricSheet:
        found = with_focal(start, focal_px)
        tried[focal_px] = typical_strain(found)
        return found

    f, middle = sheet.camera.focal_px, FACTORS.index(1.0)
    here = look(f, by_part(sheet, np.arange(min(FRAMES, len(sheet.coefficients)))))
    for side in (FACTORS[middle + 1 :], FACTORS[:middle][::-1]):
        at = here  # outwards from the middle, each from the one before
        for factor in side:
            at = look(f * factor, at)
            if tried[f * factor] > ENOUGH * min(tried.values()):
                break
    focals = np.array(sorted(tried))
    strains = np.array([tried[focal_px] for focal_px in focals])
    k = int(strains.argmin())
    focal_px, least = closer(sheet, float(focals[k]))
    assumed = typical_strain(sheet)
    # A long lens shows so little perspective that a longer one changes hardly anything: the one assumed does.
    both_sides = min(strains[:k].max(initial=0.0), strains[k + 1 :].max(initial=0.0)) > RISE * strains[k]
    known = 0 < k < len(focals) - 1 and (both_sides or assumed > RISE * least)
    return FocalSearch(f if assumed < ALIKE * least else focal_px, bool(known))


def closer(sheet: IsometricSheet, near_px: float) -> tuple[float, float]:
    """Focal length of least change in all frames, near another, and that change.

    The parabola through the three least, in the logarithm of the focal length.
    """
    found = {0: with_focal(sheet, near_px)}
    strain = {0: typical_strain(found[0])}
    best = 0
    while len(strain) < MOST and not {best - 1, best + 1} <= strain.keys():
        for k in {best - 1, best + 1} - strain.keys():
            found[k] = with_focal(found[best], near_px * CLOSER**k)
            strain[k] = typical_strain(found[k])
        best = min(strain, key=strain.__getitem__)
    if not {best - 1, best + 1} <= strain.keys():
        return float(near_px * CLOSER**best), strain[best]
    less, least, more = (strain[best + side] ** 2 for side in (-1, 0, 1))
    lowest = (less - more) / max(2 * (less - 2 * least + more), EXACT**2)
    return float(near_px * CLOSER ** (best + np.clip(lowest, -1, 1))), strain[best]


def under(
    found: IsometricSheet, focal_px: float, finish: Callable[[IsometricSheet], IsometricSheet], start: Start = at_once
) -> IsometricSheet:
    """A sheet under another focal length, finished; where that is far off, started anew as well: it may be folded wrongly.

    Args:
        found: the sheet under the focal length assumed so far.
        focal_px: the other one.
        finish: what is to be done with the sheet that keeps its lengths better.
        start: where it is started anew, meanwhile.

    Raises:
        what `finish` raises.
    """
    near = with_focal(found, focal_px)
    if near.strain_rms < WELL or max(focal_px, found.camera.focal_px) < FAR_OFF * min(focal_px, found.camera.focal_px):
        return finish(near)
    begun = start(on_smooth_images, found.warps, near.camera)
    meanwhile = None if begun.done() else at_once(finish, near)
    with suppress(ReconstructionError):
        anew: IsometricSheet = begun.result()
        if typical_strain(anew) < typical_strain(near):
            return finish(anew)
    sheet: IsometricSheet = meanwhile.result() if meanwhile else finish(near)
    return sheet
