"""What lies over the surface in the picture: a watermark, a time code, a thing that crosses."""

import cv2
import numpy as np

from app.arrays import Image
from app.footage.clip import Change, Clip
from app.footage.texture import texture

INK, SHADOW = (235, 235, 235), (20, 20, 20)


def watermark(share: float, seed: int = 0) -> Change:
    """A logo that does not move, over a share of the region, in its middle."""

    def change(clip: Clip, _: int, image: Image) -> Image:
        x, y, w, h = clip.roi
        width, height = round(w * share**0.5), round(h * share**0.5)
        left, top = x + (w - width) // 2, y + (h - height) // 2
        image = image.copy()
        image[top : top + height, left : left + width] = texture(width, height, seed)
        write(image, "ARCHIVE", (left + 4, top + height // 2), width / 170)
        return image

    return change


def time_code(clip: Clip, frame: int, image: Image) -> Image:
    """The time, over the lower part of the region."""
    x, y, w, h = clip.roi
    image = image.copy()
    write(image, f"CAM 2  {frame // 1800:02}:{frame // 30 % 60:02}:{frame % 30:02}", (x, y + round(0.85 * h)), w / 300)
    return image


def crossing(begins: int, speed_px: float, size_px: tuple[int, int], seed: int = 1) -> Change:
    """A textured rectangle (width, height) that goes through the picture from left to right, so many px a frame."""
    width, height = size_px
    thing = texture(width, height, seed)

    def change(clip: Clip, frame: int, image: Image) -> Image:
        left = round(-width + speed_px * (frame - begins))
        top = clip.roi[1] + (clip.roi[3] - height) // 2
        here = slice(max(left, 0), max(min(left + width, image.shape[1]), 0))
        if here.start >= here.stop:
            return image
        image = image.copy()
        image[max(top, 0) : top + height, here] = thing[max(-top, 0) :, here.start - left : here.stop - left][
            : image.shape[0] - max(top, 0)
        ]
        return image

    return change


def write(image: Image, text: str, place: tuple[int, int], size: float) -> None:
    """Light letters with a dark rim, into the picture."""
    for colour, thickness in ((SHADOW, 6), (INK, 2)):
        cv2.putText(image, text, place, cv2.FONT_HERSHEY_SIMPLEX, size, colour, thickness, cv2.LINE_AA)


def title(size: tuple[int, int]) -> Image:
    """A card (height, width, 3) with the film's title."""
    width, height = size
    card = np.full((height, width, 3), 30, np.uint8)
    for row, text in enumerate(("THE SHEET", "a film in one take", "all rights reserved")):
        write(card, text, (round(0.2 * width), round((0.35 + 0.15 * row) * height)), width / (400 + 200 * (row > 0)))
    return card
