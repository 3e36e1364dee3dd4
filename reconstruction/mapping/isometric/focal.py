"""The focal length under which a sheet keeps its lengths best."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.mapping.isometric.adjustment import by_part, on_smooth_images, with_focal
from reconstruction.mapping.isometric.lengths import robust_lengths
from reconstruction.mapping.isometric.sheet import IsometricSheet

FACTORS = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)  # of the focal length assumed, that are tried first: lenses there are
CLOSER = 1.075  # ... and then, by all frames, in steps of this factor
BESIDE = 2  # of those to each side of the least change: fewer hang on single edges
WALKS = 4  # to where lengths change less
RISE = 1.3  # times the least change of length, to which it rises on both sides where that alone is sure
LESS = 1.05  # times less must change than under the focal length assumed
AGAIN = 3  # times at most a sheet is made anew
FRAMES = 15  # those that differ most tell it roughly
EXACT = 1e-9  # change of length that is none
WELL = 0.003  # change of lengths: less is not to be had
UNSURE = 0.6  # deviation of the logarithm of a focal length, times the bend of the logarithm of the change by it
GUESS = 0.35  # the same of lenses there are
ENOUGH = 1.1 * RISE  # ... and beyond which no focal length is tried on that side


def typical_strain(sheet: IsometricSheet) -> float:
    """Change of length of the typical edge: the geometric mean, so that the few that are on no sheet do not decide."""
    change = robust_lengths(sheet.edges, sheet.edges.log_lengths(sheet.coefficients))[2]
    return float(np.exp(np.log(np.maximum(change, EXACT)).mean()))


def under_its_focal_length(assumed: IsometricSheet) -> IsometricSheet:
    """The sheet under the focal length at which its lengths change least, or as it is where they do not tell.

    They tell where they change clearly more on both sides, or under the focal length assumed so far, and there are such
    lenses.

    A sheet made under a wrong focal length remembers it: it stays bent as it was, and lengths change least somewhere
    between. So where another is found far off, it is made anew under that, and asked again.

    Args:
        assumed: the sheet under the focal length assumed so far.
    """
    rough_px, both_sides = roughly(assumed)
    made, found = assumed, closer(with_focal(assumed, rough_px))
    for _ in range(AGAIN):
        if found.strain_rms < WELL or near(made, found):
            break
        made = found
        found = closer(made_anew(made))
    # A long lens shows so little perspective that a longer one changes hardly anything: the one assumed does.
    less = both_sides or typical_strain(assumed) > LESS * typical_strain(found)
    known = less and FACTORS[0] < found.camera.focal_px / assumed.camera.focal_px < FACTORS[-1]
    return found if known else replace(assumed, by_focal=found.by_focal)


def roughly(sheet: IsometricSheet) -> tuple[float, bool]:
    """Focal length of least change in the frames that differ most, and whether it is clearly more on both sides."""
    tried: dict[float, float] = {}

    def look(focal_px: float, begun: IsometricSheet) -> IsometricSheet:
        found = with_focal(begun, focal_px)
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
    sides = min(strains[:k].max(initial=0.0), strains[k + 1 :].max(initial=0.0))
    return float(focals[k]), bool(sides > RISE * strains[k])


def closer(made: IsometricSheet) -> IsometricSheet:
    """The sheet under the focal length of least change in all frames, near its own.

    The lowest place of a parabola through the logarithm of the change, by that of the focal length. The less it is bent,
    the further off both may be (`by_focal`).
    """
    found, change = {0: made}, {0: np.log(typical_strain(made))}
    for _ in range(WALKS):
        best = min(change, key=change.__getitem__)
        beside = range(best - BESIDE, best + BESIDE + 1)
        for k in sorted(set(beside) - found.keys(), key=abs):  # outwards, each from the one before
            found[k] = with_focal(found[k - int(np.sign(k))], made.camera.focal_px * CLOSER**k)
            change[k] = np.log(typical_strain(found[k]))
    bend, slope, _ = np.polyfit(beside, [change[k] for k in beside], 2)
    step = np.log(CLOSER)
    surely = np.hypot(max(bend, 0.0) / (UNSURE * step**2), 1 / GUESS)
    by_focal = apart(found[best - 1], found[best + 1]) / (2 * step * surely)
    least = found[best]
    if bend > 0:
        lowest = np.clip(-slope / (2 * bend), beside[0], beside[-1])
        least = with_focal(least, float(made.camera.focal_px * CLOSER**lowest))
    return replace(least, by_focal=by_focal)


def apart(one: IsometricSheet, other: IsometricSheet) -> float:
    """How far the shapes of two sheets in the same frames are apart, RMS over their size, in the median frame."""
    shapes = np.stack([one.shapes(), other.shapes()])
    shapes = shapes[..., np.isfinite(shapes).all(axis=(0, 1, 2))]
    shapes = shapes - shapes.mean(axis=3, keepdims=True)
    a, b = shapes / np.sqrt((shapes**2).sum(axis=(2, 3), keepdims=True))
    return float(np.median(np.sqrt(((a - b) ** 2).sum(axis=(1, 2)))))


def made_anew(found: IsometricSheet) -> IsometricSheet:
    """The sheet that its images show without it, if that keeps its lengths better."""
    with suppress(ReconstructionError):
        return min(found, on_smooth_images(found.warps, found.camera), key=typical_strain)
    return found


def near(one: IsometricSheet, other: IsometricSheet) -> bool:
    """Whether the focal lengths of two sheets are alike, but for a step."""
    return bool(abs(np.log(one.camera.focal_px / other.camera.focal_px)) < np.log(CLOSER))
