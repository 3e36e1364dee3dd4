"""The edge of a sheet in a frame: beyond the last points its net only goes on, the picture shows how far it really is."""

from itertools import pairwise
from typing import Any, cast

import cv2
import numpy as np

from app.arrays import Array, Flags, Floats, Image, Indices

REACH_PX = 12  # from where the net ends, that the edge is looked for
WITHIN_PX = 5  # further within, where the sheet's colour is taken
CONTRAST = 20.0  # grey levels, least
HALF = 0.5  # of the contrast with what is beyond: there is the edge
TOLD_PX = 4.0  # that a person may be off with the corners
TERMS = 4  # of the polynomial along a side
OUTLIER_PX = 1.5
FEWEST = 0.4  # share of a side where its edge has to be seen
FOLLOWS = 0.5  # of a change, from frame to frame
FLAT = 5e-4  # pull of a term of degree k to 0, times k²
ROUNDS = 4


class Outline:
    """The edge along the four sides of a net, followed from frame to frame.

    Args:
        shape: rows and columns of the net's nodes.
        first: (H, W, 3) the first frame.
        nodes_px: (q, 2) the nodes in it.

    Attributes:
        border: (n,) the nodes at the net's border, each side's one after the other, corners twice.
    """

    def __init__(self, shape: tuple[int, int], first: Image, nodes_px: Array) -> None:
        number = np.arange(shape[0] * shape[1]).reshape(shape)
        sides = (
            (number[0], number[1]),
            (number[:, -1], number[:, -2]),
            (number[-1], number[-2]),
            (number[:, 0], number[:, 1]),
        )
        self.border: Indices = np.concatenate([at for at, _ in sides])
        self._inner = np.concatenate([inner for _, inner in sides])
        ends = np.cumsum([0, *(len(at) for at, _ in sides)])
        self._sides = [slice(a, b) for a, b in pairwise(ends.tolist())]
        self._terms = [
            np.polynomial.legendre.legvander(np.linspace(-1, 1, s.stop - s.start), TERMS - 1) for s in self._sides
        ]
        self._curves = np.zeros((4, TERMS))
        self._usable = np.ones(len(self.border), bool)
        self._usable = np.abs(self._seen(first, nodes_px)[0]) <= TOLD_PX

    def off(self, image: Image, nodes_px: Array) -> Array:
        """How far (n, 2) px the edge is from the border's nodes, where the net has its nodes (q, 2).

        Args:
            image: (H, W, 3) the frame.
            nodes_px: (q, 2) the nodes.
        """
        seen, outward = self._seen(image, nodes_px)
        for k, (side, terms) in enumerate(zip(self._sides, self._terms, strict=True)):
            found = np.isfinite(seen[side])
            if found.mean() >= FEWEST:
                curve = fitted(terms[found].astype(np.float64), seen[side][found])
                self._curves[k] += FOLLOWS * (curve - self._curves[k])
        far = np.concatenate([terms @ curve for terms, curve in zip(self._terms, self._curves, strict=True)])
        moved = np.clip(far, -REACH_PX, REACH_PX)[:, None] * outward
        # A corner belongs to two sides, and goes with both.
        total = np.zeros_like(nodes_px)
        np.add.at(total, self.border, moved)
        return np.asarray(total[self.border])

    def _seen(self, image: Image, nodes_px: Array) -> tuple[Array, Array]:
        """How far (n,) px beyond the border the edge is seen, NaN where it is not, and which way (n, 2) that is."""
        places = nodes_px[self.border]
        outward = np.empty_like(places)
        for side in self._sides:
            along = np.gradient(places[side], axis=0)
            outward[side] = np.column_stack([along[:, 1], -along[:, 0]])
        outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
        outward *= np.sign(np.einsum("nc,nc->n", outward, places - nodes_px[self._inner]))[:, None] + 1e-12
        steps = np.arange(-REACH_PX - WITHIN_PX, REACH_PX + 2)
        at = (places[:, None] + steps[:, None] * outward[:, None]).astype(np.float32)
        one_map_for_both: Any = None
        lines = cast(Floats, cv2.remap(image, at, one_map_for_both, cv2.INTER_LINEAR).astype(np.float32))
        height, width = image.shape[:2]
        inside = cast(Flags, ((at >= 0) & (at < (width - 1, height - 1))).all(axis=(1, 2)))
        return np.where(inside & self._usable, edges(lines), np.nan), outward


def edges(lines: Floats) -> Array:
    """Where (n,) lines of colours (n, steps, 3), from within a sheet to beyond it, leave it, from their middle; or NaN."""
    within = np.median(lines[:, :WITHIN_PX], axis=1, keepdims=True)
    off = np.linalg.norm(lines - within, axis=2)
    off = (off[:, :-1] + off[:, 1:]) / 2
    beyond = np.minimum(off[:, -WITHIN_PX:].mean(axis=1), off.max(axis=1))
    limit = np.maximum(HALF * beyond, CONTRAST / 2)
    left = off > limit[:, None]
    first = left.argmax(axis=1)
    rows = np.arange(len(off))
    last = off[rows, np.maximum(first - 1, 0)]
    share = (limit - last) / np.maximum(off[rows, first] - last, 1e-6)
    place = first - 1 + np.clip(share, 0, 1) + 0.5 - REACH_PX - WITHIN_PX
    good = left.any(axis=1) & (first > WITHIN_PX) & (beyond > CONTRAST)
    return np.where(good, place, np.nan)


def fitted(terms: Array, values: Array) -> Array:
    """Coefficients (k,) by which terms (n, k) give values (n,), but for outliers."""
    flat = FLAT * len(values) * np.diag(np.arange(terms.shape[1])) ** 2
    curve: Array = np.zeros(terms.shape[1])
    curve[0] = np.median(values)
    for _ in range(ROUNDS):
        weight = 1 / (1 + ((values - terms @ curve) / OUTLIER_PX) ** 2) ** 2
        normal, right = (terms * weight[:, None]).T @ terms + flat, (terms * weight[:, None]).T @ values
        curve = cast(Array, np.linalg.solve(normal, right))
    return curve
