"""Where the tracking stage runs: in a process of its own, or in the run's."""

from collections import deque
from types import TracebackType
from typing import Protocol, Self

import cv2

from app.arrays import Image
from app.pipeline.stages.messages import LAG, Asked, Footage, Opened, Seen, first_asked
from app.pipeline.stages.tracking import TrackingStage
from app.pipeline.stages.working_copy import resized
from app.processes.child import connection_to_parent, inherited_file
from app.processes.remote import Remote, serve
from app.processes.ring import Ring


class Tracking(Protocol):
    """The stage, wherever it is: messages go in, answers come back in their order, `first_asked` those to begin with."""

    opened: Opened

    def send(self, asked: Asked) -> None:
        """Ask for another frame."""

    def receive(self) -> Seen | None:
        """What the oldest frame asked for shows; None at the end of the source."""

    def picture(self, number: int, *, keep: bool) -> Image:
        """The picture of one of the last frames received, by its number: one to keep is as large as the source's."""


class TrackingHere:
    """The stage in this process; a context manager that closes the source.

    Args:
        footage: as for `TrackingStage`.
    """

    def __init__(self, footage: Footage) -> None:
        self._pictures: dict[int, Image] = {}
        self._stage = TrackingStage(footage)
        self._waiting = deque(first_asked())
        self.opened = self._stage.opened

    def send(self, asked: Asked) -> None:
        """It waits until the answer is wanted."""
        self._waiting.append(asked)

    def receive(self) -> Seen | None:
        """Find it out."""
        return self._stage.next(self._waiting.popleft(), self._keep)

    def picture(self, number: int, *, keep: bool) -> Image:
        """The frame's own, or larger."""
        return resized(self._pictures[number], self.opened.size) if keep else self._pictures[number]

    def _keep(self, number: int, picture: Image) -> None:
        self._pictures.pop(number - LAG, None)
        self._pictures[number] = picture

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._stage.video.close()


class TrackingProcess:
    """The stage in a process of its own; a context manager that ends it.

    Args:
        remote: the process, which knows its source, and what it is asked first.
        pictures: the `shared_file` that it writes pictures to.
    """

    def __init__(self, remote: Remote, pictures: int) -> None:
        self._remote = remote
        self.opened: Opened = self._remote.receive()
        self.ring = Ring(pictures, self.opened.kept)

    def send(self, asked: Asked) -> None:
        """Ask for another frame."""
        self._remote.send(asked)

    def receive(self) -> Seen | None:
        """What the oldest frame asked for shows."""
        seen: Seen | None = self._remote.receive()
        return seen

    def picture(self, number: int, *, keep: bool) -> Image:
        """The one in the ring, or a copy."""
        picture = self.ring.picture(number)
        return resized(picture.copy(), self.opened.size) if keep else picture

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._remote.end()


def main() -> None:
    """What the process does: it opens the source, then it answers what is asked, until nobody listens any more."""
    cv2.setNumThreads(1)
    connection, pictures = connection_to_parent(), inherited_file(2)
    stage: TrackingStage
    ring: Ring

    def answer(message: Footage | Asked) -> Opened | Seen | None:
        nonlocal stage, ring
        if isinstance(message, Asked):
            return stage.next(message, ring.write)
        stage = TrackingStage(message)
        ring = Ring(pictures, stage.opened.kept)
        return stage.opened

    serve(connection, answer)


if __name__ == "__main__":
    main()
