"""How good a reconstruction is, in a word, with the reason and what helps: thresholds on what is known without the truth.

[docs/verdict.md](../../../docs/verdict.md) has what the words were worth where the truth is known, and how it was measured.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Literal

import numpy as np

from app.arrays import Flags
from app.pipeline.quality.course import Course
from reconstruction.basis.rest_shape import RigidMotion, rms_radius
from reconstruction.mapping.isometric.sheet import USUAL_STRETCH, IsometricSheet
from reconstruction.mapping.map import FEWEST_POINTS, Map
from reconstruction.mapping.selection import PLAIN, Evidence
from reconstruction.mapping.solid.rivals import HARDLY_TURNED
from reconstruction.mapping.solid.solid import relief

Grade = Literal["good", "fair", "poor"]
GRADES: tuple[Grade, ...] = ("poor", "fair", "good")

# Median distance of the points seen from the mesh's image, over the RMS radius of that image: 1 % of a sheet 300 px wide is
# 1 px. Tracks of usual video leave 0.2 to 0.5 %, noisy ones 0.9 %, what the object is not 1.5 % and more.
FAIR_ERROR, POOR_ERROR = 0.010, 0.018
# Without a map of keyframes the model is a guess by the first frames, which fits what it was made from: less is allowed.
POOR_GUESS = 0.005
# What is not seen is a guess by its neighbours.
FAIR_SHARE, POOR_SHARE = 0.5, 0.3
FEW_POINTS = 40  # of a sheet in a usual frame: bends between fewer are a guess
POOR_STRAIN = 0.018  # of lengths, by noise or not: no depths have been found that keep them
POOR_LENGTHS = 0.07  # change of them from half to half of the keyframes: sheets have up to 4.5 %, things with limbs 8 %
TOSS_UP = 1.2  # sureness, up to which another kind of thing may be as true
# What a rigid shape leaves over and neighbours share, which is no noise, over its radius and the sine of its turn: as much
# its depth may be off, and more.
FAIR_DEPTH = 0.0125
FAIR_CHANGE, POOR_CHANGE = 0.028, 0.04  # the same with noise, over the radius alone: what changes is no longer small
WITH_TURN = 0.7  # share of its changes: what nods and speaks has up to 0.66, what turns once while it swells once 0.85
OFTEN, MOST_RARE = 0.1, 0.03  # of a solid's keyframes must show a point, and share of those that fewer show
OTHERWISE_DEEP = 1.6  # times the relief by half of the keyframes: solids that are, cans at most, have up to 1.4
LIKE_A_SOLID = 1.5  # times what a sheet leaves over, up to which a solid may be what it is
SURELY = 2.4  # sureness of a sheet that nothing turns: cloth that stretches has up to 2.1, rolled paper 2.7 and more
MOSTLY = 2.4  # times what a solid leaves over a plane must: rigid ones, turned by 8°, have 2.9 and more, limbs up to 1.5
RECOVERED = ("rigid", "plane")  # by the first frames
BY_KEYFRAMES = {"isometric": "sheet", "rigid": "solid", "plane": "flat sheet"}  # kinds of rest shapes, in words
LASTING = 0.1  # of the frames, in one piece: so long a bad stretch is told


@dataclass(frozen=True)
class Verdict:
    """A word, the reason, and what helps."""

    grade: Grade
    reason: str

    @property
    def line(self) -> str:
        """`poor: 4.5 px from frame 115 on; …`."""
        return f"{self.grade}: {self.reason}"


MIRRORED = Verdict(
    "fair",
    "without perspective a bend and its mirror image look alike, so some frames may bend the other way; "
    "give the camera: K in the file, or --focal",
)


def verdict(course: Course, found: Map | None, bits_per_px: float | None = None) -> Verdict:
    """The verdict on shapes of frames.

    Args:
        course: what each frame tells.
        found: what the object is taken for; None if there is no model.
        bits_per_px: what the video's encoder spent, if that is so little that what is seen may not be what was there.
    """
    if found is None or np.isnan(np.asarray(course.errors)).all():
        return Verdict("poor", "there is no shape; the video is too short, or the surface has too little texture")
    findings = [*errors(course, found), *seen(course)]
    if bits_per_px is not None:
        told = f"compressed to {bits_per_px:.2g} bits a pixel, texture is made up between key pictures; export it with more"
        findings.append(Verdict("poor", told))
    findings += evidence(found, known=bool(findings))
    worst: Grade = next((grade for grade in GRADES if any(one.grade == grade for one in findings)), "good")
    reasons = [one.reason for one in findings if one.grade == worst]
    return Verdict(worst, "; ".join(reasons) or praise(course, found))


def limits(poor: float, fair: float) -> list[tuple[Grade, float]]:
    """The grades that are not good, worst first, and what separates them from the better ones."""
    return [("poor", poor), ("fair", fair)]


def praise(course: Course, found: Map) -> str:
    """Why it is good."""
    kind = f"a {BY_KEYFRAMES[found.rest.kind]}" if found.rest.kind in BY_KEYFRAMES else "as given"
    return f"{np.nanmedian(course.errors_px):.2g} px, {np.mean(course.shares):.0%} of the points seen, {kind} in many views"


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


def seen(course: Course) -> Iterator[Verdict]:
    """What the share of points seen says."""
    shares = np.asarray(course.shares)
    share = float(shares.mean())
    for grade, limit in limits(POOR_SHARE, FAIR_SHARE):
        few = np.asarray(shares < limit)
        if share < limit or longest(few)[1] > 2 * LASTING * len(few):
            first, length = longest(few)
            stretch = f"in frames {course.frames[first]} to {course.frames[first + length - 1]} " if length else ""
            told = f"{stretch}less than {limit:.0%} of the points are seen; leave such frames out with --frames A:B"
            yield Verdict(grade, told)
            return
    if course.lost > len(shares):
        yield Verdict("fair", "the surface is out of sight most of the time; choose its frames with --frames A:B")


def evidence(found: Map, *, known: bool) -> Iterator[Verdict]:
    """What keyframes say; that there are none goes without saying where something worse is known."""
    count = found.rest.motion.shape.shape[1]
    if count < FEWEST_POINTS:
        yield Verdict("fair", f"known by {count} points: what it does between them is a guess; follow more")
    if found.evidence is None:
        if found.rest.kind in RECOVERED and not known:
            told = "only the first frames say what it is, depth may be a guess"
            yield Verdict("fair", f"{told}; film it turning or bending more, from near by")
        if found.rest.kind not in RECOVERED and found.rest.flat and not found.camera.perspective:
            yield MIRRORED
        return
    made = BY_KEYFRAMES.get(found.rest.kind)
    says = "flat sheet" if found.evidence.kind == "flat" else found.evidence.kind
    if made not in (None, says):
        grade: Grade = "poor" if found.evidence.sureness > PLAIN else "fair"
        yield Verdict(grade, f"keyframes say that it is a {says}, not a {made}")
    if found.evidence.sureness < TOSS_UP and not surely_flat(found.evidence):
        told = "another kind of thing would leave about as much over, so depth may be a guess"
        yield Verdict("fair", f"{told}; film it turning or bending more, from near by")
    if made and found.rest.kind != "plane":
        yield from of_turn(found, found.evidence)
    if found.rest.kind == "rigid":
        yield from of_solid(found.rest.motion, found.evidence)
        if found.deformations is not None and found.deformations.turning > WITH_TURN:
            told = f"{found.deformations.turning:.0%} of its changes go with its turn: which is which is a guess"
            yield Verdict("fair", f"{told}; film it turning while it keeps its shape")
        rare = 0.0 if found.seen is None else float((found.seen.mean(axis=0) < OFTEN).mean())
        if rare > MOST_RARE:
            yield Verdict("fair", f"{rare:.0%} of the points are seen too seldom to tell where they are; film them longer")
    if found.sheet is not None:
        yield from of_sheet(found.sheet, found.evidence, perspective=found.camera.perspective)


def surely_flat(evidence: Evidence) -> bool:
    """Whether it is flat, and nothing else would leave much less: a solid or sheet that leaves as much is as flat."""
    flat, solid = evidence.flat, evidence.solid
    least_px = float(np.nanmin([solid.edges_px, evidence.sheet.edges_px]))
    as_well = flat.whole_px <= TOSS_UP * solid.whole_px and flat.edges_px <= TOSS_UP * least_px
    return evidence.kind == "flat" and as_well


def of_turn(found: Map, evidence: Evidence) -> Iterator[Verdict]:
    """What a small turn says: what deforms seems to turn, too."""
    changes = found.deformations is not None or evidence.flat.whole_px < MOSTLY * evidence.solid.whole_px
    surely_bends = found.sheet is not None and evidence.sureness > SURELY
    if evidence.turn_degrees >= HARDLY_TURNED or surely_bends or (evidence.proven and not changes):
        return
    told = f"turned by {evidence.turn_degrees:.0f}° alone, it shows hardly more of its depth than of its changes"
    keeps_lengths = found.sheet is not None and found.sheet.stretch < USUAL_STRETCH
    grade: Grade = "fair" if evidence.proven or keeps_lengths else "poor"
    yield Verdict(grade, f"{told}: how deep it is is a guess; film it turning more")


def of_solid(motion: RigidMotion, evidence: Evidence) -> Iterator[Verdict]:
    """What a solid's changes, turn and depth say."""
    radius_px = float(np.median(motion.s)) * rms_radius(motion.shape)  # in the images: the shape may have any size
    whole, edges = np.array([evidence.solid.whole_px, evidence.solid.edges_px]) / radius_px
    turn = evidence.turn_degrees
    if turn >= HARDLY_TURNED and evidence.flat.whole_px < MOSTLY * evidence.solid.whole_px:
        told = "a plane would leave hardly more over, so how deep it is is a guess"
        yield Verdict("fair", f"{told}; draw the region tightly, film it turning more than it changes")
    depth = np.sqrt(max(whole**2 - edges**2, 0.0)) / np.sin(np.radians(np.clip(turn, 1.0, 90.0)))
    if depth > FAIR_DEPTH or whole > FAIR_CHANGE:
        told = f"a solid that changes by {whole:.1%} of its size while it turns by {turn:.0f}°: how deep it is is a guess"
        yield Verdict("poor" if whole > POOR_CHANGE else "fair", f"{told}; film it turning more")
    deep, half = relief(motion.shape), evidence.relief
    if max(deep, half) > OTHERWISE_DEEP * min(deep, half):
        told = f"as deep as {deep:.2f} of its width, by half of the keyframes {half:.2f}: depth is a guess"
        yield Verdict("fair", f"{told}; film it turning more")


def of_sheet(found: IsometricSheet, evidence: Evidence, *, perspective: bool) -> Iterator[Verdict]:
    """What a sheet's lengths, points and camera say."""
    if not perspective:
        yield MIRRORED
    count = int(np.median((found.warps.weights > 0).sum(axis=1)))
    if count < FEW_POINTS:
        yield Verdict("fair", f"a sheet by {count} points a frame: what it does between them is a guess; follow more")
    if found.strain_rms > POOR_STRAIN:
        yield Verdict("poor", f"its lengths change by {found.strain_rms:.1%}: no shapes have been found that keep them")
    elif evidence.length_change > POOR_LENGTHS:
        told = f"its lengths differ by {evidence.length_change:.0%} from half to half of the keyframes"
        yield Verdict(
            "poor", f"{told}: it may be no sheet, or it is lost in noise; draw the region tightly, film it sharper"
        )
    elif found.stretch > USUAL_STRETCH:
        why = f"its lengths change by {found.stretch:.1%}: it stretches, has creases, or fine folds"
        yield Verdict("fair", f"{why}; if it is a solid: --rest-shape solid")
