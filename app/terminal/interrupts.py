"""Ctrl-C and SIGTERM, answered only where a run can stop without loose ends."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def completed() -> Iterator[None]:
    """The body is completed before an interrupt is answered; a second one is answered at once.

    Raises:
        KeyboardInterrupt: one came meanwhile.
    """
    if threading.current_thread() is not threading.main_thread():  # signals do not come there anyway
        yield
        return
    received: list[int] = []

    def receive(number: int, _frame: object) -> None:
        if received:
            raise KeyboardInterrupt
        received.append(number)

    before = [(number, signal.signal(number, receive)) for number in SIGNALS]
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)
    if received:
        raise KeyboardInterrupt
