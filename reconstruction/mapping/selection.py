"""Model selection: flat, solid or sheet, by what each leaves over on keyframes that it was not made from.

Each is made from one half of the keyframes and seen by the other, over edges (i, j) between neighbouring points:

    flat, solid   ‖(u_i − w_i) − (u_j − w_j)‖/√2 of a rigid shape's image u and the observation w, poses fitted
    sheet         |log l_ij − its median where it was made| ‖w_i − w_j‖/√2, l lengths of shapes that keep them if they can

so that each is the noise of the tracks in pixels where the hypothesis is true. A sheet is tested twice: where each half
finds lengths by itself, which few views may leave open, and where one is told those of the other.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.mesh import farthest_points
from reconstruction.camera import Camera
from reconstruction.mapping.outliers import medians
from reconstruction.mapping.solid.placing import FEWEST_VIEWS
from reconstruction.mapping.solid.rivals import Misfit, Rigid, both, rigid_by
from reconstruction.mapping.start import Start, at_once

Kind = Literal["flat", "solid", "sheet"]
Surface = Callable[[tuple[Indices, Indices]], tuple[list[tuple[Array, Array, Array]], float, int]]
"""Shapes (n, 3, p) of a sheet for both halves of the keyframes: smooth, through the points as seen, and so told lengths.

