"""The focal length under which a sheet keeps its lengths best."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array
from reconstruction.mapping.isometric.adjustment import SOLVER
from reconstruction.mapping.isometric.lengths import adjust_depths, mean_log_lengths, usual
from reconstruction.mapping.isometric.nodes import edges_between
from reconstruction.mapping.isometric.sheet import IsometricSheet

FACTORS = (0.55, 0.7, 0.85, 1.0, 1.2, 1.45, 1.8)  # of the focal length that are tried first
CLOSER = (0.93, 1.0, 1.08)
RISE = 1.5  # times the least change of length, to which it must rise on both sides
ALIKE = 1.02  # times the least change of length, up to which the focal length assumed so far is as good
ENOUGH = 1.1 * RISE  # ... and beyond which no focal length is tried on that side


@dataclass(frozen=True)
class FocalSearch:
    """What a sheet says about the focal length.

    Attributes:
        focal_px: under which lengths change least.
        known: whether they change clearly more on both sides.
        tried_px: (k,) focal lengths, ascending.
        strain_rms: (k,) change of length under each.
    """

    focal_px: float
    known: bool
    tried_px: Array
    strain_rms: Array


def with_focal(sheet: IsometricSheet, focal_px: float) -> IsometricSheet:
    """The same keyframes under another focal length, adjusted from the shapes there are, edges weighted as they are."""
    camera = replace(sheet.camera, focal_px=focal_px)
    edges = edges_between(sheet.nodes, sheet.values, camera).weighted(sheet.edge_weights)
    c = adjust_depths(edges, sheet.coefficients, sheet.field.stiffness, SOLVER)
    g = edges.log_lengths(c)
    off = g - (logs := mean_log_lengths(edges, g))
    return replace(
        sheet, coefficients=c, log_lengths=logs, strain=edges.rms(off), change=usual(off), bend=SOLVER.bend, camera=camera
    )


def focal(sheet: IsometricSheet) -> FocalSearch:
    """Focal length by the change of length: least at the true one; the parabola through the three least, in log focal."""
    tried: dict[float, float] = {}

    def look(focal_px: float, start: IsometricSheet) -> IsometricSheet:
        found = with_focal(start, focal_px)
        tried[focal_px] = found.strain_rms
        return found

    f, middle = sheet.camera.focal_px, FACTORS.index(1.0)
    here = look(f, sheet)
    for side in (FACTORS[middle + 1 :], FACTORS[:middle][::-1]):
        at = here  # outwards from the middle, each from the one before
        for factor in side:
            at = look(f * factor, at)
            if at.strain_rms > ENOUGH * min(tried.values()):
                break
    for factor in CLOSER:
        best = min(tried, key=lambda k: tried[k])
        if best * factor not in tried:
            look(best * factor, here)
    focals = np.array(sorted(tried))
    strains = np.array([tried[k] for k in focals])
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
