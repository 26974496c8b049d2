"""How a text table is laid out: delimiter, decimal sign, preamble, header, units.

The numbers decide: that delimiter and decimal sign are taken under which most cells of the body
are numbers. Lines above the header are kept as preamble.
"""

from __future__ import annotations

import csv
import itertools
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import InputError
from .clock import CLOCK_CELL
from .dates import DATE_TIME_CELL
from .remarks import is_remark
from .text_decimal import GROUPED, NUMBER, is_unsettled
from .unit_rows import is_comment, uncommented, units_of_row

DELIMITERS = ("\t", ";", ",", "|", " ")
"""In the order of preference where two explain the lines alike; the blank means runs of blanks."""

SPOKEN = {"\t": "tab", ";": "';'", ",": "','", "|": "'|'", " ": "blanks"}

MISSING = frozenset(
    ("", "nan", "na", "n/a", "#n/a", "#na", "null", "none", "nil", "-", "--", "---", "?")
)
"""Cells, in lower case, that say: no value here."""

STATES = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0}
"""Switches, in lower case, as fans and relays are logged; they say nothing about the layout."""

GROUPED_CELL = {sign: re.compile(pattern) for sign, pattern in GROUPED.items()}

GROUPED_WEIGHT = 0.9
"""Below 1, so that 1,234 in a file of such cells is a decimal comma before it is a thousand."""

NUMBER_CELL = {sign: re.compile(pattern) for sign, pattern in NUMBER.items()}
QUOTED_OR_SOLID = re.compile(r'"[^"]*"|\S+')
HEAD_LINES = 2000  # the header is sought in these; longer preambles are not in use
SCORED_LINES = 200


@dataclass(frozen=True)
class Layout:
    """How the lines of a text table are to be read.

    Attributes:
        delimiter: One of `DELIMITERS`.
        decimal: `"."` or `","`.
        width: Number of cells in a line of data.
        names: Cells of the header, at most `width`.
        units: Rows of units, each with the unit text by column, None where a cell is empty.
        preamble: Lines above the header, and comments below it.
        first_line: Index of the first line of data, counted from 0.
        is_unsettled: Every number with the decimal sign may be a whole one with a separator of
            thousands.
    """

    delimiter: str
    decimal: str
    width: int
    names: tuple[str, ...]
    units: tuple[tuple[str | None, ...], ...]
    preamble: tuple[str, ...]
    first_line: int
    is_unsettled: bool = False

    @property
    def description(self) -> str:
        """The layout in words, as in "';', decimal comma"."""
        return SPOKEN[self.delimiter] + (", decimal comma" if self.decimal == "," else "")


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


def find_layout(text: str, where: str, stated_decimal: str | None = None) -> Layout:
    r"""Return the layout of a text table.

    Args:
        text: The whole text, with `\n` line ends.
        where: The file, for messages.
        stated_decimal: Decimal sign that the motor file states, or None.

    Raises:
        InputError: If there is no table of numbers, only one column, no header or no data.
    """
    lines = text.split("\n", HEAD_LINES)[:HEAD_LINES]
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise InputError("Expected a table, got an empty file.", where=where, remedy=_COPY_AGAIN)
    signs = (".", ",") if stated_decimal is None else (stated_decimal,)
    delimiter, decimal, width = _best_split(lines, signs, where)
    if (
        stated_decimal is None
        and delimiter != ","
        and decimal == "."
        and not re.search(r"[0-9]\.[0-9]", text)
    ):
        # Only whole numbers so far: the sign may show itself far below the sample.
        decimal = "," if re.search(r"[0-9],[0-9]", text) else "."

    rows = [split_line(line, delimiter) for line in lines]
    numeric = _numeric_columns(rows, width, decimal)
    start = next((i for i, row in enumerate(rows) if _is_data(row, numeric, decimal)), None)
    if start is None:
        raise _no_table(where)
    header = _header_above(lines, rows, start, numeric, decimal)
    if header is None and any(not _is_value(cell, decimal) for cell in rows[start]):
        header = start  # numbers as names: "Time;1;2;3"
    if header is None:
        raise InputError(
            f"Expected a row of column names above the numbers, found none above line {start + 1}.",
            where=where,
            remedy=f"Add a row of names and units above: time_s{delimiter}winding_degC and so on.",
        )
    units = _units_above(lines, rows, header, decimal)
    above, first = list(lines[:header]), header + 1
    while first < len(rows):
        row = units_of_row(rows[first], rows[header]) if _is_text(rows[first], decimal) else None
        units += [row] if row else []
        if row is None and is_comment(lines[first]) and _is_text(rows[first], decimal):
            above.append(lines[first])
        elif row is None and not _is_rule(rows[first]):
            break
        first += 1
    return Layout(
        delimiter,
        decimal,
        width,
        _names(lines[header], rows[header], delimiter, width, where),
        tuple(_in_columns(row, width) for row in units),
        tuple(said for line in above if (said := line.strip(' \t",;|'))),
        first,
        stated_decimal is None and is_unsettled(text, first, delimiter, decimal),
    )


_COPY_AGAIN = "Copy the file again from the bench; it may have been cut."


def is_time(cell: str) -> bool:
    """Return whether a cell is a clock time or a date with a time."""
    return bool(CLOCK_CELL.fullmatch(cell) or DATE_TIME_CELL.fullmatch(cell))


