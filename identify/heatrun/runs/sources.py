"""The files that a run was made of: it keeps their paths and digests, and no signals."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from ..bench.readers.open_file import digest
from ..bench.stretch import split_stretch
from ..errors import InputError


@dataclass(frozen=True)
class SourceFile:
    """A file that a run was made of.

    Attributes:
        path: As it was given.
        sha256: Its digest then.
    """

    path: str
    sha256: str


def as_named(path: str, test: str, command: str) -> str:
    """Return a path with the sheet and the sampling rate that the run's command gave it, if it did.

    Args:
        path: The file.
        test: Name of the test; it tells sheets of one workbook apart.
        command: Of the run.
    """
    try:
        words = shlex.split(command)
    except ValueError:
        return path
    form = re.compile(re.escape(path) + r"(?:#(?P<sheet>.+?))?(?:@[0-9.]+\s*Hz)?", re.DOTALL)
    found = [
        named
        for word in words
        for part in _parts(word)
        if part != path and (named := form.fullmatch(part))
    ]
    of_test = [one for one in found if one["sheet"] and test.endswith(f"_{one['sheet']}")]
    return next((one[0] for one in (*of_test, *found)), path)


def _parts(word: str) -> list[str]:
    """Return a word of the command line and its files, without the stretch behind them."""
    test, _ = split_stretch(word)
    return [test, *test.split("+")]


def refuse_changed(file: SourceFile, run: Path, kind: str) -> None:
    """Refuse a file that is not what it was when the run was made.

    Args:
        file: The file.
        run: The run folder, for the message.
        kind: What the file is, for the message.

    Raises:
        InputError: If it is gone or has changed.
    """
    path, expected = file.path, file.sha256
    try:
        now = digest(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"the {kind} {path} of this run cannot be read ({reason}); the run keeps its path "
            "as it was given, and no signals.",
            where=str(run),
            remedy="Start the command in the folder that the run was started in, "
            "or put the file back.",
        ) from error
    if now != expected:
        raise InputError(
            f"the {kind} {path} has changed since the run: SHA-256 {expected[:12]}… then, "
            f"{now[:12]}… now.",
            where=str(run),
            remedy="Put the file of the run back, or calibrate again.",
        )