Those are the other half's. And by how much lengths change in all of them, rms, noise apart; and how many creases it has.
"""

COMPARED = 80  # points
RIGID_POINTS = 150  # enough to tell how well anything rigid fits
NEIGHBOURS = 6  # of each
OFTEN = 0.8  # of the keyframes in which a point to compare is seen
SOLID_FREEDOM = 1.1  # a solid must leave so many times less than a plane
NO_PLANE = 0.1  # of the images' size: what leaves so much over is no plane, whether or not it is a solid of one shape
LEAST_RELIEF = 0.05  # over the width, both RMS: less is a plane that found a better pose
SHEET_FREEDOM = 1.2  # a sheet, which bends otherwise in each view, must leave so many times less than anything rigid, ...
CREASE_FREEDOM = 1.5  # ... and this times more with creases: boxes leave up to 1.6 times less so, books 1.9 and more, ...
STRETCH_FREEDOM = 150.0  # ... and so many times the share by which it stretches, where a solid explains more than a plane,
# ... no more where a proven solid turns by less than 45°, or else: flags leave up to half of it, faces 0.6, jaws (51°) half
FEW_SIDES_DEG, FEW_SIDES_FREEDOM, MOST_FREEDOM = 45.0, 1.85, 3.5
# ... or, told lengths, so many times the share by which it stretches whatever it is: depths are free, and leave of faces
# 0.35 to 0.8 of it, stretching by 1.4 % and more, of paper 0.1 to 0.25, by 0.3 %
TOLD_FREEDOM = 250.0
PLAIN = 2.0  # sureness that leaves no doubt: one half of the keyframes is enough to test rigid shapes by
HALF_NORMAL = 0.6745  # median of a half-normal one


@dataclass(frozen=True)
class Evidence(Rigid):
    """What keyframes say about the kind of object.

    Attributes:
        kind: the hypothesis chosen.
        sheet: what it leaves over; NaN where none was to be had.
        length_change: change of the sheet's edge lengths between the halves of the keyframes; a robust deviation, relative.
        sureness: by what factor the next best hypothesis leaves more, freedom reckoned with; 1 is a toss-up.
        told_px: what the sheet leaves over of frames that are told its lengths, px of an edge.
    """

    kind: Kind
    sheet: Misfit
    length_change: float
    sureness: float
    told_px: float = np.nan

    @property
    def note(self) -> str:
        """In words, for the log."""
        kinds = {"flat": self.flat, "solid": self.solid, "sheet": self.sheet}
        left = ", ".join(f"{kind} {left.edges_px:.2f}" for kind, left in kinds.items() if not np.isnan(left.edges_px))
        left += "" if np.isnan(self.told_px) else f" (told its lengths {self.told_px:.2f})"
        lengths = "" if np.isnan(self.length_change) else f"; lengths change by {self.length_change:.1%}"
        solid = f"turn {self.turn_degrees:.0f}°, relief {self.relief:.2f}"
        return f"{self.kind}: left over on other keyframes {left} px{lengths}; {solid}"

    def among(self, some: Indices, points: int) -> "Evidence":
        """The same of so many points, where it was found by some of them."""
        shape = np.full((3, points), np.nan)
        shape[:, some] = self.shape
        return replace(self, shape=shape)


def select(W: Array, visible: Mask, camera: Camera, surface: Surface | None = None, start: Start = at_once) -> Evidence:
    """Which kind of object keyframes (K, 2, p) px with visibility (K, p) show.

    Args:
        W: anything where not visible.
        visible: (K, p).
        camera: its focal length is taken as it is.
        surface: makes a sheet; without it, or with an orthographic camera, a sheet is not considered.
        start: where rigid shapes are made meanwhile.

    Raises:
        ReconstructionError: too few keyframes for two halves.
    """
    if len(W) < 2 * FEWEST_VIEWS:
        raise ReconstructionError(f"{2 * FEWEST_VIEWS} keyframes are needed to tell what the object is, not {len(W)}")
    halves = np.arange(0, len(W), 2), np.arange(1, len(W), 2)
    seen = [(W[half], visible[half]) for half in halves]
    points = spread_points(W, visible)
    edges = spread_edges(W, visible, points[:COMPARED])
    few = np.unique(points)
    views = [(w[:, :, few], h[:, few]) for w, h in seen]
    at = np.searchsorted(few, edges)
    begun = start(rigid_by, views[0], views[1], camera, at)
    sheet, change, told_px, stretch, creases = Misfit(np.nan, np.nan), np.nan, np.nan, 0.0, 0
    if surface is not None:
        with suppress(ReconstructionError):  # no sheet, then
            shapes, stretch, creases = surface(halves)
            sheet, change, told_px = sheet_misfit(shapes, seen, edges)
    rigid: Rigid = begun.result()
    kind, sureness = decide(rigid, sheet, stretch, told_px, creases)
    if sureness < PLAIN:
        rigid = both(rigid, rigid_by(views[1], views[0], camera, at))
        kind, sureness = decide(rigid, sheet, stretch, told_px, creases)
    turn, relief = rigid.turn_degrees, rigid.relief
    shape, size = rigid.shape, rigid.size_px
    found = Evidence(
        rigid.flat, rigid.solid, turn, relief, kind, sheet, change, sureness, told_px, shape=shape, size_px=size
    )
    return found.among(few, W.shape[2])


def decide(rigid: Rigid, sheet: Misfit, stretch: float, told_px: float = np.nan, creases: int = 0) -> tuple[Kind, float]:
    """The kind, and how many times more the next best leaves.

    Rigid shapes compete by the whole; with a sheet, which goes through every point, by the edges, if they are proven. Cloth
    stretches, and its waves are no relief that lasts; a face that talks passes for a sheet that stretches, but has one.

    Args:
        rigid: what rigid shapes leave over.
        sheet: what a sheet does.
        stretch: change of its lengths, rms, noise apart.
        told_px: what it leaves over of frames that are told its lengths.
        creases: how many it has.
    """
    flat, solid = rigid.flat, rigid.solid
    gain = max(flat.whole_px, 1e-300) / max(SOLID_FREEDOM * solid.whole_px, 1e-300)
    best: Kind = "flat"
    if rigid.relief > LEAST_RELIEF and (gain > 1 or flat.whole_px > NO_PLANE * rigid.size_px):
        best = "solid"
    stiff_px = min(flat.edges_px, solid.edges_px)
    rigid_px, least = solid.edges_px if best == "solid" else stiff_px, SHEET_FREEDOM
    explained = 1 - min(1.0, solid.edges_px / max(flat.edges_px, 1e-300)) ** 2  # by relief, of what a plane leaves
    most = FEW_SIDES_FREEDOM if rigid.turn_degrees < FEW_SIDES_DEG else MOST_FREEDOM
    if not rigid.proven:  # all of its stretching speaks against a sheet, too
        rigid_px, least, explained, most = min(flat.whole_px, solid.whole_px), 1.0, 1.0, MOST_FREEDOM
    freedom = min(least + STRETCH_FREEDOM * stretch * explained, most)
    more = CREASE_FREEDOM if creases else 1.0
    alone, told = (more * max(np.nan_to_num(px, nan=np.inf), 1e-300) for px in (sheet.edges_px, told_px))
    sureness = max(rigid_px / (freedom * alone), stiff_px / ((SHEET_FREEDOM + TOLD_FREEDOM * stretch) * told))
    if sureness > 1:
        return "sheet", float(sureness)
    return best, float(min(max(gain, 1 / gain), least * alone / max(rigid_px, 1e-300)))


def sheet_misfit(
    shapes: list[tuple[Array, Array, Array]], seen: list[tuple[Array, Mask]], edges: Indices
) -> tuple[Misfit, float, float]:
    """Of sheets of the two halves of the keyframes, each on the other half; the change of lengths; and what is left, told.

    Args:
        shapes: (K, 3, p) smooth, through the points seen, and the latter told lengths, in each half.
        seen: those points (K, 2, p) px, and their visibility (K, p).
        edges: (n, 2).

    Raises:
        ReconstructionError: the sheets have no edge in common.
    """
    i, j = edges.T
    left = np.zeros((2, 2, 2))  # by half, alone and told, px and share
    for row, (made, *_), (_, *tested), (W, visible) in zip(left, shapes, reversed(shapes), reversed(seen), strict=True):
        with np.errstate(divide="ignore"):
            logs, *through = (np.log(np.linalg.norm(S[:, :, i] - S[:, :, j], axis=1)) for S in (made, *tested))
        usual, size = medians(logs, axis=0), np.linalg.norm(W[:, :, i] - W[:, :, j], axis=1)
        for k, change in enumerate(one - usual for one in through):
            known = visible[:, i] & visible[:, j] & np.isfinite(change)
            if not known.any():
                raise ReconstructionError("no edge is known in both halves of the keyframes")
            off = np.abs(change - np.median(change[known]))
            row[k] = np.median((off * size)[known]) / np.sqrt(2), np.median(off[known])
    alone, told = np.sqrt((left**2).mean(axis=0)) / HALF_NORMAL
    return Misfit(float(alone[0]), np.nan), float(alone[1]), float(told[0])


def spread_points(W: Array, visible: Mask) -> Indices:
    """Well-spread points, each far from those before it, of points seen in most keyframes.

    First those of the keyframe that shows most of them, then those of others, that show other sides of a solid.
    """
    share = visible.mean(axis=0)
    left = np.flatnonzero((share > 0) & (share >= min(OFTEN, float(np.median(share)))))
    chosen: Indices = np.zeros(0, np.int64)
    while len(left) and len(chosen) < RIGID_POINTS:
        view = int(visible[:, left].sum(axis=1).argmax())
        shown = left[visible[view, left]]
        chosen = np.concatenate([chosen, shown[farthest_points(W[view][:, shown].T, RIGID_POINTS - len(chosen))]])
        left = left[~visible[view, left]]
    return chosen


def spread_edges(W: Array, visible: Mask, points: Indices) -> Indices:
    """Edges (n, 2) between points (m,) and those beside them, in the keyframe that shows most of them."""
    few = np.unique(points)
    view = int(visible[:, few].sum(axis=1).argmax())
    few = few[visible[view, few]]
    place = W[view][:, few].T
    near = np.asarray(cKDTree(place).query(place, k=range(1, min(NEIGHBOURS + 1, len(few)) + 1))[1], np.int64)[:, 1:]
    i = np.repeat(np.arange(len(few)), near.shape[1])
    pairs = np.sort(np.stack([i, near.ravel()], axis=1), axis=1)
    return np.asarray(few[np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0)])