def is_number(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number under a decimal sign."""
    return NUMBER_CELL[decimal].fullmatch(cell) is not None


def _is_value(cell: str, decimal: str) -> bool:
    return cell.lower() in MISSING or is_number(cell, decimal) or is_time(cell)


def _filled(row: Sequence[str]) -> list[str]:
    return [cell for cell in row if cell.lower() not in MISSING and cell.lower() not in STATES]


def _num_values(cells: Sequence[str], decimal: str) -> int:
    return sum(is_number(cell, decimal) or is_time(cell) for cell in cells)


def _best_split(lines: Sequence[str], signs: Sequence[str], where: str) -> tuple[str, str, int]:
    """Return delimiter, decimal sign and width under which most cells are numbers."""
    step = max(1, len(lines) // SCORED_LINES)
    sample = lines[::step] if step > 1 else lines
    best, best_score = None, 0.0
    single = False
    for delimiter in DELIMITERS:
        rows = [split_line(line, delimiter) for line in sample]
        for decimal in signs:
            score_of: defaultdict[int, float] = defaultdict(float)
            for row in rows:
                filled = _filled(row)
                values = _num_values(filled, decimal) + GROUPED_WEIGHT * sum(
                    GROUPED_CELL[decimal].fullmatch(cell) is not None for cell in filled
                )
                if 2 * values >= len(filled) and values:
                    # Weighed by purity, so that "1,5;2,5" is not three cells of which two are
                    # numbers but two cells that both are.
                    score_of[len(row)] += values * values / len(filled)
            if not score_of:
                continue
            width, score = max(score_of.items(), key=lambda item: item[1])
            single = single or width == 1
            if width > 1 and score > best_score:
                best, best_score = (delimiter, decimal, width), score
    if best is not None:
        return best
    if single:
        raise InputError(
            "Expected a table, got one single column of numbers.",
            where=where,
            remedy="Separate the columns by ',', ';', tab, '|' or blanks; one must be the time.",
        )
    raise _no_table(where)


def _no_table(where: str) -> InputError:
    return InputError(
        "Expected a table of numbers below a row of names, found no line of numbers.",
        where=where,
        remedy="Check that this is the recording, and that the export contains the samples.",
    )


def _numeric_columns(rows: Sequence[list[str]], width: int, decimal: str) -> list[bool]:
    """Return which columns mostly hold numbers in the lines that look like data."""
    likely = [
        row
        for row in rows
        if len(row) == width and 2 * _num_values(_filled(row), decimal) >= len(_filled(row)) > 0
    ]
    numeric = []
    for column in range(width):
        cells = _filled([row[column] for row in likely])
        numeric.append(2 * _num_values(cells, decimal) > len(cells))
    return numeric


def _is_data(row: Sequence[str], numeric: Sequence[bool], decimal: str) -> bool:
    """Return whether more than half of a row's cells in numeric columns are numbers."""
    if len(row) != len(numeric):
        return False
    cells = _filled([cell for cell, is_numeric in zip(row, numeric, strict=True) if is_numeric])
    return 2 * _num_values(cells, decimal) > len(cells)


def _header_above(
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
        if len(_filled(rows[index])) >= 2
        and not _is_rule(rows[index])
        and not _num_values(
            [cell for cell, known in zip(rows[index], numeric, strict=False) if known], decimal
        )
    ]
    fallback = None
    for index, above in itertools.zip_longest(candidates, candidates[1:]):
        names = rows[above] if above is not None and above == index - 1 else None
        if units_of_row(rows[index], names) is None:
            if not is_comment(lines[index]):
                return index
            is_wide = len(_trimmed(uncommented(rows[index]))) == len(numeric)
            if is_wide and not (above is not None and is_remark(lines[index], rows[above])):
                return index
        fallback = index if fallback is None else fallback
    return fallback


def _units_above(
    lines: Sequence[str], rows: Sequence[list[str]], header: int, decimal: str
) -> list[list[str | None]]:
    """Return the row of units above the names, if the next line that is filled is one."""
    for index in range(header - 1, -1, -1):
        if not lines[index].strip() or _is_rule(rows[index]):
            continue
        row = units_of_row(rows[index]) if _is_text(rows[index], decimal) else None
        is_one = row is not None and len(_filled(rows[index])) >= 2
        return [row] if row and is_one and len(row) <= len(rows[header]) + 1 else []
    return []


def _in_columns(row: list[str | None], width: int) -> tuple[str | None, ...]:
    """Return the cells of a row of units by column; in front there may be one cell "Unit" more."""
    cells = row[1:] if len(row) == width + 1 and row[0] is None and row[-1] else row
    return tuple((*cells, *(None,) * width)[:width])


def _is_text(row: Sequence[str], decimal: str) -> bool:
    return not _num_values(_filled(row), decimal)


def _is_rule(row: Sequence[str]) -> bool:
    """Return whether a row below the header is a rule or empty."""
    return all(set(cell) <= set("-=_") for cell in _filled(row))


def _names(line: str, row: list[str], delimiter: str, width: int, where: str) -> tuple[str, ...]:
    """Return the names of a header line, checked against the width of the data."""
    names = _trimmed(row)
    if len(names) != width and line.lstrip()[:1] in ("#", "%"):
        names = _trimmed(split_line(line.lstrip().lstrip("#%"), delimiter))
    if len(names) > width and delimiter == " ":
        names = re.split(r"\s{2,}|\t", line.strip())
    if len(names) > width:
        raise InputError(
            f"The header names {len(names)} columns, the lines of data have {width}.",
            where=where,
            remedy="Give each column one name; names with blanks need quotes or another delimiter.",
        )
    # Names that are empty cells are kept: they tell a padded header from one that is too short.
    return tuple(names) + ("",) * (min(len(row), width) - len(names))


def _trimmed(row: list[str]) -> list[str]:
    end = len(row)
    while end and not row[end - 1]:
        end -= 1
    return row[:end]
