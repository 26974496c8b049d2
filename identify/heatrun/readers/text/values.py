"""Cells of a text table: what is a number, a time, a text or nothing, and a column as float64.

Which decimal sign numbers have is judged with them, and whether the file settles it.
"""

import csv
import datetime
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pandas as pd

from ...io.quantities import printable
from ...record.header import plain
from ...record.record import Finding
from ...record.table import Question
from ..clock import (
    CLOCK,
    CLOCK_CELL,
    DAYS,
    DAYS_CELL,
    TimeFormat,
    Values,
    read_clock,
    read_days,
    read_stated,
)
from ..dates import (
    DATE_TIME,
    DATE_TIME_CELL,
    SHORT_FRACTION,
    is_worded_date,
    numbered_dates,
    plain_clock,
    plain_clocks,
    read_dates,
)

NUMBER = {
    "." : r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?",
    "," : r"[+-]?(?:[0-9]+(?:,[0-9]+)?|,[0-9]+)(?:[eE][+-]?[0-9]+)?",
}  # fmt: skip
"""What a number looks like, by decimal sign."""

SIGN_APART = r"^([+-])\s+(?=[0-9.,])"
"""A sign and the blanks behind it, as loggers write that fill a number up to a fixed width."""

PLUS_APART = re.compile(r"(?<![^\s\"])\+ +(?=[0-9.])")
BETWEEN_BLANKS = re.compile(r"(?<![^\s\"])([+-]) +(?=[0-9.])")


def signs_joined(text: str) -> str:
    """Return a table of blanks with the signs next to their digits.

    A minus alone may also be the mark of no value; where a plus stands apart, it is a sign, too.
    """
    is_apart = "+ " in text and PLUS_APART.search(text) is not None
    return BETWEEN_BLANKS.sub(r"\1", text) if is_apart else text


def _by_sign(pattern: str) -> dict[str, str]:
    """Return a pattern by decimal sign {0}, with {1} for the other one."""
    return {".": pattern.format(r"\.", ","), ",": pattern.format(",", r"\.")}


GROUPED = _by_sign("[+-]?[0-9]{{1,3}}(?:{1}[0-9]{{3}})+(?:{0}[0-9]+)?")
"""Numbers with separators of thousands, by decimal sign: read as values only where the motor file
states the decimal sign, but they show the layout."""

SURELY_GROUPED = _by_sign(
    "[+-]?[0-9]{{1,3}}(?:(?:{1}[0-9]{{3}})+{0}[0-9]+|(?:{1}[0-9]{{3}}){{2,}})"
)
"""Those of them in which the sign can do nothing else: beside the decimal sign, or twice."""

SPACES = "[ \u00a0\u2009\u202f'’_]"
SPACED = _by_sign(f"[+-]?[0-9]{{{{1,3}}}}(?:{SPACES}[0-9]{{{{3}}}})+(?:{{0}}[0-9]+)?")
"""Numbers with separators of thousands that can be nothing else."""

THOUSANDS_OR_DECIMALS = _by_sign("[+-]?[1-9][0-9]{{0,2}}{0}[0-9]{{3}}")
"""Numbers that are whole where the sign separates thousands, and are not where it is decimal."""

SURELY_DECIMAL = (
    r"[+-]?(?:0+{0}[0-9]*|[0-9]+{0}(?:[0-9]{{0,2}}|[0-9]{{4,}})|[0-9]{{4,}}{0}[0-9]+|{0}[0-9]+)"
    r"|[+-]?[0-9]*{0}[0-9]+[eE][+-]?[0-9]+"
)
"""Numbers in which the sign {0} separates no thousands."""


def start_of_line(text: str, index: int) -> int:
    r"""Return where a line begins in a text with `\n` line ends, counted from 0."""
    offset = 0
    for _ in range(index):
        offset = text.find("\n", offset) + 1
    return offset


