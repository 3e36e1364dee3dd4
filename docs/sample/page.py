"""What is printed on the sheet: a front page of headlines, columns, pictures and plots, all made up here.

Every part is random but seeded, and nothing repeats, so that no patch can be mistaken for another.
Lengths are millimetres on the sheet, x to the right and y down from its top left corner; colours are BGR.
"""

from functools import cache

import numpy as np

from app.demo.motion import HEIGHT_MM, WIDTH_MM
from docs.sample.ink import (
    BLACK,
    GREEN,
    INKS,
    NAVY,
    OCHRE,
    PLUM,
    PX_PER_MM,
    RED,
    SKY,
    WHITE,
    Box,
    Colour,
    Image,
    block,
    disc,
    made_up_word,
    polygon,
    polyline,
    write,
)
from docs.sample.pictures import city_plan, landscape


@cache
def printed_page() -> Image:
    """The page as printed: (HEIGHT_MM·6, WIDTH_MM·6, 3) BGR. Shared: do not write into it."""
    page = np.full((round(HEIGHT_MM * PX_PER_MM), round(WIDTH_MM * PX_PER_MM), 3), WHITE, np.uint8)
    rng = np.random.default_rng(2016)
    _masthead(page)
    landscape(page, (8, 36, 92, 68), rng)
    _column(page, (8, 107, 44, 22), rng, heading="Kites over the bay", ink=RED)
    _column(page, (56, 107, 44, 22), rng, heading="", ink=BLACK)
    _column(page, (105, 36, 46, 58), rng, heading="A sheet turns", ink=NAVY)
    city_plan(page, (156, 36, 76, 72), rng)
    _column(page, (237, 36, 52, 30), rng, heading="Tides today", ink=GREEN)
    _emblems(page, (237, 70, 52, 38), rng)
    _bars(page, (105, 98, 46, 36), rng)
    _curves(page, (8, 136, 84, 66), rng)
    _crossword(page, (97, 139, 54, 63), rng)
    _column(page, (156, 113, 62, 42), rng, heading="Bend, do not stretch", ink=PLUM)
    _stamp(page, (223, 113, 66, 42), rng)
    _mosaic(page, (156, 160, 70, 42), rng)
    _column(page, (231, 160, 58, 42), rng, heading="Wanted: wind", ink=RED)
    page.flags.writeable = False
    return page


def _column(
    page: Image,
    area: Box,
    rng: np.random.Generator,
    heading: str,
    ink: Colour,
) -> None:
    """A headline over ragged lines of made-up words, now and then one of them in bold or colour."""
    x, y, w, h = area
    bottom = y + h
    if heading:
        write(page, heading, x, y + 5.0, 4.2, ink, bold=True, room=w)
        y += 8.0
    size = float(rng.uniform(2.3, 2.8))
    while y + size + 1.0 < bottom:
        cursor, line_end = x, x + w * rng.uniform(0.8, 1.05)
        while cursor < line_end - 4:
            strong = rng.random() < 0.14
            colour = INKS[rng.integers(len(INKS))] if strong else BLACK
            word = made_up_word(rng)
            if cursor + 0.8 * size * len(word) > x + w:
                break
            cursor += write(page, word, cursor, y + size, size, colour, bold=strong) + 1.2
        y += size * 1.65


def _masthead(page: Image) -> None:
    block(page, (8, 8, 281, 23), NAVY)
    write(page, "THE FOLDED TIMES", 41, 25.5, 12.5, WHITE, bold=True, room=134)
    disc(page, 24, 19.5, 9, OCHRE)
    polygon(page, np.array([(16, 23), (22, 12), (26, 19), (28, 16), (33, 23)], float), RED)
    disc(page, 24, 19.5, 9, WHITE, 0.8)
    for index, ink in enumerate((SKY, OCHRE, RED, GREEN, WHITE)):
        slant = np.array([(0, 27), (5, 12 + 2 * index), (12, 15 - index), (8, 22 + index)], float)
        polygon(page, slant + np.array((176 + 12.5 * index, 0)), ink)
    block(page, (244, 11, 42, 17), WHITE)
    write(page, "No. 2016", 247, 18, 4, RED, bold=True, room=36)
    write(page, "one thin sheet", 247, 25, 3, BLACK)
    block(page, (8, 32, 281, 1.0), BLACK)


