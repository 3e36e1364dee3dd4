"""The other objects of a run: those that were followed before, and the next, looked for while one is lost."""

from collections.abc import Callable
from contextlib import ExitStack
from itertools import count

from app.arrays import Image
from app.options.run import Run
from app.pipeline.stages.messages import Asked, Seen
from app.pipeline.stopwatch import Stopwatch
from app.pipeline.successor import Successor, options_for_another
from app.pipeline.tracked_object import TrackedObject
from reconstruction.mapping.start import Start
from reconstruction.online import Phase
from tracking.guarded import Change, Guarded

MOST_KEPT = 20  # earlier objects, those seen last: they take memory, and time to look for
THOROUGHLY = 2 * MOST_KEPT  # frames without the object in each of which one of them is looked for; later, to save time, ...
SELDOM = 5  # ... in one out of so many
SURELY = 0.4  # share of its points that must be seen to take an earlier object for back: there are many to confuse


class Others:
    """What may be followed instead of an object that is lost; what was followed before comes before what is new.

    Args:
        config: what the person asked for.
        watch: to time new objects.
        start: begins to make models.
    """

    def __init__(self, config: Run, watch: Stopwatch, start: Start) -> None:
        self._config, self._watch, self._start = config, watch, start
        self._earlier: dict[int, TrackedObject] = {}  # by number, the one seen last at the end
        self._numbers = count(1)
        self._lost: Seen | None = None  # the frame in which the object was lost that is followed
        self._successor: Successor | None = None

    def lost(self, seen: Seen, objects: int, *, cut: bool) -> None:
        """The object is lost from a frame on, perhaps in a cut; so many have been followed."""
        config = options_for_another(self._config, objects + 1)
        self._lost, self._successor = seen, Successor(config, seen, self._numbers, self._watch, self._start, cut=cut)

    def recovered(self) -> None:
        """It is seen again."""
        self._lost = self._successor = None

    def look(self, seen: Seen, picture: Callable[[], Image]) -> None:
        """See whether the next frame shows something new to follow."""
        if self._successor:
            self._successor.look(seen, picture)

    def asked(self, seen: Seen, tracked: TrackedObject) -> Asked:
        """What to follow and to look for, after a frame, beside an object."""
        expected_px = {tracked.number: tracked.expected_px}
        if self._successor:
            expected_px |= self._successor.expected_px
        return Asked(expected_px, tuple(self._earlier), self._sought(seen))

    def instead(self, seen: Seen, tracked: TrackedObject) -> tuple[TrackedObject, str] | None:
        """What is followed from a frame on instead of an object that is lost, and how that came about, in words."""
        own = seen.objects.get(tracked.number)
        if self._lost is None or (isinstance(own, Guarded) and own.change is Change.RECOVERED):
            return None
        for number in self._earlier:
            found = seen.objects.get(number)
            if isinstance(found, Guarded) and found.observation.visible.mean() >= SURELY:
                self.recovered()
                earlier = self._earlier.pop(number)
                earlier.come_back(seen.index)
                return earlier, f"an earlier object is back in frame {seen.index}, last seen in frame {earlier.last}"
        successor = self._successor
        if successor is None or successor.found is None:
            return None
        self.recovered()
        return successor.found, f"another object from frame {seen.index} on: {successor.history}"

    def keep(self, tracked: TrackedObject) -> None:
        """From now on an object is an earlier one; the one seen longest ago may be forgotten, and its files are written.

        Raises:
            UsageError: they cannot be written.
        """
        if tracked.reconstruction.phase is not Phase.TRACKING:  # it has no model to go on with
            tracked.save()
            return
        self._earlier[tracked.number] = tracked
        if len(self._earlier) > MOST_KEPT:
            self._earlier.pop(next(iter(self._earlier))).save()

    def save(self) -> None:
        """Write the files of all that were followed.

        Raises:
            UsageError: one cannot be written.
        """
        with ExitStack() as all_of_them:
            for tracked in self._earlier.values():
                all_of_them.callback(tracked.save)

    def _sought(self, seen: Seen) -> int | None:
        """The earlier object that it is time to look for: each in turn."""
        if self._lost is None or not self._earlier:
            return None
        turn = seen.number - self._lost.number
        if turn >= THOROUGHLY:
            if turn % SELDOM:
                return None
            turn //= SELDOM
        return list(self._earlier)[turn % len(self._earlier)]
