"""Rows of units below or above the names of a text table, and which row holds the names."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ...channels.header import plain, unit_of_cell
from ...channels.units import LONGEST_UNIT, looks_like_unit

COMMENT = re.compile(r"\s*(?:#+|%+(?=\s|%)|//+|!+)\s*")
LEAD_WORDS = frozenset(
    ("unit", "units", "einheit", "einheiten", "unità", "unita", "unité", "unités", "unidad")
)
NO_UNITS = frozenset(
    ("time", "date", "date/time", "datetime", "date&time", "clock", "zeit", "datum", "uhrzeit",
     "ora", "data", "heure", "时间", "時間", "時刻", "시간", "no", "no.", "nr", "nr.", "#")
)  # fmt: skip
"""What loggers write in a row of units over columns that have none."""

RULE = frozenset("-=_")


def is_comment(line: str) -> bool:
    """Return whether a line is marked as a comment."""
    return COMMENT.match(line) is not None


def uncommented(row: Sequence[str]) -> list[str]:
    """Return the cells of a row without a sign of comments in front."""
    cells = list(row)
    found = COMMENT.match(f"{cells[0]} ") if cells else None
    if found is None:
        return cells
    cells[0] = cells[0][found.end() :].strip()
    return cells if cells[0] or len(cells) < 2 else cells[1:]


def units_of_row(row: Sequence[str], names: Sequence[str] | None = None) -> list[str | None] | None:
    """Return the units of a row by column, None if it is no row of units.

    Args:
        row: Cells of a line without numbers.
        names: Cells of the row above, if these can be names. Then most of the cells need to be
            units, and a cell that is not understood counts as a unit that is not known; without
            names all of them.
    """
    cells = [plain(cell) for cell in uncommented(row)]
    if names is not None and len(cells) < len(row) == len(names):
        cells = ["", *cells]  # the sign is a cell of its own, over a column of numbers of samples
    if cells and cells[0].strip("[]():").casefold() in LEAD_WORDS:
        cells[0] = ""
    if names is not None:
        cells = ["" if cell.strip("[]()").casefold() in NO_UNITS else cell for cell in cells]
    units = [unit_of_cell(cell) for cell in cells]
    filled = [cell for cell in cells if cell and not set(cell) <= RULE]
    unknown = [
        cell
        for cell, unit in zip(cells, units, strict=True)
        if cell and unit is None and not set(cell) <= RULE
    ]
    num_known = len(filled) - len(unknown)
    if num_known < 1 or any(len(cell) > LONGEST_UNIT for cell in unknown):
        return None
    if unknown:
        alike = sum(looks_like_unit(cell) for cell in unknown) + num_known
        if names is None or 2 * alike <= len(filled) or len(filled) < 2 or _is_names(row, names):
            return None
    return [unit or cell or None for unit, cell in zip(units, cells, strict=True)]


def _is_names(row: Sequence[str], above: Sequence[str]) -> bool:
    """Return whether a row is rather one of names, given the row above it."""
    num_above = sum(bool(cell.strip()) for cell in above)
    return num_above < sum(bool(cell.strip()) for cell in row) or units_of_row(above) is not None