def _emblems(page: Image, area: Box, rng: np.random.Generator) -> None:
    """Badges of discs, stars and blocks, as a page of advertisements has."""
    x, y, w, h = area
    block(page, area, OCHRE)
    for index in range(9):
        cx, cy = x + w * (0.17 + 0.33 * (index % 3)), y + h * (0.18 + 0.32 * (index // 3))
        ink, other = (INKS[i] for i in rng.permutation([0, 1, 2, 4, 5, 6])[:2])
        points = int(rng.integers(3, 8))
        angle = np.arange(2 * points) * np.pi / points + rng.uniform(0, 3)
        radius = np.where(np.arange(2 * points) % 2, rng.uniform(2.0, 3.4), 5.6)
        star = np.column_stack([cx + radius * np.cos(angle), cy + radius * np.sin(angle)])
        if index % 2:
            disc(page, cx, cy, 5.4, WHITE)
        polygon(page, star, ink)
        disc(
            page,
            cx + rng.uniform(-1, 1),
            cy + rng.uniform(-1, 1),
            rng.uniform(0.9, 1.9),
            other if index % 3 else WHITE,
        )


def _bars(page: Image, area: Box, rng: np.random.Generator) -> None:
    x, y, w, h = area
    block(page, area, (222, 232, 232))
    for index in range(9):
        tall = h * rng.uniform(0.2, 0.88)
        block(page, (x + 2.5 + index * 4.7, y + h - 2 - tall, 3.6, tall), INKS[rng.integers(len(INKS))])
        block(page, (x + 2.5 + index * 4.7, y + h - 2 - tall * rng.uniform(0.3, 0.8), 3.6, 1.6), WHITE)
    polyline(page, np.array([(x + 1, y + 1), (x + 1, y + h - 2), (x + w - 1, y + h - 2)]), BLACK, 0.5)


def _curves(page: Image, area: Box, rng: np.random.Generator) -> None:
    """A plot: frame, uneven ticks, three noisy curves with marks and a legend."""
    x, y, w, h = area
    write(page, "Wind speed, by the hour", x, y + 4, 3.6, NAVY, bold=True)
    y, h = y + 7, h - 7
    block(page, (x, y, w, h), (232, 226, 214))
    for ink, level in ((RED, 0.3), (NAVY, 0.55), (GREEN, 0.76)):
        heights = level + np.cumsum(rng.normal(0, 0.055, 15))
        heights -= np.linspace(0, heights[-1] - level - 0.08, 15)
        line = np.column_stack([x + w * np.linspace(0.05, 0.95, 15), y + h * np.clip(heights, 0.08, 0.95)])
        polyline(page, line, ink, 0.9)
        for mark_x, mark_y in line[rng.random(15) < 0.8]:
            if rng.random() < 0.5:
                block(page, (mark_x - 1.2, mark_y - 1.2, 2.4, 2.4), ink)
            else:
                disc(page, mark_x, mark_y, 1.4, ink)
    for tick in np.cumsum(rng.uniform(3, 8, 12)):
        if tick < w - 2:
            block(page, (x + tick, y + h - 3, 0.7, 3), BLACK)
    block(page, (x + w - 36, y + 2, 34, 9), WHITE)
    write(page, "bay hill port", x + w - 34, y + 8, 3.2, PLUM, bold=True)
    block(page, (x, y, w, h), BLACK, 0.7)


def _crossword(page: Image, area: Box, rng: np.random.Generator) -> None:
    x, y, w, h = area
    side = w / 9
    for row in range(int(h / side)):
        for column in range(9):
            cell = (x + column * side, y + row * side, side, side)
            if rng.random() < 0.34:
                block(page, cell, BLACK if rng.random() < 0.8 else RED)
                continue
            block(page, cell, BLACK, 0.35)
            if rng.random() < 0.6:
                letter = chr(65 + int(rng.integers(26)))
                write(page, letter, cell[0] + 1.6, cell[1] + side - 1.5, 3.2, NAVY, bold=True)


def _stamp(page: Image, area: Box, rng: np.random.Generator) -> None:
    """A coupon: an offer in large letters beside a square code of random modules."""
    x, y, w, _ = area
    block(page, area, RED)
    write(page, "FREE", x + 3, y + 15, 9, WHITE, bold=True, room=26)
    write(page, "kite today", x + 3, y + 24, 4, WHITE, bold=True, room=26)
    polygon(page, np.array([(x + 4, y + 38), (x + 12, y + 27), (x + 22, y + 33), (x + 14, y + 39)]), OCHRE)
    block(page, (x + w - 35, y + 4, 32, 34), WHITE)
    for row, column in np.argwhere(rng.random((14, 13)) < 0.5):
        block(page, (x + w - 33.6 + column * 2.25, y + 5.3 + row * 2.25, 2.25, 2.25), BLACK)


def _mosaic(page: Image, area: Box, rng: np.random.Generator) -> None:
    """Overlapping triangles, tiles and discs, like a printed pattern that never repeats."""
    x, y, w, h = area
    block(page, area, (206, 226, 214))
    for _ in range(70):
        cx, cy, size = x + w * rng.uniform(0.05, 0.95), y + h * rng.uniform(0.07, 0.93), rng.uniform(1.5, 5.5)
        angle = rng.uniform(0, 2 * np.pi) + np.arange(rng.integers(3, 5)) * 2 * np.pi / 3.3
        corners = np.column_stack([cx + size * np.cos(angle), cy + size * np.sin(angle)])
        corners = np.clip(corners, (x, y), (x + w, y + h))
        polygon(page, corners, INKS[rng.integers(len(INKS))] if rng.random() < 0.8 else WHITE)
    block(page, area, BLACK, 0.6)