def is_unsettled(text: str, first_line: int, delimiter: str, decimal: str) -> bool:
    """Return whether the decimal sign shows itself only where it may separate thousands."""
    edge = rf'\s"{re.escape(delimiter)}'
    cell = rf"(?:^|(?<=[{edge}]))(?:{{}})(?=[{edge}]|$)"
    if delimiter == decimal:  # within quotes alone
        cell = '(?<=")(?:{})(?=")'
    start = start_of_line(text, first_line)
    surely = re.compile(cell.format(SURELY_DECIMAL.format(re.escape(decimal))), re.MULTILINE)
    maybe = re.compile(cell.format(THOUSANDS_OR_DECIMALS[decimal]), re.MULTILINE)
    return surely.search(text, start) is None and maybe.search(text, start) is not None


MISSING = frozenset(
    ("", "nan", "na", "n/a", "#n/a", "#na", "null", "none", "nil", "-", "--", "---", "?")
)
"""Cells, in lower case, that say: no value here."""

STATES = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0}
"""Switches, in lower case, as fans and relays are logged; they say nothing about the layout."""

NUMBER_CELL = {sign: re.compile(pattern) for sign, pattern in NUMBER.items()}
MOST_CELLS = 1 << 14
"""Cells [1] that are remembered: a layout is found by looking at the same ones from all sides."""

QUOTED_OR_SOLID = re.compile(r'"[^"]*"|\S+')


