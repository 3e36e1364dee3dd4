"""What keyframes say of a reconstruction: whether its kind, its depth and its lengths are to be trusted."""

from collections.abc import Iterator

import numpy as np

from app.pipeline.quality.facing import missed
from app.pipeline.quality.finding import Grade, Verdict
from reconstruction.basis.rest_shape import RigidMotion, apart
from reconstruction.mapping.isometric.sheet import USUAL_STRETCH, IsometricSheet
from reconstruction.mapping.map import FEWEST_POINTS, Map
from reconstruction.mapping.selection import PLAIN, Evidence
from reconstruction.mapping.solid.deforming.deformations import Deformations
from reconstruction.mapping.solid.rivals import HARDLY_TURNED

FEW_POINTS = 40  # of a sheet in a usual frame: bends between fewer are a guess
POOR_STRAIN = 0.018  # of lengths, by noise or not: no depths have been found that keep them
POOR_LENGTHS = 0.07  # change of them from half to half of the keyframes: sheets have up to 4.5 %, things with limbs 8 %
TOSS_UP = 1.2  # sureness, up to which another kind of thing may be as true
NO_PLANE = 1.5  # times as much as others, that a plane leaves over of what bends;
NO_PLANE_OFF = 0.0065  # and share of its radius
# What a rigid shape leaves over and neighbours share, which is no noise, over its radius and the sine of its turn: as much
# its depth may be off, and more.
FAIR_DEPTH = 0.0135
FAIR_CHANGE, POOR_CHANGE = 0.031, 0.044  # the same with noise, over the radius alone: what changes is no longer small
FAR_TURNED = 90.0  # degrees: views of a solid that turns farther share few points
# Share of its changes: what nods and speaks has up to 0.66, what turns once while it swells once 0.85, who chews 0.93.
WITH_TURN, ALL_WITH_TURN = 0.7, 0.95
FAIR_OPEN, POOR_OPEN = 0.035, 0.05  # of its size, by which images leave shapes open: poses right, as far off as they are
AS_LIKELY = 0.1  # of its size, that shapes about as likely are elsewhere: heads have up to 0.07, hearts 0.2
OFTEN, MOST_RARE = 0.1, 0.03  # of a solid's keyframes must show a point, and share of those that fewer show
MOST_MISSED = 0.04  # share of points lost where they should show: heads up to 0.015, a jaw 0.05, a lid 0.08
OTHERWISE = 0.15  # of its size, that half of the keyframes find a solid elsewhere: those that deform have up to 0.1
FAIR_BY_FOCAL, POOR_BY_FOCAL = 0.02, 0.05  # of its size, that shapes may be off by a focal length that was looked for
SURELY = 3.0  # sureness of a sheet that nothing turns: cloth that stretches has up to 2.9, rolled paper 1.6 to 3.6
MOSTLY = 2.4  # times what a solid leaves over a plane must: rigid ones, turned by 8°, have 2.9 and more, limbs up to 1.5
RECOVERED = {"isometric": "sheet", "rigid": "solid", "plane": "flat sheet"}  # rest shapes that frames have told, in words

MIRRORED = Verdict(
    "fair",
    "without perspective a bend and its mirror image look alike, so some frames may bend the other way; "
    "give the camera: K in the file, or --focal",
)


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
    made = RECOVERED.get(found.rest.kind)
    says = "flat sheet" if found.evidence.kind == "flat" else found.evidence.kind
    if made not in (None, says):
        grade: Grade = "poor" if found.evidence.sureness > PLAIN else "fair"
        yield Verdict(grade, f"keyframes say that it is a {says}, not a {made}")
    if toss_up(found.evidence):
        told = "another kind of thing would leave about as much over, so depth may be a guess"
        yield Verdict("fair", f"{told}; film it turning or bending more, from near by")
    if found.rest.kind == "plane":
        yield from of_plane(found.rest.motion, found.evidence, perspective=found.camera.perspective)
    if made and found.rest.kind != "plane":
        yield from of_turn(found, found.evidence)
    if found.rest.kind == "rigid":
        yield from of_solid(found, found.evidence)
    if found.sheet is not None:
        yield from of_sheet(found.sheet, found.evidence, perspective=found.camera.perspective)


def toss_up(evidence: Evidence) -> bool:
    """Whether something else may be as true. A solid or sheet that leaves as much over as a plane is as flat: none is."""
    return more_than_others(evidence) > TOSS_UP if evidence.kind == "flat" else evidence.sureness < TOSS_UP


def more_than_others(evidence: Evidence) -> float:
    """How many times as much a plane leaves over as something else does."""
    flat, solid = evidence.flat, evidence.solid
    least_px = float(np.nanmin([solid.edges_px, evidence.sheet.edges_px]))
    return max(flat.whole_px / max(solid.whole_px, 1e-9), flat.edges_px / max(least_px, 1e-9))


def of_plane(motion: RigidMotion, evidence: Evidence, *, perspective: bool) -> Iterator[Verdict]:
    """What a plane says that leaves much over: it bends."""
    if evidence.flat.whole_px < NO_PLANE_OFF * radius_px(motion):
        return
    if not perspective:
        yield MIRRORED
    told_px = max(float(np.nan_to_num(evidence.told_px, nan=np.inf)), 1e-9)  # by a sheet that knows its lengths
    more = max(more_than_others(evidence), evidence.flat.edges_px / told_px)
    if more > NO_PLANE:
        told = f"drawn flat, though a shape with depth leaves {more:.1f} times less over"
        yield Verdict("poor", f"{told}: it may bend; film it turning more, from near by, or try --rest-shape sheet")


