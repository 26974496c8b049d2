"""From the cells of one text column to float64, and a finding for each cell that is no number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from .clock import CLOCK, DATE_TIME, read_clock, read_dates
from .record import Finding
from .text_layout import MISSING, NUMBER, STATES


@dataclass(frozen=True)
class Values:
    """The values of one column.

    Attributes:
        numbers: Float64, shape (time,).
        is_time: The cells were clock times or dates; the numbers are seconds.
        note: How they were read if not as plain numbers, or empty.
        unreadable: Which cells hold something that could not be read, shape (time,).
        first_text: What stands in the first of these, or empty.
    """

    numbers: np.ndarray
    is_time: bool = False
    note: str = ""
    unreadable: np.ndarray | None = None
    first_text: str = ""


def read_values(cells: pd.Series, decimal: str) -> Values | str:
    """Return the values of a column, or its first text if it holds no value at all.

    Args:
        cells: One column as the table parser left it: numbers, truth values or texts.
        decimal: Decimal sign of the file.
    """
    if pd.api.types.is_bool_dtype(cells.dtype):
        return Values(cells.to_numpy(dtype=float), note="true and false read as 1 and 0")
    if pd.api.types.is_numeric_dtype(cells.dtype):
        return _finite(cells.to_numpy(dtype=float, na_value=np.nan))
    texts = cells.astype(object).where(cells.notna(), "").astype(str).str.strip()
    lower = texts.str.lower()
    missing = lower.isin(list(MISSING)).to_numpy()
    best: Values | None = None
    for read in (_read_numbers, _read_clock, _read_dates, _read_states):
        found = read(texts, decimal)
        if found is not None and (
            best is None or np.isfinite(found.numbers).sum() > np.isfinite(best.numbers).sum()
        ):
            best = found
    if best is None:
        return str(texts[~missing].iloc[0]) if not missing.all() else ""
    unreadable = ~missing & ~np.isfinite(best.numbers)
    first = str(texts[unreadable].iloc[0]) if unreadable.any() else ""
    return Values(best.numbers, best.is_time, best.note, unreadable, first)


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
        f"'{values.first_text[:40]}' in line {line}. They count as missing.",
        where=f"{where}, column {column}",
        remedy="Export numbers alone, without separators of thousands.",
        values={"count": count, "first_line": line},
    )


def _finite(numbers: np.ndarray) -> Values:
    infinite = np.isinf(numbers)
    if not infinite.any():
        return Values(numbers)
    return Values(np.where(infinite, np.nan, numbers), unreadable=infinite, first_text="inf")


def _read_numbers(texts: pd.Series, decimal: str) -> Values | None:
    matches = texts.str.fullmatch(NUMBER[decimal]).to_numpy(dtype=bool)
    if not matches.any():
        return None
    numbers = np.full(len(texts), np.nan)
    numbers[matches] = texts[matches].str.replace(decimal, ".").astype(float)
    return Values(np.where(np.isinf(numbers), np.nan, numbers))


def _read_clock(texts: pd.Series, decimal: str) -> Values | None:
    if not texts.str.fullmatch(CLOCK).any():
        return None
    column = read_clock(texts)
    return Values(column.seconds, is_time=True, note=column.note)


def _read_dates(texts: pd.Series, decimal: str) -> Values | None:
    if not texts.str.fullmatch(DATE_TIME).any():
        return None
    column = read_dates(texts)
    return Values(column.seconds, is_time=True, note=column.note) if column.note else None


def _read_states(texts: pd.Series, decimal: str) -> Values | None:
    numbers = texts.str.lower().map(STATES).to_numpy(dtype=float)
    if not np.isfinite(numbers).any():
        return None
    return Values(numbers, note="true/on and false/off read as 1 and 0")
