"""What can be done to footage: each a case with the error that is wanted at most."""

from fractions import Fraction

import numpy as np

from app.arrays import Image
from app.footage.camera import panned, rolled
from app.footage.case import Case
from app.footage.cover import crossing, time_code, title, watermark
from app.footage.light import alternating, at_random, bands, fading_in
from app.footage.sharpness import focusing, shaken_at_first
from app.footage.storage import Storage
from app.footage.surroundings import background

LEAD = 60  # frames before the surface is shown


def black(size: tuple[int, int]) -> list[Image]:
    """Nothing to be seen."""
    return [np.zeros((size[1], size[0], 3), np.uint8)] * LEAD


def titled(size: tuple[int, int]) -> list[Image]:
    """A title card."""
    return [title(size)] * LEAD


_CASES = (
    Case("as it is", 2.1),
    Case("watermark over 30 %", 3.0, (watermark(0.3),)),
    Case("time code", 3.0, (time_code,)),
    *(Case(f"leaves the picture, {name}", 3.5, turn=panned(out, 40, 40))
      for name, out in (("half", 0.5), ("most", 0.85), ("all", 1.2))),
    Case("a thing crosses fast", 3.0, (crossing(50, 40.0, (110, 260)),)),
    Case("a thing crosses slowly", 3.5, (crossing(10, 7.0, (110, 260)),)),
    *(
        Case(f"background {'moving' if moves else 'still'}, region {'loose' if loose else 'tight'}",
             3.5 if loose else 3.0, (background(moves=moves),), loose=loose)
        for moves in (False, True)
        for loose in (0.0, 0.5)
    ),
    Case("background moving, region found", 3.5, (background(moves=True),), loose=None),
    Case("light alternating", 2.7, (alternating(0.18),)),
    Case("light at random", 2.7, (at_random(0.4),)),
    Case("light in rolling bands", 2.7, (bands(0.3),)),
    *(Case(f"every third frame, from {phase}", 3.2, phase=phase, every=3) for phase in range(3)),
    Case("pixels 4:3", 2.6, stretch=(0.75, 1.0), storage=Storage(pixel_aspect=Fraction(4, 3))),
    Case("mirrored", 2.6, mirrored=True),
    *(Case(f"turned by {degrees}° {when}", 3.0, turn=rolled(degrees, first, 40))
      for degrees in (24, 50) for when, first in (("at the start", 0), ("later", 60))),
    Case("black at first", 2.6, before=black),
    Case("fading in", 2.6, (fading_in(30),)),
    Case("shaken at first", 2.6, (shaken_at_first(16.0, 8),)),
    Case("out of focus at first", 2.6, (focusing(3.0, 15),)),
    Case("a title card first", 2.6, before=titled),
    Case("an image missing", 2.6, storage=Storage(left_out=(50,))),
    Case("50 kbit/s", None, storage=Storage(bit_rate=50_000)),
    Case("4K", 2.1, stretch=(4.5, 4.5), storage=Storage(bit_rate=40_000_000)),
)  # fmt: skip
CASES = {case.name: case for case in _CASES}