def radius_px(motion: RigidMotion) -> float:
    """RMS radius of a rigid shape's usual image: what is too deep by far is no larger for that."""
    images = motion.R[:, :2] @ motion.shape
    return float(np.median(motion.s * np.sqrt(images.var(axis=2).sum(axis=1))))


def of_turn(found: Map, evidence: Evidence) -> Iterator[Verdict]:
    """What a small turn says: what deforms seems to turn, too."""
    changes = found.deformations is not None or hardly_more_than_a_plane(evidence)
    surely_bends = found.sheet is not None and evidence.sureness > SURELY
    if evidence.turn_degrees >= HARDLY_TURNED or surely_bends or (evidence.proven and not changes):
        return
    told = f"turned by {evidence.turn_degrees:.0f}° alone, it shows hardly more of its depth than of its changes"
    keeps_lengths = found.sheet is not None and found.sheet.stretch < USUAL_STRETCH
    grade: Grade = "fair" if evidence.proven or keeps_lengths else "poor"
    yield Verdict(grade, f"{told}: how deep it is is a guess; film it turning more")


def hardly_more_than_a_plane(evidence: Evidence) -> bool:
    """Whether a plane leaves hardly more over than a solid does."""
    return evidence.flat.whole_px < MOSTLY * evidence.solid.whole_px


def of_solid(found: Map, evidence: Evidence) -> Iterator[Verdict]:
    """What a solid's changes, turn, depth and points say."""
    motion = found.rest.motion
    whole, edges = np.array([evidence.solid.whole_px, evidence.solid.edges_px]) / radius_px(motion)
    turn = evidence.turn_degrees
    if turn >= HARDLY_TURNED and hardly_more_than_a_plane(evidence):
        told = "a plane would leave hardly more over, so how deep it is is a guess"
        yield Verdict("fair", f"{told}; draw the region tightly, film it turning more than it changes")
    depth = np.sqrt(max(whole**2 - edges**2, 0.0)) / np.sin(np.radians(np.clip(turn, 1.0, 90.0)))
    if depth > FAIR_DEPTH or whole > FAIR_CHANGE:
        told = f"a solid that changes by {whole:.1%} of its size while it turns by {turn:.0f}°: how deep it is is a guess"
        yield Verdict("poor" if whole > POOR_CHANGE else "fair", f"{told}; film it turning more")
    at_worst: Grade = "poor" if turn > FAR_TURNED else "fair"  # its sides may be put together wrongly
    off = 0.0
    if evidence.shape is not None:
        known = np.isfinite(evidence.shape).all(axis=0)
        half, all_of_them = evidence.shape[None, :, known], motion.shape[None, :, known]
        off = apart(half, all_of_them, mirrored=not found.camera.perspective)
    if off > OTHERWISE:
        told = f"half of the keyframes find it otherwise, by {off:.0%} of its size: how deep it is is a guess"
        yield Verdict(at_worst, f"{told}; film it turning more")
    if found.deformations is not None:
        yield from of_deformations(found.deformations, at_worst)
    rare = 0.0 if found.seen is None else float((found.seen.mean(axis=0) < OFTEN).mean())
    if rare > MOST_RARE:
        yield Verdict("fair", f"{rare:.0%} of the points are seen too seldom to tell where they are; film them longer")
    if (away := missed(found)) > MOST_MISSED:
        told = f"{away:.0%} of the points are mostly lost where they should show"
        told += ": a part that moves by itself, or its texture"
        yield Verdict("fair", f"{told}; film it more slowly, from where all parts show")


def of_deformations(known: Deformations, at_worst: Grade) -> Iterator[Verdict]:
    """What a solid's deformations say, learned from its keyframes; `at_worst`: what half of them go with its turn is."""
    if known.left_open > FAIR_OPEN:
        told = f"its views tell its shapes to {known.left_open:.1%} of its size only"
        yield Verdict("poor" if known.left_open > POOR_OPEN else "fair", f"{told}; film it turning more, and longer")
    if known.turning > WITH_TURN:
        told = f"{known.turning:.0%} of its changes go with its turn: which is which is a guess"
        grade: Grade = "poor" if known.turning > ALL_WITH_TURN else at_worst
        yield Verdict(grade, f"{told}; film it turning while it keeps its shape")
    if known.otherwise > AS_LIKELY:
        told = f"shapes that are {known.otherwise:.0%} off would be about as likely: how deep it is is a guess"
        yield Verdict("poor", f"{told}; film it turning more, while it keeps its shape")


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
        told += ": it may be no sheet, or it is lost in noise"
        yield Verdict("poor", f"{told}; draw the region tightly, film it sharper")
    if found.by_focal > FAIR_BY_FOCAL:
        told = f"its focal length is hardly known, which may put shapes off by {found.by_focal:.1%}"
        worse: Grade = "poor" if found.by_focal > POOR_BY_FOCAL else "fair"
        yield Verdict(worse, f"{told}; give it by --focal, or film it bending more, from near by")
    if found.stretch > USUAL_STRETCH:
        why = f"its lengths change by {found.stretch:.1%}: it stretches, has creases, or fine folds"
        yield Verdict("fair", f"{why}; if it is a solid: --rest-shape solid")
