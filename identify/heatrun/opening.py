"""How bench files and motor files are opened: by their path, or as a server allows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from io import BufferedReader
from pathlib import Path

Opener = Callable[[Path], BufferedReader]

_opener: ContextVar[Opener | None] = ContextVar("opener", default=None)


def open_binary(path: str | Path) -> BufferedReader:
    """Open a file for reading; every reader opens its file by this function.

    Raises:
        OSError: If it cannot be opened.
        ValueError: If no file can have this name, or it may not be opened here.
    """
    opener = _opener.get()
    return Path(path).open("rb") if opener is None else opener(Path(path))


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
