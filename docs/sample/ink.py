"""What the page is drawn with: inks and simple figures, in millimetres from the page's top left corner."""

import cv2
import numpy as np
from numpy.typing import NDArray

PX_PER_MM = 6
"""Resolution of the printed page, about four times that of the video."""

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]
"""Blue, green, red."""
Box = tuple[float, float, float, float]
"""Left, top, width, height."""

WHITE: Colour = (240, 245, 246)
BLACK: Colour = (34, 30, 28)
NAVY: Colour = (92, 48, 22)
RED: Colour = (44, 42, 196)
GREEN: Colour = (88, 138, 52)
OCHRE: Colour = (52, 158, 222)
SKY: Colour = (196, 148, 78)
PLUM: Colour = (118, 52, 112)
INKS = (NAVY, RED, GREEN, OCHRE, SKY, PLUM, BLACK)

_SYLLABLES = tuple(
    "pa per wi nd fol ds ki te ra sel mo de sha pe lu men ta vi bro cu ne sto gry ha zel um bre".split(" ")  # noqa: SIM905
)


def px(*lengths_mm: float) -> tuple[int, ...]:
    """Lengths in whole pixels of the page."""
    return tuple(round(length * PX_PER_MM) for length in lengths_mm)


def block(page: Image, area: Box, ink: Colour, line_mm: float = 0.0) -> None:
    """A rectangle: filled, or outlined if a line width is given."""
    x, y, w, h = area
    thickness = max(1, round(line_mm * PX_PER_MM)) if line_mm else -1
    left, top, right, bottom = px(x, y, x + w, y + h)
    cv2.rectangle(page, (left, top), (right - 1, bottom - 1), ink, thickness)


def disc(page: Image, x: float, y: float, radius: float, ink: Colour, line_mm: float = 0.0) -> None:
    """A disc, or a ring if a line width is given."""
    thickness = max(1, round(line_mm * PX_PER_MM)) if line_mm else -1
    left, top, r = px(x, y, radius)
    cv2.circle(page, (left, top), r, ink, thickness, cv2.LINE_AA)


def polygon(page: Image, points_mm: NDArray[np.float64], ink: Colour) -> None:
    """A filled polygon with the corners (n, 2)."""
    cv2.fillPoly(page, [np.rint(points_mm * PX_PER_MM).astype(np.int32)], ink, cv2.LINE_AA)


def polyline(page: Image, points_mm: NDArray[np.float64], ink: Colour, line_mm: float) -> None:
    """An open line through the points (n, 2)."""
    thickness = max(1, round(line_mm * PX_PER_MM))
    cv2.polylines(page, [np.rint(points_mm * PX_PER_MM).astype(np.int32)], False, ink, thickness, cv2.LINE_AA)


def write(
    page: Image,
    text: str,
    x: float,
    y: float,
    size: float,
    ink: Colour,
    bold: bool = False,
    room: float = np.inf,
) -> float:
    """Write with the base line at y and about `size` high; returns the width in mm, at most `room`.

    OpenCV 4 and 5 come with different fonts, so the width is known only here.
    """
    font = cv2.FONT_HERSHEY_DUPLEX if bold else cv2.FONT_HERSHEY_SIMPLEX
    (_, height), _ = cv2.getTextSize("H", font, 4.0, 1)
    scale = 4.0 * size * PX_PER_MM / height
    thickness = max(1, round(size * PX_PER_MM / (6 if bold else 10)))
    (width, _), _ = cv2.getTextSize(text, font, scale, thickness)
    if width > room * PX_PER_MM:
        return write(page, text, x, y, 0.98 * size * room * PX_PER_MM / width, ink, bold, room)
    left, bottom = px(x, y)
    cv2.putText(page, text, (left, bottom), font, scale, ink, thickness, cv2.LINE_AA)
    return float(width / PX_PER_MM)


def made_up_word(rng: np.random.Generator) -> str:
    """Something that looks like a word."""
    return "".join(rng.choice(_SYLLABLES, rng.integers(1, 4)))
