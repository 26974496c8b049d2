"""Text from files, made harmless for a terminal and for print."""

from __future__ import annotations

import re


def printable(text: str) -> str:
    """Escape control characters, so that a file name cannot steer the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)


JOINERS = "\u200c\u200d"
"""Signs without a picture that names in Persian and in Indian scripts are written with."""

LONGEST = 600
"""Letters of a cell or sentence that a sheet has room for."""


def clean(text: str) -> str:
    """Return a text without control characters, of bounded length, for print."""
    return "".join(c if c.isprintable() or c in JOINERS else " " for c in text)[:LONGEST]


LONG_WORD = re.compile(r"\S{20,}")
BREAK = "\u200b"  # a place where a line may break, without a sign


def with_breaks(text: str, every: int) -> str:
    """Return a text whose long words may break, behind signs or after some letters.

    Args:
        text: What is printed.
        every: Letters after which a word may break at the latest.
    """
    places = re.compile(rf"([_\-./\\,;:=+@]|.{{{every}}})(?=.)")
    return LONG_WORD.sub(lambda word: places.sub(rf"\1{BREAK}", word[0]), text)
