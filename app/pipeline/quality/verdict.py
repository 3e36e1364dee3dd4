"""How good a reconstruction is, in a word, with the reason and what helps: thresholds on what is known without the truth.

[docs/verdict.md](../../../docs/verdict.md) has what the words were worth where the truth is known, and how it was measured.
"""

import numpy as np

from app.pipeline.quality.course import Course
from app.pipeline.quality.finding import GRADES, Grade, Verdict
from app.pipeline.quality.frames import astray, errors, looks, seen
from app.pipeline.quality.keyframes import RECOVERED, evidence
from reconstruction.mapping.map import Map


def verdict(course: Course, found: Map | None, bits_per_px: float | None = None, alike: float = 1.0) -> Verdict:
    """The verdict on shapes of frames.

    Args:
        course: what each frame tells.
        found: what the object is taken for; None if there is no model.
        bits_per_px: what the video's encoder spent, if that is so little that what is seen may not be what was there.
        alike: share of the points seen that looked as in the first frame.
    """
    if found is None or np.isnan(np.asarray(course.errors)).all():
        return Verdict("poor", "there is no shape; the video is too short, or the surface has too little texture")
    findings = [*errors(course, found), *seen(course, found), *astray(course), *looks(alike)]
    if bits_per_px is not None:
        told = f"compressed to {bits_per_px:.2g} bits a pixel, texture is made up between key pictures; export it with more"
        findings.append(Verdict("poor", told))
    findings += evidence(found, known=bool(findings))
    worst: Grade = next((grade for grade in GRADES if any(one.grade == grade for one in findings)), "good")
    reasons = [one.reason for one in findings if one.grade == worst]
    return Verdict(worst, "; ".join(reasons) or praise(course, found))


def praise(course: Course, found: Map) -> str:
    """Why it is good."""
    kind = f"a {RECOVERED[found.rest.kind]}" if found.rest.kind in RECOVERED else "as given"
    return f"{np.nanmedian(course.errors_px):.2g} px, {np.mean(course.shares):.0%} of the points seen, {kind} in many views"
