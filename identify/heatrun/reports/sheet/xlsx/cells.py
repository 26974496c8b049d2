"""Cells of the workbook: numbers with the digits of the sheet."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..printed import places_of


class Cells:
    """Formats of a workbook, each made once.

    Attributes:
        bold: For headings.
    """

    def __init__(self, book: Any) -> None:
        self._book = book
        self._numbers: dict[int, Any] = {}
        self.bold = book.add_format({"bold": True})
        self.wrapped = book.add_format({"text_wrap": True, "valign": "top"})

    def digits(self, places: int) -> Any:
        """Return the format of numbers with so many decimal places; none for tens and hundreds."""
        shown = max(places, 0)
        if shown not in self._numbers:
            pattern = f"0.{'0' * shown}" if shown else "0"
            self._numbers[shown] = self._book.add_format({"num_format": pattern})
        return self._numbers[shown]

    def of(self, uncertainty: float | None) -> Any:
        """Return the format of numbers with this uncertainty; None where there is none."""
        if uncertainty is None or not np.isfinite(uncertainty) or uncertainty <= 0:
            return None
        return self.digits(places_of(uncertainty))


def write(sheet: Any, row: int, column: int, value: Any, form: Any = None) -> None:
    """Write a text as text, a finite number as a number, and nothing else.

    Args:
        sheet: The sheet of the workbook.
        row: From 0.
        column: From 0.
        value: What stands there.
        form: Format of a number, or None.
    """
    if isinstance(value, str):
        sheet.write_string(row, column, value)
    elif value is not None and np.isfinite(value):
        sheet.write_number(row, column, float(value), form)
