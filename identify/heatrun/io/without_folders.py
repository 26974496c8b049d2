"""Texts of documents that are passed on: files by their names, without the folders they lie in."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable
from pathlib import PurePath

ABSOLUTE = re.compile(r"""(?<![^\s'"`(=+,:;])(?:[A-Za-z]:)?[/\\](?:[^\s/\\'"`]+[/\\])+""")
"""Folders in front of a name, from the root on; a unit such as J/K has none."""

FOLDERS_OF_A_WORD = re.compile(r"[^+=]*[/\\](?=[^/\\])")
"""Those in a word of a command, which may join two files by + or give an option a value by =."""


def without_folders(text: str, paths: Iterable[str] = ()) -> str:
    """Return a text in which files stand without their folders.

    Args:
        text: Words from anywhere.
        paths: Paths that may stand in it, also relative ones and such with spaces.
    """
    for path in sorted(set(paths), key=len, reverse=True):
        name = PurePath(path).name
        if name and name != path:
            text = text.replace(path, name)
    return ABSOLUTE.sub("", text)


def command_without_folders(command: str) -> str:
    """Return a command line whose files stand without their folders."""
    try:
        words = shlex.split(command)
    except ValueError:  # an odd apostrophe, in a run of an earlier version
        words = command.split(" ")
    return shlex.join(FOLDERS_OF_A_WORD.sub("", word) for word in words)
