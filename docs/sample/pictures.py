"""The two large pictures on the page: a landscape and a city plan."""

import cv2
import numpy as np
from numpy.typing import NDArray

from docs.sample.ink import (
    BLACK,
    INKS,
    OCHRE,
    PX_PER_MM,
    RED,
    SKY,
    WHITE,
    Box,
    Image,
    block,
    disc,
    made_up_word,
    polygon,
    polyline,
    px,
    write,
)


def _clouds(shape: tuple[int, int], rng: np.random.Generator) -> NDArray[np.float32]:
    """Smooth noise of several octaves in 0…1, (h, w)."""
    total = np.zeros(shape, np.float32)
    for octave in range(1, 7):
        coarse = rng.random((2**octave + 1, 2**octave + 2), np.float32)
        smooth = cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC)
        total += np.asarray(smooth / 1.6**octave, np.float32)
    low, high = float(total.min()), float(total.max())
    return ((total - low) / (high - low)).astype(np.float32)


def landscape(page: Image, area: Box, rng: np.random.Generator) -> None:
    """A landscape: sky with clouds, a sun, ridges one behind the other, trees, houses and kites."""
    x, y, w, h = area
    left, top, width, height = px(x, y, w, h)
    down = np.linspace(0, 1, height, dtype=np.float32)[:, None, None]
    sky = (1 - down) * np.array((190, 120, 60), np.float32) + down * np.array((150, 200, 250), np.float32)
    cloud = np.clip(_clouds((height, width), rng) * 2.4 - 1.0, 0, 1)[..., None]
    picture = (sky * (1 - cloud) + cloud * 245).astype(np.uint8)
    sun = round(width * 0.73), round(height * 0.24)
    cv2.circle(picture, sun, round(height * 0.11), (90, 215, 255), -1, cv2.LINE_AA)
    across = np.arange(width)
    for ridge in range(5):
        steps = np.cumsum(rng.normal(0, 1, 14 + 5 * ridge))
        steps -= np.linspace(steps[0], steps[-1], len(steps))
        crest = np.interp(across, np.linspace(0, width, len(steps)), steps)
        crest = height * (0.36 + 0.12 * ridge) + crest * height * 0.032
        shade = np.array((170, 124, 96)) * (1 - ridge / 6) + np.array((14, 44, 24))
        ground = shade * (0.3 + 1.5 * _clouds((height, width), rng)[..., None])
        below = (np.arange(height)[:, None] > crest)[..., None]
        picture = np.where(below, np.clip(ground, 0, 255), picture).astype(np.uint8)
    page[top : top + height, left : left + width] = picture
    for _ in range(44):
        foot = np.array((x + w * rng.uniform(0.02, 0.97), y + h * rng.uniform(0.56, 0.97)))
        tall = rng.uniform(2.5, 7.0)
        green = (24, int(rng.integers(40, 190)), int(rng.integers(10, 110)))
        polygon(page, foot + tall * np.array([(-0.33, 0), (0, -1), (0.33, 0)]), green)
    for _ in range(13):
        left_mm, top_mm = x + w * rng.uniform(0.03, 0.92), y + h * rng.uniform(0.6, 0.92)
        wide = rng.uniform(3.0, 5.5)
        block(page, (left_mm, top_mm, wide, 3.0), WHITE if rng.random() < 0.6 else OCHRE)
        block(page, (left_mm + wide * rng.uniform(0.2, 0.6), top_mm + 1.0, 1.0, 1.2), BLACK)
        roof = np.array([(left_mm - 0.6, top_mm), (left_mm + wide / 2, top_mm - 2.6), (left_mm + wide + 0.6, top_mm)])
        polygon(page, roof, RED if rng.random() < 0.7 else BLACK)
    kites = ((33, 14, 6.5), (8, 6, 3.6), (14, 21, 3.0), (51, 8, 4.2), (58, 24, 3.4), (82, 26, 3.8))
    for right, lower, size in kites:
        _kite(page, np.array((x + right, y + lower)), size, rng)
    block(page, area, BLACK, 0.5)


def _kite(page: Image, middle: NDArray[np.float64], size: float, rng: np.random.Generator) -> None:
    """A kite of two colours with a zigzag tail, leaning at random."""
    lean = rng.uniform(-0.5, 0.5)
    turn = np.array([(np.cos(lean), np.sin(lean)), (-np.sin(lean), np.cos(lean))]) * size
    tail = np.column_stack([rng.uniform(-0.35, 0.35, 5), np.linspace(1.3, 2.6, 5)])
    polyline(page, middle + tail @ turn, WHITE, 0.5)
    first, second = rng.permutation(len(INKS))[:2]
    polygon(page, middle + np.array([(-0.9, 0), (0, -1.2), (0, 1.3)]) @ turn, INKS[first])
    polygon(page, middle + np.array([(0.9, 0), (0, -1.2), (0, 1.3)]) @ turn, INKS[second])


def city_plan(page: Image, area: Box, rng: np.random.Generator) -> None:
    """A city plan: cells around random places in pastel colours, with streets between, a river and names."""
    x, y, w, h = area
    left, top, width, height = px(x, y, w, h)
    places = rng.uniform(0, 1, (64, 2)) * (width, height)
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
    squared = (columns[..., None] - places[:, 0]) ** 2 + (rows[..., None] - places[:, 1]) ** 2
    nearest = np.partition(squared, 1, axis=-1)[..., :2]
    street = np.sqrt(nearest[..., 1]) - np.sqrt(nearest[..., 0]) < 9
    pastel = rng.integers(120, 250, (64, 3))
    cells = np.where(street[..., None], 252, pastel[squared.argmin(axis=-1)]).astype(np.uint8)
    page[top : top + height, left : left + width] = cells
    along = np.linspace(0, 1, 40)
    river = np.column_stack([x + 1.5 + (w - 3) * along, y + h * (0.62 + 0.16 * np.sin(5 * along) - 0.2 * along)])
    polyline(page, river, SKY, 3.2)
    named: list[NDArray[np.float64]] = []
    for place in places / PX_PER_MM + (x, y):
        room = all(abs(place[0] - other[0]) > 19 or abs(place[1] - other[1]) > 5 for other in named)
        if room and x + 2 < place[0] < x + w - 18 and y + 4 < place[1] < y + h - 3:
            named.append(place)
            disc(page, place[0], place[1], float(rng.uniform(0.9, 1.7)), INKS[rng.integers(len(INKS))])
            write(page, made_up_word(rng)[:7].title(), place[0] + 2.3, place[1] + 1, 2.4, BLACK, bold=True)
    block(page, area, BLACK, 0.8)
