"""Which line of a text table holds the names of the columns, and which ones units above it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from ...channels.header import LONGEST_NAME, plain, read_heading
from ...channels.labels import without_sure_unit
from ...channels.maps import TIME_NAMES
from ...channels.units import is_unit
from .cells import filled, is_rule, is_text, num_values, trimmed
from .remarks import is_remark
from .unit_rows import is_comment, uncommented, units_of_row

TIMES = frozenset((*TIME_NAMES.entries, "time", "time_s"))
"""Names of the time, in lower case, by which a row of names is told from one of devices."""

MOST_ROWS_BELOW = 3
"""So many rows of units, devices and descriptions may stand between names and data."""


def header_above(
    lines: Sequence[str],
    rows: Sequence[list[str]],
    start: int,
    numeric: Sequence[bool],
    decimal: str,
) -> int | None:
    """Return the nearest line above the data that can be a row of names."""
    candidates = [
        index
        for index in range(start - 1, -1, -1)
        if len(filled(rows[index])) >= 2
        and not is_rule(rows[index])
        and not num_values(
            [cell for cell, known in zip(rows[index], numeric, strict=False) if known], decimal
        )
    ]
    fallback = None
    for index, above in itertools.zip_longest(candidates, candidates[1:]):
        names = rows[above] if above is not None and above == index - 1 else None
        if units_of_row(rows[index], names) is None:
            if not is_comment(lines[index]):
                return index
            is_wide = len(trimmed(uncommented(rows[index]))) == len(numeric)
            if is_wide and not (above is not None and is_remark(lines[index], rows[above])):
                return index
        fallback = index if fallback is None else fallback
    return fallback


def names_above(
    lines: Sequence[str], rows: Sequence[list[str]], header: int, start: int, width: int
) -> int:
    """Return the row of names where the nearest one may hold devices or descriptions.

    It is the one above if that one alone names the time and has a name for each column, and if no
    row in between says a word of units that would be lost.

    Args:
        lines: The first lines of the file.
        rows: Their cells.
        header: Index of the nearest row that can be one of names.
        start: Index of the first row of data.
        width: Number of columns.
    """
    if _names_time(rows[header]):
        return header
    for index in range(header - 1, max(header - 1 - MOST_ROWS_BELOW, -1), -1):
        row = rows[index]
        if is_rule(row) or units_of_row(row) is not None:
            continue
        is_names = (
            len(trimmed(row)) == width == len({cell for cell in row if cell})
            and is_text(row, ".")
            and _names_time(row)
            and not is_comment(lines[index])
        )
        if is_names:
            between = [one for one in rows[index + 1 : start] if units_of_row(one, row) is None]
            return header if any(map(_speaks_of_units, between)) else index
    return header


def _names_time(row: Sequence[str]) -> bool:
    labels = (read_heading(cell).label for cell in row if len(cell) <= LONGEST_NAME)
    return any(without_sure_unit(label).casefold() in TIMES for label in labels)


def _speaks_of_units(row: Sequence[str]) -> bool:
    """Return whether a cell is a unit or names one."""
    return any(
        len(cell) > LONGEST_NAME
        or is_unit(cell)
        or read_heading(cell).units
        or without_sure_unit(cell) != plain(cell)
        for cell in row
        if cell
    )


def units_above(
    lines: Sequence[str], rows: Sequence[list[str]], header: int, decimal: str
) -> list[list[str | None]]:
    """Return the row of units above the names, if the next line that is filled is one."""
    for index in range(header - 1, -1, -1):
        if not lines[index].strip() or is_rule(rows[index]):
            continue
        row = units_of_row(rows[index]) if is_text(rows[index], decimal) else None
        is_wide = len(rows[index]) == len(rows[header]) > 1 and not rows[index][0]
        is_one = row is not None and (is_wide or len(filled(rows[index])) >= 2)
        return [row] if row and is_one and len(row) <= len(rows[header]) + 1 else []
    return []


def in_columns(row: list[str | None], width: int) -> tuple[str | None, ...]:
    """Return the cells of a row of units by column; in front there may be one cell "Unit" more."""
    cells = row[1:] if len(row) == width + 1 and row[0] is None and row[-1] else row
    return tuple((*cells, *(None,) * width)[:width])
