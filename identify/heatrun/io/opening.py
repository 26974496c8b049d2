"""Who opens bench files and motor files: the readers by their path, or a server as it allows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import BinaryIO

Opener = Callable[[Path], BinaryIO]

_opener: ContextVar[Opener | None] = ContextVar("opener", default=None)


def opener_of_this_thread() -> Opener | None:
    """Return what opens files here; None where a path is opened as it is."""
    return _opener.get()


@contextmanager
def opening_by(opener: Opener) -> Iterator[None]:
    """Let the readers of this thread open files by a function, for the time of the context.

    Args:
        opener: Opens a file for reading, or raises OSError or InputError.
    """
    mark = _opener.set(opener)
    try:
        yield
    finally:
        _opener.reset(mark)
