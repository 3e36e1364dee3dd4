"""What a part of a verdict says: a word, the reason, and what helps."""

from dataclasses import dataclass
from typing import Literal

Grade = Literal["good", "fair", "poor"]
GRADES: tuple[Grade, ...] = ("poor", "fair", "good")


@dataclass(frozen=True)
class Verdict:
    """A word, the reason, and what helps."""

    grade: Grade
    reason: str

    @property
    def line(self) -> str:
        """`poor: 4.5 px from frame 115 on; …`."""
        return f"{self.grade}: {self.reason}"
