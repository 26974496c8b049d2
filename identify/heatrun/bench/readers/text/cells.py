"""The cells of a line of a text table: what is a number, a time, a text or nothing."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

from ...channels.header import plain
from ...clocks.clock import CLOCK_CELL, DAYS_CELL
from ...clocks.date_words import SHORT_FRACTION, is_worded_date, plain_clock
from ...clocks.dates import DATE_TIME_CELL
from .decimals import NUMBER, SIGN_APART

MISSING = frozenset(
    ("", "nan", "na", "n/a", "#n/a", "#na", "null", "none", "nil", "-", "--", "---", "?")
)
"""Cells, in lower case, that say: no value here."""

STATES = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0}
"""Switches, in lower case, as fans and relays are logged; they say nothing about the layout."""

NUMBER_CELL = {sign: re.compile(pattern) for sign, pattern in NUMBER.items()}
QUOTED_OR_SOLID = re.compile(r'"[^"]*"|\S+')


def split_line(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line without quotes and outer blanks.

    Args:
        line: Without its line end.
        delimiter: One of `DELIMITERS`.
    """
    if delimiter == " ":
        if '"' not in line:
            return line.split()
        return [cell.strip('"').strip() for cell in QUOTED_OR_SOLID.findall(line)]
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        cells = line.split(delimiter)
    return [cell.strip() for cell in cells]


def is_time(cell: str) -> bool:
    """Return whether a cell is a clock time or a date with a time."""
    cell = plain_clock(cell)
    return bool(
        CLOCK_CELL.fullmatch(cell)
        or DATE_TIME_CELL.fullmatch(cell)
        or DAYS_CELL.fullmatch(cell)
        or SHORT_FRACTION.fullmatch(cell)
        or is_worded_date(cell)
    )


def is_number(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number under a decimal sign."""
    return NUMBER_CELL[decimal].fullmatch(bare(cell)) is not None


def bare(cell: str) -> str:
    """Return a cell with plain signs and digits, the sign of a number next to its digits."""
    if cell[:1] in "+-" or not cell.isascii():
        return re.sub(SIGN_APART, r"\1", plain(cell))
    return cell


def is_value(cell: str, decimal: str) -> bool:
    """Return whether a cell holds a value: a number, a time or the mark of none."""
    return cell.lower() in MISSING or is_number(cell, decimal) or is_time(cell)


def filled(row: Sequence[str]) -> list[str]:
    """Return the cells that say something of the layout."""
    return [cell for cell in row if cell.lower() not in MISSING and cell.lower() not in STATES]


def num_values(cells: Sequence[str], decimal: str) -> int:
    """Return how many cells are numbers or times."""
    return sum(is_number(cell, decimal) or is_time(cell) for cell in cells)


def is_text(row: Sequence[str], decimal: str) -> bool:
    """Return whether no cell of a row is a number or a time."""
    return not num_values(filled(row), decimal)


def is_rule(row: Sequence[str]) -> bool:
    """Return whether a row below the header is a rule or empty."""
    return all(set(cell) <= set("-=_") for cell in filled(row))


def trimmed(row: list[str]) -> list[str]:
    """Return a row without the empty cells at its end."""
    end = len(row)
    while end and not row[end - 1]:
        end -= 1
    return row[:end]
