"""Announcements of programs that are about to be compiled, for a progress line.

Compiling takes seconds, loading a kept program takes tenths of a second. A command shows which of both
it is waiting for."""

import contextlib
import contextvars
from collections.abc import Callable, Iterator

Listener = Callable[[str], None]
"""A function that takes one line of text."""

LISTENER: contextvars.ContextVar[Listener | None] = contextvars.ContextVar("LISTENER", default=None)


@contextlib.contextmanager
def announced_to(listener: Listener) -> Iterator[None]:
    """Context manager: calls `listener` with one line of text before each program is compiled or loaded."""
    token = LISTENER.set(listener)
    try:
        yield
    finally:
        LISTENER.reset(token)


def announce(text: str) -> None:
    """Passes a line of text to the listener, if there is one."""
    listener = LISTENER.get()
    if listener is not None:
        listener(text)
