"""What frames say of a reconstruction: residuals and their course, points seen."""

from collections.abc import Iterator
from itertools import groupby

import numpy as np

from app.arrays import Flags
from app.pipeline.quality.course import Course
from app.pipeline.quality.facing import at_once
from app.pipeline.quality.finding import Grade, Verdict
from app.pipeline.quality.keyframes import RECOVERED
from reconstruction.mapping.map import Map

# Median distance of the points seen from the mesh's image, over that image's median radius: 1 % of a sheet 300 px wide is
# 1 px. Tracks of usual video leave 0.2 to 0.5 %, noisy ones 0.9 %, what the object is not 1.5 % and more.
FAIR_ERROR, POOR_ERROR = 0.010, 0.018
# Without a map of keyframes the model is a guess by the first frames, which fits what it was made from: less is allowed.
POOR_GUESS = 0.005
# What is not seen is a guess by its neighbours.
FAIR_SHARE, POOR_SHARE = 0.5, 0.3
LIKE_A_SOLID = 1.5  # times what a sheet leaves over, up to which a solid may be what it is
# What no longer looks as it did may have slid: along edges, with highlights and shades. Printed paper on bad days has up to
# 5 %, real faces that speak 16 to 22 %; smooth drawn faces, where half of the points seen are 3 px off, from 50 % on.
FAIR_UNLIKE, POOR_UNLIKE = 0.2, 0.45
# Points that do not move with the rest: of what is reconstructed well, up to 0.6 %, gross errors or not.
MOST_ASTRAY = 0.02
LASTING = 0.1  # of the frames, in one piece: so long a bad stretch is told


def limits(poor: float, fair: float) -> list[tuple[Grade, float]]:
    """The grades that are not good, worst first, and what separates them from the better ones."""
    return [("poor", poor), ("fair", fair)]


def errors(course: Course, found: Map) -> Iterator[Verdict]:
    """What residuals say."""
    off = np.asarray(course.errors)
    guessed = found.evidence is None and found.rest.kind in RECOVERED
    for grade, limit in limits(POOR_GUESS if guessed else POOR_ERROR, FAIR_ERROR):
        bad = np.asarray(off > limit)
        if np.nanmedian(off) > limit or longest(bad)[1] >= LASTING * len(off):
            yield Verdict(grade, f"{where(course, bad)}; {remedy(found)}")
            return


def where(course: Course, bad: Flags) -> str:
    """`4.5 px from frame 115 on`."""
    first, length = longest(bad)
    last = first + length - 1
    pixels = f"{np.median(np.asarray(course.errors_px)[bad]):.2g} px"
    if bad.mean() > 1 - LASTING or not length:
        return f"{pixels} off throughout"
    if last == len(bad) - 1:
        return f"{pixels} off from frame {course.frames[first]} on"
    return f"{pixels} off in frames {course.frames[first]} to {course.frames[last]}"


def longest(bad: Flags) -> tuple[int, int]:
    """Where the longest stretch of bad frames begins, and its length."""
    best, at = (0, 0), 0
    for is_bad, run in groupby(bad.tolist()):
        length = len(list(run))
        if is_bad and length > best[1]:
            best = at, length
        at += length
    return best


def remedy(found: Map) -> str:
    """What helps against errors."""
    evidence = found.evidence
    if evidence is None:
        return "only the first frames say what it is: film it longer, turning or bending, and draw the region tightly"
    if found.sheet is not None and evidence.solid.edges_px < LIKE_A_SOLID * evidence.sheet.edges_px:
        return "looks like a turning solid; try a tighter --roi, and frames in which it turns by 10° and more"
    return "more than one thing may move there; draw the region tightly: modeshape pick, --roi or --mask"


def seen(course: Course, found: Map) -> Iterator[Verdict]:
    """What the share of points seen says, of those that may be seen at once."""
    possible = at_once(found)
    shares = np.asarray(course.shares) / possible
    points = "points" if possible == 1 else "points on the near side"
    share = float(shares.mean())
    for grade, limit in limits(POOR_SHARE, FAIR_SHARE):
        few = np.asarray(shares < limit)
        if share < limit or longest(few)[1] > 2 * LASTING * len(few):
            first, length = longest(few)
            stretch = f"in frames {course.frames[first]} to {course.frames[first + length - 1]} " if length else ""
            told = f"{stretch}less than {limit:.0%} of the {points} are seen; leave such frames out with --frames A:B"
            yield Verdict(grade, told)
            return
    if course.lost > len(shares):
        yield Verdict("fair", "the surface is out of sight most of the time; choose its frames with --frames A:B")


def astray(course: Course) -> Iterator[Verdict]:
    """What the share of points says that do not move with the rest."""
    if course.astray > MOST_ASTRAY:
        told = f"{course.astray:.0%} of the points do not move with it: a part that moves by itself, or background"
        yield Verdict("fair", f"{told}; draw the region tightly: modeshape pick, --roi or --mask")


def looks(alike: float) -> Iterator[Verdict]:
    """What the share of points says that looked as in the first frame."""
    for grade, limit in limits(POOR_UNLIKE, FAIR_UNLIKE):
        if 1 - alike > limit:
            told = f"{1 - alike:.0%} of what is seen looks otherwise than in the first frame, so points may have slid"
            yield Verdict(grade, f"{told}; film it sharper, larger, in soft light that stays, or begin with another frame")
            return
