"""How a text table is laid out: delimiter, decimal sign, preamble, header, units.

The numbers decide: that delimiter and decimal sign are taken under which most cells of the body are
numbers. Lines above the header are kept as preamble. The rows of names and of units come first.
"""

import itertools
import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ...record.header import LONGEST_NAME, plain, read_heading, unit_of_cell
from ...record.units import is_unit
from ..labels import names_time, without_sure_unit
from .remarks import (
    CALLED,
    COMMENTS,
    X_NAME,
    is_comment,
    is_remark,
    names_of_inputs,
    uncommented,
    units_of_remarks,
    units_of_row,
)
from .values import (
    GROUPED,
    filled,
    is_rule,
    is_text,
    is_unsettled,
    is_value,
    num_values,
    split_line,
    trimmed,
)

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
    row in between, down to the first one of data at `start`, says a word of units that would be
    lost.
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
    """Return whether a cell does: so a row of names is told from one of devices."""
    return any(names_time(cell) for cell in row if len(cell) <= LONGEST_NAME)


def _told_apart(names: tuple[str, ...], above: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return names of which some stand over several columns, such as "Value", with what stands
    above them; in place of them where they leave a column without a name that has one there.
    """
    again = {name for name, count in Counter(filter(None, names)).items() if count > 1}
    for row in reversed(above):
        cells = tuple((*row, *("",) * len(names))[: len(names)])
        if not again or len(row) < 2 or is_rule(row) or units_of_row(row) is not None:
            continue
        is_better = any(cell and not name for cell, name in zip(cells, names, strict=True))
        if is_better and "" not in cells and len(set(cells)) == len(cells) and is_text(row, "."):
            return cells
        told = [f"{cell} {name}".strip() if name in again else name
                for cell, name in zip(cells, names, strict=True)]  # fmt: skip
        if not is_better and len({*told}) == len(told):
            return tuple(told)
    return names


class Keyed(NamedTuple):
    """A header in which each line begins with what it says of the columns behind."""

    names: int  # Index of the line of names.
    units: Sequence[str]  # Cells of the line of units, without what it begins with.
    start: int  # Index of the first line of data.


def _keyed(rows: Sequence[list[str]], data: Sequence[int], width: int) -> Keyed | None:
    """Return a header of such lines, above data that begin with an empty cell each."""
    if any(rows[i][0] for i in data[-3:]):
        return None
    heads = {row[0].casefold(): i for i, row in enumerate(rows[: data[-1]]) if len(row) == width}
    names = next((i for head, i in heads.items() if head in CALLED), None)
    units = next((i for head, i in heads.items() if head in KEYED_UNITS), None)
    if names is None or units is None:
        return None
    last = max((i for head, i in heads.items() if head and head not in KEYED_DATA), default=0)
    return Keyed(names, rows[units][1:], next(i for i in data if i > last))


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


DELIMITERS = ("\t", ";", ",", "|", " ")
"""In the order of preference where two explain the lines alike; the blank means runs of blanks."""

SPOKEN = {"\t": "tab", ";": "';'", ",": "','", "|": "'|'", " ": "blanks"}

GROUPED_CELL = {sign: re.compile(pattern) for sign, pattern in GROUPED.items()}

GROUPED_WEIGHT = 0.9
"""Below 1, so that 1,234 in a file of such cells is a decimal comma before it is a thousand."""

BLANK_WEIGHT = 0.8
"""Below 1, since blanks also split what tabs separate, and a preamble with it."""

KEYED_UNITS, KEYED_DATA = ("unit", "units", "vunit"), ("trace_values",)
"""What lines of units and of data begin with where each line of a header does."""

SETTINGS_SHARE = 0.1
"""A block of fewer lines [1] than this share of the table, under other names, is of settings."""

DECIMAL_SEPARATOR = re.compile(
    r"^[\s\"]*decimal[_ ]separator[\s\";:=]+(?P<sign>[.,])[\s\"]*$", re.IGNORECASE | re.MULTILINE
)
"""A line of the preamble that states the decimal sign, as LabVIEW writes it."""

HEAD_LINES = 2000  # the header is sought in these; longer preambles are not in use
SCORED_LINES = 200


@dataclass(frozen=True)
class Layout:
    """How the lines of a text table are to be read."""

    delimiter: str  # One of `DELIMITERS`.
    decimal: str  # `"."` or `","`.
    width: int  # Number of cells in a line of data.
    names: tuple[str, ...]  # Cells of the header, at most `width`.
    # Rows of units, each with the unit text by column, None where a cell is empty.
    units: tuple[tuple[str | None, ...], ...]
    preamble: tuple[str, ...]  # Lines above the header, and comments below it.
    first_line: int  # Index of the first line of data, counted from 0.
    # Every number with the decimal sign may be a whole one with a separator of thousands.
    is_unsettled: bool = False
    header: str = ""  # The line of names as it stands in the file.
    # How the lines above the data begin, and those that tell units as they stand.
    above: frozenset[str] = frozenset()
    num_optional: int = 0  # Columns at the end that a line may leave out, such as one of comments.
    num_settings: int = 0  # Lines of as many numbers above the names, under other names.
    # What the logger calls its inputs, by column.
    called: Mapping[int, str] = field(default_factory=dict)

    @property
    def description(self) -> str:
        """The layout in words, as in "';', decimal comma"."""
        return SPOKEN[self.delimiter] + (", decimal comma" if self.decimal == "," else "")


def find_layout(
    text: str, where: str, stated_decimal: str | None = None, delimiters: Sequence[str] = DELIMITERS
) -> Layout:
    r"""Return the layout of a text with `\n` line ends.

    The motor file may state the decimal sign; of `DELIMITERS` those are given that may be it.

    Raises:
        InputError: If there is no table of numbers, only one column, no header or no data.
    """
    lines = text.split("\n", HEAD_LINES)[:HEAD_LINES]
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        remedy = "Copy the file again from the bench; it may have been cut."
        raise InputError("Expected a table, got an empty file.", where=where, remedy=remedy)
    said = DECIMAL_SEPARATOR.search("\n".join(lines))
    stated_decimal = stated_decimal or (said["sign"] if said else None)
    signs = (".", ",") if stated_decimal is None else (stated_decimal,)
    delimiter, decimal, width = _best_split(lines, signs, delimiters, where)
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
    data = [i for i, row in enumerate(rows) if _is_data(row, numeric, decimal)]
    if not data:
        raise _no_table(where)
    start, num_settings = _first_of_table(lines, rows, data, numeric, decimal)
    keyed = _keyed(rows, data, width)
    start = start if keyed is None else keyed.start
    header = header_above(lines, rows, start, numeric, decimal) if keyed is None else keyed.names
    if header is None and any(not is_value(cell, decimal) for cell in rows[start]):
        header = start  # numbers as names: "Time;1;2;3"
    if header is None:
        raise InputError(
            f"Expected a row of column names above the numbers, found none above line {start + 1}.",
            where=where,
            remedy=f"Add a row of names and units above: time_s{delimiter}winding_degC and so on.",
        )
    if keyed is None:
        found, header = header, names_above(lines, rows, header, start, width)
        units = units_above(lines, rows, header, decimal)
        above, first = list(lines[:header]), header + 1
    else:
        found, first, units = header, start, [[None, *(unit_of_cell(c) for c in keyed.units)]]
        above = [lines[i] for i in range(start) if i != header]
    while keyed is None and first < len(rows):
        row = units_of_row(rows[first], rows[header]) if is_text(rows[first], decimal) else None
        units += [row] if row else []
        is_said = is_comment(lines[first]) or (header < found and first < start)
        if row is None and is_said and is_text(rows[first], decimal):
            above.append(lines[first])
        elif row is None and not is_rule(rows[first]):
            break
        first += 1
    num_optional = int(
        len(trimmed(rows[header])) == width + 1 and rows[header][width].casefold() in COMMENTS
    )
    width += num_optional
    names = _names(lines[header], rows[header], delimiter, width, where)
    if keyed is not None:
        names = (X_NAME, *names[1:])
    names = _told_apart(names, rows[max(0, header - 1 - MOST_ROWS_BELOW) : header])
    begins = set()
    for i, line in enumerate(lines[:first]):
        if i == header:
            continue
        tells_units = units_of_row(rows[i], rows[header]) or any(units_of_remarks((line,), names))
        begins.add(line.rstrip() if tells_units else first_word(line, delimiter))
    return Layout(
        delimiter,
        decimal,
        width,
        names,
        tuple(in_columns(row, width) for row in units),
        tuple(said for line in above if (said := line.strip(' \t",;|'))),
        first,
        stated_decimal is None and is_unsettled(text, first, delimiter, decimal),
        lines[header].rstrip(),
        frozenset(begins - {""}),
        num_optional,
        num_settings,
        names_of_inputs(rows[:header], names),
    )


def first_word(line: str, delimiter: str) -> str:
    """Return what a line begins with up to a delimiter, empty for a number or nothing."""
    word = line.partition("\t" if delimiter == " " else delimiter)[0].strip(' "')
    word = word.split(maxsplit=1)[0] if delimiter == " " and word else word
    return word if re.search(r"[^\W\d_]|[*#]", word) and not is_value(word, ".") else ""


def _best_split(
    lines: Sequence[str], signs: Sequence[str], delimiters: Sequence[str], where: str
) -> tuple[str, str, int]:
    """Return delimiter, decimal sign and width under which most cells are numbers."""
    step = max(1, len(lines) // SCORED_LINES)
    sample = lines[::step] if step > 1 else lines
    best, best_score = None, 0.0
    single = False
    for delimiter in delimiters:
        rows = [split_line(line, delimiter) for line in sample]
        for decimal in signs:
            score_of: defaultdict[int, float] = defaultdict(float)
            for row in rows:
                cells = filled(row)
                values = num_values(cells, decimal) + GROUPED_WEIGHT * sum(
                    GROUPED_CELL[decimal].fullmatch(cell) is not None for cell in cells
                )
                if 2 * values >= len(cells) and values:
                    # Weighed by purity, so that "1,5;2,5" is not three cells of which two are
                    # numbers but two cells that both are.
                    score_of[len(row)] += values * values / len(cells)
            if not score_of:
                continue
            width, score = max(score_of.items(), key=lambda item: item[1])
            score *= BLANK_WEIGHT if delimiter == " " else 1.0
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
        if len(row) == width and 2 * num_values(filled(row), decimal) >= len(filled(row)) > 0
    ]
    numeric = []
    for column in range(width):
        cells = filled([row[column] for row in likely])
        numeric.append(2 * num_values(cells, decimal) > len(cells))
    return numeric


def _first_of_table(
    lines: Sequence[str],
    rows: Sequence[list[str]],
    data: Sequence[int],
    numeric: Sequence[bool],
    decimal: str,
) -> tuple[int, int]:
    """Return the first row of the table, and how many such rows stand above it.

    The table holds the longest block of equal lines.

    Lines of a preamble may hold numbers, too. Above the names of the block, a row is one of the
    table only if in each column stands what stands there in the block (number, text or nothing),
    and it has names of its own above it: the same ones, or it begins a block that is no list of
    settings either.
    """
    runs = np.split(data, np.flatnonzero(np.diff(data) > 1) + 1)
    block = max(runs, key=len)
    names = [
        i for i in range(block[0])
        if len(filled(rows[i])) >= 2 and not is_rule(rows[i]) and is_text(rows[i], decimal)
        and not is_comment(lines[i])
    ]  # fmt: skip
    if not names or data[0] > names[-1]:
        return data[0], 0
    held = [{"", *(_kind(rows[i][k], decimal) for i in block)} for k in range(len(numeric))]

    def over(i: int) -> str:
        return lines[max((name for name in names if name < i), default=i)].strip()

    def is_alike(row: Sequence[str]) -> bool:
        return all(_kind(cell, decimal) in kinds for cell, kinds in zip(row, held, strict=True))

    num_settings = 0
    for run in runs:
        is_long = len(run) > SETTINGS_SHARE * len(block)
        for i in map(int, run):
            if i > names[-1] and ("text" in held[0] or _kind(rows[i][0], decimal) != "text"):
                return i, num_settings
            if i > names[0] and is_alike(rows[i]):
                if is_long or over(i) == over(block[0]):
                    return i, num_settings
                num_settings += 1
    return int(block[0]), num_settings


def _kind(cell: str, decimal: str) -> str:
    if not filled([cell]):
        return ""
    return "number" if num_values([cell], decimal) else "text"


def _is_data(row: Sequence[str], numeric: Sequence[bool], decimal: str) -> bool:
    """Return whether more than half of a row's cells in numeric columns are numbers."""
    if len(row) != len(numeric):
        return False
    cells = filled([cell for cell, is_numeric in zip(row, numeric, strict=True) if is_numeric])
    return 2 * num_values(cells, decimal) > len(cells)


def _names(line: str, row: list[str], delimiter: str, width: int, where: str) -> tuple[str, ...]:
    """Return the names of a header line, checked against the width of the data."""
    names = trimmed(row)
    if len(names) != width and line.lstrip()[:1] in ("#", "%"):
        names = trimmed(split_line(line.lstrip().lstrip("#%"), delimiter))
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
