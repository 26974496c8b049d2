"""The parameter sheet as PDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...io.printable import with_breaks
from .glyphs import shown
from .page_fill import asked, filling_height, size_in
from .typeset import TEMPLATES, typeset

BREAKS_EVERY = 15
"""Letters of a long word after which it may break in the narrow cells of page 1."""

TEMPLATE = TEMPLATES / "sheet.typ"

WIDE = 82
"""Width of the figures in the annex [% of the line]."""

WIDEST = 100
"""Width to which a figure grows where a page would stay empty [% of the line]."""

MOST_COURSES = 4
"""Courses of tests in the annex; those of further tests lie among the files alone."""

FLATTEST, HIGHEST = 0.3, 1.2
"""Height over width of the figure of page 1 [1], whatever room is left."""


def write_pdf(content: Mapping[str, Any], figures: Sequence[Path], path: Path) -> Path:
    """Write the sheet as PDF.

    Args:
        content: From `sheet_content`.
        figures: PNG files: that of page 1, then the courses of the tests.
        path: Where it goes; written whole or not at all.
    """
    shown = figures[: 1 + MOST_COURSES]
    texts = _texts(content, [WIDE] * len(shown))
    # an image whose width grows with its height keeps its proportions
    share = filling_height(TEMPLATE, texts, [size_in(each) for each in shown], WIDEST / WIDE)
    return typeset(TEMPLATE, _texts(content, [share * WIDE] * len(shown)), shown, path)


def aspect_on_page_1(content: Mapping[str, Any]) -> float:
    """Return height over width of the room that page 1 has for its figure [1].

    Args:
        content: From `sheet_content`.
    """
    (room,) = asked(TEMPLATE, shown(_texts(content, [])), "<room>")
    return min(HIGHEST, max(FLATTEST, room["height"] / room["width"]))


def _texts(content: Mapping[str, Any], widths: Sequence[float]) -> dict[str, Any]:
    return {**content, "certificate": _breakable(content["certificate"]), "widths": list(widths)}


def _breakable(value: Any) -> Any:
    """Return texts whose long words may break, at any depth of lists and objects."""
    if isinstance(value, str):
        return with_breaks(value, BREAKS_EVERY)
    if isinstance(value, Mapping):
        return {key: _breakable(item) for key, item in value.items()}
    return [_breakable(item) for item in value] if isinstance(value, list) else value
