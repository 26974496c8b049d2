"""From the cells of one text column to float64, and a finding for each cell that is no number."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ....io.printable import printable
from ...clocks.clock import CLOCK, DAYS, ClockColumn, read_clock, read_days, read_stated
from ...clocks.date_words import numbered_dates, plain_clocks
from ...clocks.dates import DATE_TIME, read_dates
from ...clocks.time_format import TimeFormat
from ...record import Finding
from ..table import Question
from .cells import MISSING, STATES, bare
from .decimals import GROUPED, NUMBER, SPACED, SPACES, SURELY_GROUPED, THOUSANDS_OR_DECIMALS

STAMPS = 19900101000000, 21000101000000
"""Numbers that may be a date with a time in 14 digits, from the first up to the second."""

STAMP = r"(\d{4})(\d{2})(\d{2})([01]\d|2[0-3])([0-5]\d)([0-5]\d)"


@dataclass(frozen=True)
class Values:
    """The values of one column.

    Attributes:
        numbers: Float64, shape (time,).
        is_time: The cells were clock times or dates; the numbers are seconds.
        note: How they were read if not as plain numbers, or empty.
        unreadable: Which cells hold something that could not be read, shape (time,).
        first_text: What stands in the first of these, or empty.
        question: What the cells leave open, or None.
        doubt: What speaks against the reading, as a sentence, or empty.
        start: Day of the first time, ISO 8601; empty where it is not known.
    """

    numbers: np.ndarray
    is_time: bool = False
    note: str = ""
    unreadable: np.ndarray | None = None
    first_text: str = ""
    question: Question | None = None
    doubt: str = ""
    start: str = ""


def read_values(
    cells: pd.Series,
    decimal: str,
    *,
    name: str = "time",
    stated: TimeFormat | None = None,
    has_thousands: bool = False,
) -> Values | str:
    """Return the values of a column, or its first text if it holds no value at all.

    Args:
        cells: One column as the table parser left it: numbers, truth values or texts.
        decimal: Decimal sign of the file.
        name: Name of the column, for the answers to a question.
        stated: The format of times that the header or `[columns]` states; cells that are not of
            it are not read in another.
        has_thousands: The decimal sign is stated, so that the other sign can only separate
            thousands.
    """
    if pd.api.types.is_bool_dtype(cells.dtype):
        return Values(cells.to_numpy(dtype=float), note="true and false read as 1 and 0")
    if pd.api.types.is_numeric_dtype(cells.dtype):
        numbers = cells.to_numpy(dtype=float, na_value=np.nan)
        return _read_stamps(numbers, name) or _finite(numbers)
    texts = cells.astype(object).where(cells.notna(), "").astype(str).str.strip().map(bare)
    lower = texts.str.lower()
    missing = lower.isin(list(MISSING)).to_numpy()
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
    """Return the question of a column of texts whose sign may separate thousands, or None.

    Args:
        cells: One column, all texts.
        decimal: The sign that may be decimal.
    """
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


def unreadable_cells(values: Values, column: str, lines: np.ndarray, where: str) -> Finding | None:
    """Return the finding about the cells of a column that became NaN, or None.

    Args:
        values: What was read.
        column: Its name in the file.
        lines: Line number in the file of each sample, from 1, shape (time,).
        where: The file.
    """
    if values.unreadable is None or not values.unreadable.any():
        return None
    count = int(values.unreadable.sum())
    line = int(lines[values.unreadable][0])
    return Finding(
        id="unreadable_cells",
        severity="warning",
        message=f"{count} of {values.numbers.size} cells hold no number; the first is "
        f"'{printable(values.first_text[:40])}' in line {line}. They count as missing.",
        where=f"{where}, column {column}",
        remedy="Export numbers alone, without separators of thousands.",
        values={"count": count, "first_line": line},
    )


def doubtful(values: Values, column: str, where: str) -> Finding | None:
    """Return the finding about times that were read in one of two ways, or None.

    Args:
        values: What was read.
        column: Its name in the file.
        where: The file.
    """
    if not values.doubt:
        return None
    return Finding(
        id="time_assumed",
        severity="warning",
        message=values.doubt,
        where=f"{where}, column {column}",
        remedy=f'State the format: [columns] time_s = "{column} [mm:ss]" or "{column} [hh:mm]".',
    )


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


def _read_clock(texts: pd.Series, name: str) -> Values | None:
    if texts.str.fullmatch(DAYS).any():
        return _times(read_days(texts))
    if not texts.str.fullmatch(CLOCK).any():
        return None
    return _times(read_clock(texts, name))


def _read_dates(texts: pd.Series, name: str) -> Values | None:
    numbered, known_by = numbered_dates(texts)
    if not known_by and not texts.str.fullmatch(DATE_TIME).any():
        return None
    column = read_dates(numbered, name, known_by=known_by)
    return _times(column) if column.note else None


def _read_stamps(numbers: np.ndarray, name: str) -> Values | None:
    """Return dates with a time that are written in 14 digits, None if not all numbers are such."""
    if not numbers.size or not np.all((numbers >= STAMPS[0]) & (numbers < STAMPS[1])):
        return None
    digits = pd.Series([f"{number:.0f}" for number in numbers])
    if not digits.str.fullmatch(STAMP).all():
        return None
    found = _read_dates(digits.str.replace(STAMP, r"\1-\2-\3 \4:\5:\6", regex=True), name)
    return found if found is not None and np.all(np.isfinite(found.numbers)) else None


def _times(column: ClockColumn) -> Values:
    return Values(
        column.seconds,
        True,
        column.note,
        question=column.question,
        doubt=column.doubt,
        start=column.start,
    )


def _read_stated(texts: pd.Series, missing: np.ndarray, stated: TimeFormat, name: str) -> Values:
    """Return times in the format that is stated; where most are not of it, that is a question."""
    if stated.order:
        numbered, known_by = numbered_dates(plain_clocks(texts))
        order = "year-month-day" if known_by else stated.order
        column = read_dates(numbered, name, order, known_by=known_by)
    else:
        column = read_stated(texts, stated)
    unreadable = ~missing & ~np.isfinite(column.seconds)
    if 2 * unreadable.sum() <= (~missing).sum():
        return _times(column)
    return replace(
        _times(column),
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
