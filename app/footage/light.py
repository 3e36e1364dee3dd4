"""Light that changes, as lamps on mains, clouds and exposure control make it."""

import numpy as np

from app.arrays import Array, Image
from app.footage.clip import Change


def lit(image: Image, factor: Array | float) -> Image:
    """A picture times a factor."""
    return np.clip(image * factor, 0, 255).astype(np.uint8)


def alternating(share: float) -> Change:
    """Every other frame brighter, the others darker, by a share."""
    return lambda _, frame, image: lit(image, 1 + share * (1 - 2 * (frame % 2)))


def at_random(share: float, seed: int = 0) -> Change:
    """Every frame brighter or darker by up to a share, each for itself."""
    return lambda _, frame, image: lit(image, 1 + np.random.default_rng([seed, frame]).uniform(-share, share))


def bands(share: float, height_px: float = 200.0, step: float = 0.37) -> Change:
    """Bright and dark bands that roll over the picture by a step of their height a frame, as a shutter sees lamps."""
    return lambda _, frame, image: lit(
        image, (1 + share * np.sin(2 * np.pi * (np.arange(len(image)) / height_px - step * frame)))[:, None, None]
    )


def fading_in(frames: int) -> Change:
    """Black at first, in full light after so many frames."""
    return lambda _, frame, image: lit(image, min(1.0, frame / frames))
