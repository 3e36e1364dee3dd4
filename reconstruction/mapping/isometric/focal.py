"""The focal length under which a sheet keeps its lengths best."""

from dataclasses import dataclass

import numpy as np

from reconstruction.arrays import Array
from reconstruction.mapping.isometric.adjustment import by_part, with_focal
from reconstruction.mapping.isometric.lengths import robust_lengths
from reconstruction.mapping.isometric.nodes import edges_between
from reconstruction.mapping.isometric.sheet import IsometricSheet

FACTORS = (0.4, 0.55, 0.7, 0.85, 1.0, 1.2, 1.45, 1.8, 2.3, 3.0)  # of the focal length that are tried first
CLOSER = (0.93, 1.0, 1.08)
RISE = 1.3  # times the least change of length, to which it must rise on both sides
ALIKE = 1.02  # times the least change of length, up to which the focal length assumed so far is as good
FRAMES = 15  # those that differ most tell it
EXACT = 1e-9  # change of length that is none
ENOUGH = 1.1 * RISE  # ... and beyond which no focal length is tried on that side


@dataclass(frozen=True)
class FocalSearch:
    """What a sheet says about the focal length.

    Attributes:
        focal_px: under which lengths change least.
        known: whether they change clearly more on both sides.
        tried_px: (k,) focal lengths, ascending.
        strain: (k,) typical change of length under each.
    """

    focal_px: float
    known: bool
    tried_px: Array
    strain: Array


def typical_strain(sheet: IsometricSheet) -> float:
    """Change of length of the typical edge: the geometric mean, so that the few that are on no sheet do not decide."""
    edges = edges_between(sheet.nodes, sheet.values, sheet.camera).weighted(sheet.edge_weights)
    change = robust_lengths(edges, edges.log_lengths(sheet.coefficients))[2]
    return float(np.exp(np.log(np.maximum(change, EXACT)).mean()))


def focal(sheet: IsometricSheet) -> FocalSearch:
    """Focal length by the change of length: least at the true one; the parabola through the three least, in log focal."""
    tried: dict[float, tuple[IsometricSheet, float]] = {}

    def look(focal_px: float, start: IsometricSheet) -> IsometricSheet:
        found = with_focal(start, focal_px)
        tried[focal_px] = found, typical_strain(found)
        return found

    def best() -> IsometricSheet:
        return min(tried.values(), key=lambda one: one[1])[0]

    f, middle = sheet.camera.focal_px, FACTORS.index(1.0)
    here = look(f, by_part(sheet, np.arange(min(FRAMES, len(sheet.coefficients)))))
    for side in (FACTORS[middle + 1 :], FACTORS[:middle][::-1]):
        at = here  # outwards from the middle, each from the one before
        for factor in side:
            at = look(f * factor, at)
            if tried[f * factor][1] > ENOUGH * min(strain for _, strain in tried.values()):
                break
    for factor in CLOSER:
        if (focal_px := best().camera.focal_px * factor) not in tried:
            look(focal_px, best())
    focals = np.array(sorted(tried))
    strains = np.array([tried[focal_px][1] for focal_px in focals])
    k = int(strains.argmin())
    known = min(strains[:k].max(initial=0.0), strains[k + 1 :].max(initial=0.0)) > RISE * strains[k]
    if strains[focals == f][0] < ALIKE * strains[k]:
        return FocalSearch(f, bool(known), focals, strains)
    if 0 < k < len(focals) - 1:
        x, y = np.log(focals[k - 1 : k + 2]), strains[k - 1 : k + 2] ** 2
        a, b, _ = np.polyfit(x - x[1], y, 2)
        lowest = float(np.clip(-b / (2 * a), x[0] - x[1], x[2] - x[1])) if a > 0 else 0.0
        return FocalSearch(float(np.exp(x[1] + lowest)), bool(known), focals, strains)
    return FocalSearch(float(focals[k]), False, focals, strains)
