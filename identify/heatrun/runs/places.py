"""Where runs go that no folder was named for, and where none can go."""

from __future__ import annotations

from pathlib import Path

from ..bench.record import Record
from ..errors import InputError
from ..motor import Motor


def default_folder(motor: Motor, test: Record, order: str) -> Path:
    """Return where a run goes if no folder is given: named after motor and first test.

    Args:
        motor: The machine.
        test: The first test.
        order: What is calibrated, in a word.
    """
    words = f"{motor.name}-{test.name}-{order}"
    slug = "".join(c if c.isalnum() and c.isascii() else "-" for c in words.lower())
    while "--" in slug:
        slug = slug.replace("--", "-")
    return Path("results") / "runs" / slug.strip("-")[:80]


def refuse_unwritable(path: Path) -> None:
    """Raise an error if a folder's parent is a file.

    Raises:
        InputError: With what to do.
    """
    for parent in path.parents:
        if parent.is_file():
            raise InputError(
                f"{parent} is a file, expected a folder.", remedy="Choose another --out."
            )
