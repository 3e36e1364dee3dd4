"""What a run counts about its frames."""

from dataclasses import dataclass, field

from tracking.klt import Observation


@dataclass
class Tally:
    """Counts of a run; nothing in it grows with the frames, unless lost ones are to be listed.

    Attributes:
        listing: whether the numbers of lost frames are kept.
        frames: so many so far.
        lost: numbers of frames without the surface, if listed.
        frames_lost: how many those are.
        losses: how often it was lost, and
        recoveries: found again.
    """

    listing: bool
    frames: int = 0
    lost: list[int] = field(default_factory=list)
    frames_lost: int = 0
    losses: int = 0
    recoveries: int = 0
    _share: float = 0.0
    _share_sum: float = 0.0

    def add(self, index: int, observation: Observation, *, lost: bool) -> None:
        """Count a frame."""
        self.frames += 1
        self._share = float(observation.visible.mean())
        self._share_sum += self._share
        if lost:
            self.frames_lost += 1
            if self.listing:
                self.lost.append(index)

    @property
    def words(self) -> dict[str, object]:
        """For the summary."""
        return {
            "visible_share": self._share_sum / self.frames if self.frames else None,
            "visible_share_last": self._share if self.frames else None,
            "losses": self.losses,
            "recoveries": self.recoveries,
            "frames_lost": self.frames_lost,
        }
