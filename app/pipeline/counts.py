"""What a run counts about its frames."""

from dataclasses import dataclass

from tracking.guarded import Change, Guarded


@dataclass
class Counts:
    """Counts of a run; nothing in it grows with the frames.

    Attributes:
        frames: so many so far.
        objects: followed so far, one after another.
        frames_lost: frames without the surface.
        losses: how often it was lost, and
        recoveries: found again.
    """

    frames: int = 0
    objects: int = 1
    frames_lost: int = 0
    losses: int = 0
    recoveries: int = 0
    _share: float = 0.0
    _share_sum: float = 0.0

    def add(self, guarded: Guarded, *, lost: bool) -> None:
        """Count a frame, what was seen in it, and whether it is one without the surface."""
        self.frames += 1
        self.frames_lost += lost
        self.losses += guarded.change is Change.LOST
        self.recoveries += guarded.change is Change.RECOVERED
        self._share = float(guarded.observation.visible.mean())
        self._share_sum += self._share

    @property
    def visible_share(self) -> float | None:
        """Share of the points seen, mean over the frames."""
        return self._share_sum / self.frames if self.frames else None

    @property
    def visible_share_last(self) -> float | None:
        """In the last frame."""
        return self._share if self.frames else None
