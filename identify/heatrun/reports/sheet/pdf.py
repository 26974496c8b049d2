"""The parameter sheet as PDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .typeset import typeset

WIDE, NARROW = 82, 62
"""Widths of figures in the annex [% of the line]: the square one would fill a page."""


def write_pdf(content: Mapping[str, Any], figures: Sequence[Path], path: Path) -> Path:
    """Write the sheet as PDF.

    Args:
        content: From `sheet_content`.
        figures: PNG files: that of page 1, then those of the annex.
        path: Where it goes; written whole or not at all.
    """
    widths = [NARROW if each.name == "posterior.png" else WIDE for each in figures]
    return typeset("sheet.typ", {**content, "widths": widths}, figures, path)
