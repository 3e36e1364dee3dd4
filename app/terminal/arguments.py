"""What a person types, before it is parsed: lists of numbers in any form, and what was meant by a name there is not."""

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from app.terminal.errors import UsageError

NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", re.IGNORECASE)
COUNTS = {3: "three", 4: "four", 5: "five", 6: "six", 8: "eight"}


@dataclass(frozen=True)
class Numbers:
    """An option that takes several numbers.

    Attributes:
        names: of them.
        example: what a good one looks like.
        more: whether there may be more, in pairs.
        instead: other numbers that it takes as well.
    """

    names: str
    example: str
    more: bool = False
    instead: str = ""

    @property
    def count(self) -> int:
        """Of them, or the least."""
        return len(self.names.split())

    def fits(self, count: int) -> bool:
        """Whether so many are right."""
        if self.more:
            return count >= self.count and count % 2 == 0
        return count in {self.count, len(self.instead.split()) or self.count}


RECTANGLE = Numbers("X Y WIDTH HEIGHT", "195 95 325 265")
NUMBERS: Mapping[str, Numbers] = {
    "--roi": RECTANGLE,
    "--place": Numbers("X Y WIDTH HEIGHT", "250 160 90 60", instead="X1 Y1 X2 Y2 X3 Y3 X4 Y4"),
    "--corners": Numbers("X1 Y1 X2 Y2 X3 Y3 X4 Y4", "195 95 520 90 515 360 190 355"),
    "--polygon": Numbers("X1 Y1 X2 Y2 X3 Y3", "195 95 520 90 400 360", more=True),
    "--between": Numbers("X1 Y1 X2 Y2", "195 95 520 95"),
}


def spelled_out(arguments: Sequence[str]) -> list[str]:
    """Arguments with every list of numbers as single ones, `--roi 195,95,325,265` as `--roi 195 95 325 265`.

    Options with lists come last, so that what follows them is not taken for one more number.

    Raises:
        UsageError: not as many numbers as the option takes.
    """
    rest, lists = [], []
    waiting = list(arguments)
    while waiting:
        name, equals, value = waiting.pop(0).partition("=")
        if name not in NUMBERS:
            rest.append(name + equals + value)
            continue
        if equals:
            waiting.insert(0, value)
        given: list[str] = []
        while waiting and (few := numbers_in(waiting[0])):
            given += few
            waiting.pop(0)
        lists += [name, *checked(name, given, waiting)]
    return rest + lists


def words_of(name: str, options: str) -> list[str]:
    """Options in one text, as a shell takes them apart.

    Raises:
        UsageError: a quote is open.
    """
    try:
        return shlex.split(options)
    except ValueError as error:
        raise UsageError(f"{name}={options} ends too early ({str(error).lower()}): close the quotes") from error


def numbers_in(text: str) -> list[str]:
    """The numbers in `1,2`, `1 2`, `1;2`, `1x2` or `(1, 2)`; none if there is anything else."""
    parts = [part for part in re.split(r"[\s,;x×:()\[\]]+", text) if part]
    return parts if parts and all(NUMBER.fullmatch(part) for part in parts) else []


def checked(name: str, given: list[str], following: Sequence[str]) -> list[str]:
    """Numbers, if they are as many as an option takes."""
    wanted = NUMBERS[name]
    if wanted.fits(len(given)):
        return given
    told = f"{name} {' '.join(given)}".strip()
    if not given and following and not following[0].startswith("--"):
        told = f"{name} {following[0]}"
    problem = f"has {COUNTS.get(len(given), len(given))} numbers" if given else "has no numbers"
    pairs = ", and more pairs if wanted" if wanted.more else f" or {wanted.instead}" if wanted.instead else ""
    raise UsageError(f"{told} {problem}: give {wanted.names}{pairs}, for instance {name} {wanted.example}")


def meant(unknown: Sequence[str], options: Iterable[str], commands: Iterable[str] = ()) -> str:
    """What may have been meant by arguments that nobody knows, as a question; empty where nothing is like them."""
    known = list(options)
    for word in unknown:
        name, _, value = word.partition("=")
        like = get_close_matches(name, known if name.startswith("-") else list(commands), 1, 0.6)
        if like:
            return f"did you mean {like[0]}{'=' + value if value else ''}?"
    numbers = [number for word in unknown for number in numbers_in(word)]
    if len(numbers) == RECTANGLE.count and "--roi" in known:
        return f"did you mean --roi {' '.join(numbers)}?"
    return ""
