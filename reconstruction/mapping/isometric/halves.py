"""Sheets of parts of the keyframes, each by itself; the sheet of all starts from the best of them."""

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.adjustment import sheet
from reconstruction.mapping.isometric.sheet import IsometricSheet

ROUNDS = 2  # are enough to compare parts by


class Halves:
    """What keyframes say of a sheet, part by part.

    Args:
        W: (F, 2, p) px of the keyframes, most different first; anything where not visible.
        visible: (F, p).
        camera: its focal length is taken as it is.
    """

    def __init__(self, W: Array, visible: Mask, camera: Camera) -> None:
        self._W, self._visible, self._camera = W, visible, camera
        self._found: list[IsometricSheet] = []

    def shapes(self, parts: list[Indices]) -> list[Array]:
        """Shapes (n, 3, p) in each part of the keyframes, the lengths by that part alone.

        Where the lengths of another part suit a part better than its own do, it had a bad start, and starts from them.

        Raises:
            ReconstructionError: the camera is orthographic, or there are fewer than 3 frames or 20 points.
        """
        images = [(self._W[part], self._visible[part]) for part in parts]
        alone = [sheet(w, h, self._camera, ROUNDS) for w, h in images]
        self._found = []
        for own, (w, h) in zip(alone, images, strict=True):
            other = min((one.finish(w, h) for one in alone if one is not own), key=lambda one: one.change)
            self._found.append(own if own.change <= other.change else sheet(w, h, self._camera, ROUNDS, other))
        return [found.shapes() for found in self._found]

    def whole(self) -> IsometricSheet:
        """The sheet of all keyframes, once there are shapes of parts with all of them.

        Raises:
            ReconstructionError: as above.
        """
        everywhere = [found.finish(self._W, self._visible) for found in self._found]
        start = min(everywhere, key=lambda one: one.change)
        return sheet(self._W, self._visible, self._camera, start=start)
