"""A solid built up view by view, from one of its keyframes on: the start of its adjustment."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.solid.adjustment import Adjustment
from reconstruction.mapping.solid.building import Build
from reconstruction.mapping.solid.bundle import Bundle
from reconstruction.mapping.solid.hollow import disbelief
from reconstruction.mapping.solid.placing import dome, well_spread
from reconstruction.mapping.solid.views import Likeness, building_order, completed

REPOSINGS, ENOUGH = 5, 0.999  # rounds of posing views anew, while they lower the energy to less than so much of it


@dataclass(frozen=True)
class Growth:
    """Keyframes in the order in which they are built on from one of them.

    Attributes:
        build: they, in units of what the first shows.
        order: (K,) which they are.
        some: the points that are adjusted together with the poses.
        unit: in px.
    """

    build: Build
    order: Indices
    some: Indices
    unit: float

    @cached_property
    def chosen(self) -> Build:
        """What is adjusted together."""
        return self.build.of(self.some)

    @cached_property
    def grown(self) -> Bundle:
        """Built view by view."""
        build = self.chosen
        return build.grown(dome(build.first, build.kappa, flat=build.flat))

    @property
    def grown_energy(self) -> float:
        """Of that, an observation, px²; infinite where nothing can be built on its first view."""
        try:
            return self.chosen.adjusted(self.grown, Adjustment(steps=0))[1] * self.unit**2
        except np.linalg.LinAlgError:
            return float("inf")

    def best(
        self, known: Array | None = None, *, whole: bool = False, hidden: bool = True, refine: bool
    ) -> tuple["Growth", Bundle, float]:
        """Itself, the likeliest bundle and its energy, px²: grown on a dome, all views at once, or posed by a known shape.

        Things are seen from outside: where views hardly tell, the middle is nearer than the rim.

        Args:
            known: a shape (3, p) that it may be.
            whole: whether to start from all views at once, too.
            hidden: whether it hides its far side: what is known is a start, too, and views that do not fit are posed anew.
            refine: whether the views may change the focal length.
        """
        build = self.chosen
        both_ways = build.factorized() if whole else []
        starts = [*both_ways, self.grown]
        starts += [] if known is None or not hidden else [build.posed(known[:, self.some])]
        found = [self._settled(one, refine=refine) for one in starts]
        k = int(np.argmin([energy for _, energy in found]))
        best, energy = found[k]
        if build.kappa and k >= len(both_ways):
            other, its_energy = self._settled(best.reversed(), refine=refine)
            best, energy = (other, its_energy) if its_energy < energy else (best, energy)
        for _ in range(REPOSINGS if hidden else 0):
            other, its_energy = self._settled(build.reposed(best), refine=refine)
            if not its_energy < ENOUGH * energy:
                break
            best, energy = other, its_energy
        return self, best, energy * self.unit**2

    def _settled(self, start: Bundle, *, refine: bool) -> tuple[Bundle, float]:
        """A start settled, and its energy, more if it is hollow."""
        build = self.chosen
        bundle, energy = build.settled(start, refine=refine)
        return bundle, energy if build.flat else energy * disbelief(bundle, build.W, build.h > 0, build.first)


def growth_from(W: Array, visible: Mask, camera: Camera, alike: Likeness, view: int, *, flat: bool) -> Growth:
    """Keyframes W (K, 2, p) px, relative to the principal point, with visibility (K, p), from one view on."""
    order, parent = building_order(alike, view)
    first = completed(W, visible, alike, view)
    unit = float(np.sqrt(np.var(first, axis=1).sum()))
    scale = np.abs(alike.a[parent, order])  # of each view against that it is built on
    turn = alike.a[parent, order] / scale
    place, kappa = np.argsort(order)[parent], unit / camera.focal_px
    build = Build(W[order] / unit, visible[order].astype(np.float64), first / unit, turn, scale, place, kappa, flat)
    return Growth(build, order, well_spread(first, visible), unit)
