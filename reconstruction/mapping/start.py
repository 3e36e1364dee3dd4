"""Where calls that take long are made: here and now, or elsewhere, while frames go on."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

Start = Callable[..., "Future[Any]"]
"""Begins a call (function, *arguments) somewhere."""


def at_once(function: Callable[..., Any], *arguments: object) -> "Future[Any]":
    """A call made here and now."""
    future: Future[Any] = Future()
    try:
        future.set_result(function(*arguments))
    except Exception as error:
        future.set_exception(error)
    return future
