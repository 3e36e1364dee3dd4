"""What comes out: pose and shape of one frame, in pixels."""

from dataclasses import dataclass

from reconstruction.arrays import Array, Mask

SAME_BEND = 0.9  # cosine between two bends from which they count as one
SAME_TILT_DEGREES = 5.0  # turn between two poses up to which they count as one


@dataclass(frozen=True)
class Switch:
    """A change of branch: this frame's pose or bend is not the one that the frames before led to.

    Attributes:
        bend: cosine between the bends Γ_τ of the two branches: 1 is the same, −1 the mirror image.
        turned_degrees: rotation between their poses.
        share: energy of the new branch over that of the old one.
    """

    bend: float
    turned_degrees: float
    share: float

    def at(self, frame: int) -> str:
        """In words: `bent back at frame 61: energy 0.62 of the other branch`."""
        bent = "" if self.bend >= SAME_BEND else "bent back" if self.bend < 0 else "bent otherwise"
        tilted = f"tilted by {self.turned_degrees:.0f}°" if self.turned_degrees > SAME_TILT_DEGREES else ""
        what = " and ".join(filter(None, (bent, tilted)))
        return f"{what} at frame {frame}: energy {self.share:.2f} of the other branch"


@dataclass(frozen=True)
class ShapeEstimate:
    """One frame's pose and shape: S = R(S̄ + ΦΛΥ) moved in front of the camera (Eq. 3, 8).

    Attributes:
        frame: index in the order of observation.
        quaternion: (4,) of R, w first.
        R: (3, 3) rotation.
        t: (2,) image translation, px: where the shape's origin is seen, relative to the principal point.
        s: scale; the origin's depth is focal/s.
        Lambda: (3, r) coefficients Γ_α, Γ_β, Γ_τ, px.
        shape: (3, p) deformed shape in camera axes (x right, y down, z forward), pixels of the first frame.
        projection_px: (p, 2) the shape seen by the camera.
        residual_px: (p,) distance to the observation, NaN where not visible.
        visible: (p,) h^f.
        switch: the change of branch in this frame, if there was one.
        sigma: (p,) standard deviation of each vertex's distance from its true place, in the units of the shape, shift and
            turn of the whole apart (`window.uncertainty`); None unless asked for.
    """

    frame: int
    quaternion: Array
    R: Array
    t: Array
    s: float
    Lambda: Array
    shape: Array
    projection_px: Array
    residual_px: Array
    visible: Mask
    switch: Switch | None = None
    sigma: Array | None = None
