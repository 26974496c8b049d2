"""Letters that no font here can draw stand on paper as their numbers, not as empty boxes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import typst

ALWAYS_THERE = 0x250
"""Letters below this number, Latin ones with their accents, are in the font that typst brings."""

PROBE = b"""#let letters = json(bytes(sys.inputs.letters))
#set document(title: "probe")
#set text(font: "Libertinus Serif")
#text(letters)"""


@dataclass(frozen=True)
class Shown:
    """What can be set.

    Attributes:
        content: With each letter that no font has as `[U+674E]`.
        needs_system_fonts: Some letters are not in the fonts that typst brings. Only then are those
            of the machine asked, so that a document is the same on all machines where it can be.
    """

    content: dict[str, Any]
    needs_system_fonts: bool


def shown(content: Mapping[str, Any]) -> Shown:
    """Return the content of a document as the fonts of this machine can show it.

    Args:
        content: Strings, numbers, lists and objects.
    """
    letters = {c for c in json.dumps(content, ensure_ascii=False) if ord(c) >= ALWAYS_THERE}
    foreign = _lost(frozenset(letters), brought_alone=True)
    lost = _lost(foreign, brought_alone=False)
    if not lost:
        return Shown(dict(content), bool(foreign))
    table = str.maketrans({c: f"[U+{ord(c):04X}]" for c in lost})
    return Shown({key: _translated(each, table) for key, each in content.items()}, bool(foreign))


@cache
def _lost(letters: frozenset[str], *, brought_alone: bool) -> frozenset[str]:
    """Return those of some letters that no font has."""
    if not letters or _can_draw("".join(sorted(letters)), brought_alone):
        return frozenset()
    if len(letters) == 1:
        return letters
    ordered = sorted(letters)
    middle = len(ordered) // 2
    halves = (frozenset(ordered[:middle]), frozenset(ordered[middle:]))
    return frozenset().union(*(_lost(half, brought_alone=brought_alone) for half in halves))


def _can_draw(letters: str, brought_alone: bool) -> bool:
    """Return whether there is a picture for each letter: PDF/A allows no document without."""
    try:
        typst.compile(
            PROBE,
            format="pdf",
            sys_inputs={"letters": json.dumps(letters)},
            pdf_standards=["a-2b"],
            ignore_system_fonts=brought_alone,
        )
    except RuntimeError:
        return False
    return True


def _translated(value: Any, table: Mapping[int, str]) -> Any:
    if isinstance(value, str):
        return value.translate(table)
    if isinstance(value, Mapping):
        return {key: _translated(item, table) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_translated(item, table) for item in value]
    return value