def split_line(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line without quotes and outer blanks."""
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


@lru_cache(maxsize=MOST_CELLS)
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


@lru_cache(maxsize=MOST_CELLS)
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
    return row[: max((end for end, cell in enumerate(row, 1) if cell), default=0)]


STAMPS = 19900101000000, 21000101000000
"""Numbers that may be a date with a time in 14 digits, from the first up to the second."""

STAMP = r"(\d{4})(\d{2})(\d{2})([01]\d|2[0-3])([0-5]\d)([0-5]\d)"


UNIX = datetime.datetime(1970, 1, 1)
TICKS = {
    "100 ns since the year 1, as .NET counts": (datetime.datetime(1, 1, 1), 6.2e17, 6.5e17, 10**7),
    "100 ns since the year 1601, as Windows counts": (
        datetime.datetime(1601, 1, 1), 1.2e17, 1.4e17, 10**7
    ),
    "ms since the year 1970": (UNIX, 1e12, 2.5e12, 10**3),
    "µs since the year 1970": (UNIX, 1e15, 2.5e15, 10**6),
    "ns since the year 1970": (UNIX, 1e18, 2.5e18, 10**9),
}  # fmt: skip
"""Counts that are times between about 1965 and 2060, those since 1970 between 2001 and 2049: no
other number of a bench is as large. Of each the first count, the last, and how many are a second.
"""


def read_values(
    cells: pd.Series,
    decimal: str,
    *,
    name: str = "time",
    stated: TimeFormat | None = None,
    has_thousands: bool = False,
) -> Values | str:
    """Return the values of a column, or its first text if it holds no value at all.

    The table parser leaves cells as numbers, truth values or texts. Where header or `[columns]`
    state a format of times, cells that are not of it are not read in another. The other sign can
    only separate thousands where the decimal sign is stated.
    """
    if pd.api.types.is_bool_dtype(cells.dtype):
        return Values(cells.to_numpy(dtype=float), note="true and false read as 1 and 0")
    if pd.api.types.is_numeric_dtype(cells.dtype):
        numbers = cells.to_numpy(dtype=float, na_value=np.nan)
        return counted_times(cells, numbers) or _read_stamps(numbers, name) or _finite(numbers)
    texts = cells.astype(object).where(cells.notna(), "").astype(str).str.strip().map(bare)
    lower = texts.str.lower()
    missing = lower.isin(list(MISSING)).to_numpy()
    if stated is not None and stated.order != "year-month-day":
        stated = None if texts[~missing].str.fullmatch(ISO_8601).all() else stated
    if stated is not None and not missing.all():
        best = _read_stated(texts, missing, stated, name)
    else:
        clocks = plain_clocks(texts)
        candidates = (
            _read_numbers(texts, decimal, has_thousands),
            _read_clock(clocks, name),
            _read_dates(clocks, name),
            _read_states(texts),
        )
        found = [one for one in candidates if one is not None]
        if not found and _thousands(texts, decimal):
            found = [Values(np.full(len(texts), np.nan))]
        if not found:
            return str(texts[~missing].iloc[0]) if not missing.all() else ""
        best = max(found, key=lambda one: np.isfinite(one.numbers).sum())
    unreadable = ~missing & ~np.isfinite(best.numbers)
    first = str(texts[unreadable].iloc[0]) if unreadable.any() else ""
    question = best.question or _thousands(texts[unreadable], decimal)
    return replace(best, unreadable=unreadable, first_text=first, question=question)


def unsettled_cells(cells: pd.Series, decimal: str) -> Question | None:
    """Return the question of a column of texts whose sign may separate thousands, or None."""
    texts = cells.dropna().astype(str).str.strip()
    open_cells = texts[texts.str.fullmatch(THOUSANDS_OR_DECIMALS[decimal])]
    if open_cells.empty:
        return None
    shown = open_cells.iloc[0]
    as_decimal, as_thousands = shown.replace(decimal, "."), shown.replace(decimal, "")
    other = "," if decimal == "." else "."
    return Question(
        f"'{shown}' may be {float(as_decimal):g} or {as_thousands}: no number in the file shows "
        "whether the sign is decimal or separates thousands.",
        remedy=f"Say which in the motor file: [motor] decimal = '{decimal}' for "
        f"{float(as_decimal):g}, decimal = '{other}' for {as_thousands}.",
    )


def findings_of(values: Values, column: str, lines: np.ndarray, where: str) -> Iterator[Finding]:
    """Yield what is to be said of cells that became NaN, and of times that were read in one of two
    ways; lines are numbers in the file, from 1, shape (time,).
    """
    where = f"{where}, column {column}"
    if values.unreadable is not None and values.unreadable.any():
        count = int(values.unreadable.sum())
        line = int(lines[values.unreadable][0])
        yield Finding(
            "unreadable_cells",
            "warning",
            f"{count} of {values.numbers.size} cells hold no number; the first is "
            f"'{printable(values.first_text[:40])}' in line {line}. They count as missing.",
            where,
            "Export numbers alone, without separators of thousands.",
            values={"count": count, "first_line": line},
        )
    if values.doubt:
        stated = f'[columns] time_s = "{column} [mm:ss]" or "{column} [hh:mm]".'
        yield Finding("time_assumed", "warning", values.doubt, where, f"State the format: {stated}")


def _thousands(texts: pd.Series, decimal: str) -> Question | None:
    """Return the question of texts that are numbers if a sign separates thousands, or None."""
    grouped = texts[texts.str.fullmatch(GROUPED[decimal])]
    if grouped.empty:
        return None
    sign = "," if decimal == "." else "."
    return Question(
        f"'{grouped.iloc[0]}' is a number only if '{sign}' separates thousands, since "
        f"'{decimal}' is taken as the decimal sign; that is not guessed.",
        remedy=f"If it does, say in the motor file: [motor] decimal = '{decimal}'. If not, export "
        "with one decimal sign.",
    )


def _finite(numbers: np.ndarray) -> Values:
    infinite = np.isinf(numbers)
    if not infinite.any():
        return Values(numbers)
    return Values(np.where(infinite, np.nan, numbers), unreadable=infinite, first_text="inf")


def _read_numbers(texts: pd.Series, decimal: str, has_thousands: bool) -> Values | None:
    spaced = texts.str.fullmatch(SPACED[decimal])
    texts = texts.where(~spaced, texts.str.replace(SPACES, "", regex=True))
    if has_thousands or texts.str.fullmatch(SURELY_GROUPED[decimal]).any():
        grouped = texts.str.fullmatch(GROUPED[decimal])
        plain = texts.str.replace("," if decimal == "." else ".", "", regex=False)
        texts = texts.where(~grouped, plain)
    matches = texts.str.fullmatch(NUMBER[decimal]).to_numpy(dtype=bool)
    if not matches.any():
        return None
    numbers = np.full(len(texts), np.nan)
    numbers[matches] = texts[matches].str.replace(decimal, ".").astype(float)
    return Values(np.where(np.isinf(numbers), np.nan, numbers))


LONG_DAYS = r"^([0-9]{3}):([0-9]{2}:[0-5][0-9]:[0-5][0-9](?:\.[0-9]*)?)$"
"""Days in three digits before a clock."""

ISO_8601 = r"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}.*"
"""Dates with a time that say themselves how they are written, as those of a workbook do."""


def _read_clock(texts: pd.Series, name: str) -> Values | None:
    long = texts.str.extract(LONG_DAYS)
    if long[0].notna().any() and not texts.str.endswith(":00").all():  # else maybe hundredths
        return read_days(long[0] + " days " + long[1])
    if texts.str.fullmatch(DAYS).any():
        return read_days(texts)
    if not texts.str.fullmatch(CLOCK).any():
        return None
    return read_clock(texts, name)


def _read_dates(texts: pd.Series, name: str) -> Values | None:
    numbered, known_by = numbered_dates(texts)
    if not known_by and not texts.str.fullmatch(DATE_TIME).any():
        return None
    column = read_dates(numbered, name, known_by=known_by)
    return column if column.note else None


def counted_times(cells: pd.Series, numbers: np.ndarray) -> Values | None:
    """Return times in counts since a year, None if not all numbers are such; no unit says them.

    Cells are as the file holds them, whole if it can; numbers the same as float64, shape (time,).
    """
    known = np.isfinite(numbers)
    for said, (epoch, low, high, per_second) in TICKS.items():
        if not known.any() or not np.all((numbers[known] >= low) & (numbers[known] < high)):
            continue
        first = int(cells[known].iloc[0])
        # the difference first: 64 bits of a float hold such a number to 13 µs
        seconds = (cells - first).to_numpy(dtype=float, na_value=np.nan) / per_second
        start = epoch + datetime.timedelta(microseconds=first * 10**6 // per_second)
        return Values(
            np.round(seconds, 9 if per_second == 10**9 else 7),
            f"read as {said}, seconds from {start:%Y-%m-%d %H:%M:%S}",
            start=start.isoformat(timespec="microseconds"),
            is_time=True,
            unreadable=np.isinf(numbers),
        )
    return None


def _read_stamps(numbers: np.ndarray, name: str) -> Values | None:
    """Return dates with a time that are written in 14 digits, None if not all numbers are such."""
    if not numbers.size or not np.all((numbers >= STAMPS[0]) & (numbers < STAMPS[1])):
        return None
    digits = pd.Series([f"{number:.0f}" for number in numbers])
    if not digits.str.fullmatch(STAMP).all():
        return None
    found = _read_dates(digits.str.replace(STAMP, r"\1-\2-\3 \4:\5:\6", regex=True), name)
    return found if found is not None and np.all(np.isfinite(found.numbers)) else None


def _read_stated(texts: pd.Series, missing: np.ndarray, stated: TimeFormat, name: str) -> Values:
    """Return times in the format that is stated; where most are not of it, that is a question."""
    if stated.order:
        numbered, known_by = numbered_dates(plain_clocks(texts))
        order = "year-month-day" if known_by else stated.order
        column = read_dates(numbered, name, order, known_by=known_by)
    else:
        column = read_stated(texts, stated)
    unreadable = ~missing & ~np.isfinite(column.numbers)
    if 2 * unreadable.sum() <= (~missing).sum():
        return column
    return replace(
        column,
        note="not read",
        question=Question(
            f"The format is stated as {stated.text}; {int(unreadable.sum())} of "
            f"{int((~missing).sum())} cells are not written so, the first is "
            f"'{printable(str(texts[unreadable].iloc[0])[:40])}'.",
            remedy=f"State the format of the cells in the motor file, as in "
            f'[columns] time_s = "{name} [hh:mm:ss]", or export the time in seconds.',
        ),
    )


def _read_states(texts: pd.Series) -> Values | None:
    numbers = texts.str.lower().map(STATES).to_numpy(dtype=float)
    if not np.isfinite(numbers).any():
        return None
    return Values(numbers, note="true/on and false/off read as 1 and 0")
