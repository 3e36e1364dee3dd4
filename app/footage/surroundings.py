"""Another background behind the surface."""

import numpy as np

from app.arrays import Image
from app.footage.clip import Change, Clip
from app.footage.texture import texture

MARGIN_PX = 4  # around the surface, that stays
SWAY_PX, SWAY_FRAMES = 60.0, 80  # of a background that moves: how far, and how often


def background(*, moves: bool, seed: int = 2) -> Change:
    """Texture instead of what is around the surface, still or swaying."""

    def change(clip: Clip, frame: int, image: Image) -> Image:
        width, height = clip.size
        room = int(SWAY_PX)
        wall = texture(width + 2 * room, height + 2 * room, seed)
        turn = 2 * np.pi * frame / SWAY_FRAMES if moves else 0.0
        x, y = round(room * (1 + np.sin(turn))), round(room * (1 + 0.5 * np.sin(2 * turn)))
        return np.where(clip.mask(frame, MARGIN_PX)[..., None] > 0, image, wall[y : y + height, x : x + width])

    return change
