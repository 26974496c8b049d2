"""Names that nothing stands under yet, so that a second result does not replace a first."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from pathlib import Path

from ..errors import InputError


def numbered(path: Path, next_to: Path | None = None) -> Iterator[Path]:
    """Give a path, then the same with `-2`, `-3` and so on behind its stem.

    Args:
        path: A file, or a folder without a point in its name.
        next_to: What the numbers are put behind, where it is not the path itself.
    """
    yield path
    base = next_to or path
    for number in count(2):
        yield base.with_name(f"{base.stem}-{number}{base.suffix}")


def free_name(path: Path) -> Path:
    """Return the first of `numbered` that nothing stands under."""
    return next(place for place in numbered(path) if not place.exists())


def refuse_replacing(path: Path, what: str) -> None:
    """Refuse to replace a result that stands where another one was asked to go.

    Args:
        path: Where it was asked to go.
        what: What stands there, such as "a run".

    Raises:
        InputError: If something stands there.
    """
    if path.exists():
        raise InputError(
            f"{path} exists and holds {what}; it is left as it is.",
            remedy="Choose another --out, or pass --force to replace it.",
        )


def is_other(path: Path, content: bytes) -> bool:
    """Return whether a file is there and holds something else than it is to hold.

    Args:
        path: The file.
        content: What it is to hold.
    """
    try:
        return path.read_bytes() != content
    except OSError:
        return False  # it is not there, or writing fails with its own words
