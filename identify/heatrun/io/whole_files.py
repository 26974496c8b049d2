"""Files that are there whole or not at all, whatever happens to the process that writes them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError

PARTIAL = ".partial"
"""End of the name of what is being written."""


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that a reader sees all of it or none, even after a kill.

    Args:
        path: The file; what it held before stays where the writing fails.
        content: What it is to hold.

    Raises:
        OSError: If it cannot be written; no part of it is left then.
    """
    with whole(path) as partial, partial.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a name to write a file under, which becomes `path` once that has succeeded.

    Args:
        path: The file.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    try:
        yield partial
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


@contextmanager
def writable(what: str, place: Path) -> Iterator[None]:
    """Turn what the system says of a place that cannot be written to into an error for the user.

    Args:
        what: What is written, such as `"the report"`.
        place: File or folder.

    Raises:
        InputError: Instead of an OSError.
    """
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{what} cannot be written: {error.strerror}.",
            where=str(place),
            remedy="Choose a writable folder with --out.",
        ) from error


def drop_partials(folder: Path) -> None:
    """Remove the pieces of files that killed processes left in a folder and below it.

    Args:
        folder: A folder that no other process writes to.
    """
    for piece in folder.rglob(f".*{PARTIAL}"):
        if piece.is_dir():
            shutil.rmtree(piece)
        else:
            piece.unlink()
