"""The parameter sheet as PDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...io.printable import with_breaks
from .page_fill import filling_height, size_in
from .typeset import typeset

BREAKS_EVERY = 15
"""Letters of a long word after which it may break in the narrow cells of page 1."""

TEMPLATE = "sheet.typ"

WIDE, WIDEST_SQUARE = 82, 62
"""Widths of figures in the annex [% of the line]; the square one of few parameters is narrower."""

WIDEST = 100
"""Width to which a figure grows where a page would stay empty [% of the line]."""


def write_pdf(content: Mapping[str, Any], figures: Sequence[Path], path: Path) -> Path:
    """Write the sheet as PDF.

    Args:
        content: From `sheet_content`.
        figures: PNG files: that of page 1, then those of the annex.
        path: Where it goes; written whole or not at all.
    """
    page_1 = _breakable(content["certificate"])
    square = min(WIDEST_SQUARE, 22 + 8 * len(content["models"][-1]["correlation"]["names"]))
    widths = [square if each.name == "posterior.png" else WIDE for each in figures]
    texts = {**content, "certificate": page_1, "widths": widths}
    # an image whose width grows with its height keeps its proportions
    share = filling_height(TEMPLATE, texts, [size_in(each) for each in figures], WIDEST / WIDE)
    return typeset(TEMPLATE, {**texts, "widths": [share * w for w in widths]}, figures, path)


def _breakable(value: Any) -> Any:
    """Return texts whose long words may break, at any depth of lists and objects."""
    if isinstance(value, str):
        return with_breaks(value, BREAKS_EVERY)
    if isinstance(value, Mapping):
        return {key: _breakable(item) for key, item in value.items()}
    return [_breakable(item) for item in value] if isinstance(value, list) else value
