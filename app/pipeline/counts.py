"""What a run counts about its frames."""

from dataclasses import dataclass

from tracking.klt import Observation


@dataclass
class Tally:
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

    def add(self, observation: Observation, *, lost: bool) -> None:
        """Count a frame."""
        self.frames += 1
        self.frames_lost += lost
        self._share = float(observation.visible.mean())
        self._share_sum += self._share

    @property
    def words(self) -> dict[str, object]:
        """For the summary."""
        return {
            "visible_share": self._share_sum / self.frames if self.frames else None,
            "visible_share_last": self._share if self.frames else None,
            "objects": self.objects,
            "losses": self.losses,
            "recoveries": self.recoveries,
            "frames_lost": self.frames_lost,
        }
