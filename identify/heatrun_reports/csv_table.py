"""The tables of a report as CSV, one figure a line, safe to open in a spreadsheet."""

from __future__ import annotations

import csv
import io
import math
import re

from .report import Cell, Report

HEAD = ("table", "of", "quantity", "value", "unit", "note")

FORMULA = re.compile(r"(^|[;\t\r\n|])(\s*)(?=[=+\-@\uFF1D\uFF0B\uFF0D\uFF20])")
"""Where a spreadsheet would see the beginning of a formula: at the start of a cell, and behind what
another locale takes for a delimiter; the last four are the full-width forms."""


def csv_table(report: Report) -> str:
    """Return all tables of a report, one figure a line.

    Numbers stay numbers, whatever their sign; texts that a spreadsheet would take for a formula get
    an apostrophe in front of it. What is undefined is an empty cell with its reason in the note.

    Args:
        report: Any report.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(HEAD)
    for row in report.rows:
        writer.writerow(_cells(report.title, report.test, row.label, row.value, row.unit, row.note))
    for table in report.tables:
        for line in table.lines:
            for column, cell in zip(table.columns, line.cells, strict=True):
                unit = line.unit if column.unit is None else column.unit
                writer.writerow(_cells(table.title, line.name, column.label, cell, unit, line.note))
    return stream.getvalue()


def neutral(text: str) -> str:
    """Return a text in which no spreadsheet sees a formula or a line of its own."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    return FORMULA.sub(r"\1\2'", plain)


def _cells(*cells: Cell) -> list[str]:
    return [_cell(cell) for cell in cells]


def _cell(cell: Cell) -> str:
    if isinstance(cell, str):
        return neutral(cell)
    return "" if cell is None or not math.isfinite(cell) else f"{cell:.10g}"
