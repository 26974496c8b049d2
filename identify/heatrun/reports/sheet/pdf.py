"""The parameter sheet as PDF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...results import FitResult
from .content import sheet_content
from .typeset import typeset


def write_pdf(result: FitResult, figures: Sequence[Path], path: Path) -> Path:
    """Write the sheet as PDF.

    Args:
        result: What stands in `fit.json`.
        figures: PNG files, in the order in which they are to appear.
        path: Where it goes; written whole or not at all.
    """
    return typeset("sheet.typ", sheet_content(result), figures, path)
