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
