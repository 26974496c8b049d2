"""Times written as a clock or as a date, turned to seconds."""

from __future__ import annotations

import datetime
import re
from dataclasses import dataclass

import numpy as np
import pandas as pd

CLOCK = r"(?:(?P<hour>[0-9]+):)?(?P<minute>[0-9]+):(?P<second>[0-5]?[0-9](?:[.,][0-9]*)?)"
DATE = r"(?P<first>[0-9]{1,4})(?P<sign>[-/.])(?P<middle>[0-9]{1,2})[-/.](?P<last>[0-9]{1,4})"
DATE_TIME = (
    DATE + r"[T ,_]\s*(?P<hour>[0-9]{1,2}):(?P<minute>[0-5][0-9])"
    r"(?::(?P<second>[0-5]?[0-9](?:[.,][0-9]*)?))?\s*(?P<half>[AaPp][Mm])?"
    r"\s*(?P<zone>Z|[+-][0-9]{2}:?[0-9]{2})?"
)
CLOCK_CELL = re.compile(CLOCK)
DATE_TIME_CELL = re.compile(DATE_TIME)
ORDERS = {"day/month/year": (0, 1, 2), "month/day/year": (1, 0, 2), "year-month-day": (2, 1, 0)}
"""Where day, month and year stand among the three numbers of a date."""

SECONDS_PER_DAY = 86400


@dataclass(frozen=True)
class ClockColumn:
    """Times of one column in seconds.

    Attributes:
        seconds: Shape (time,); for dates from the first one; NaN where a cell is no such time.
        note: How the cells were read, as a sentence without its subject.
    """

    seconds: np.ndarray
    note: str


def is_time(cell: str) -> bool:
    """Return whether a cell is a clock time or a date with a time."""
    return bool(CLOCK_CELL.fullmatch(cell) or DATE_TIME_CELL.fullmatch(cell))


def read_clock(cells: pd.Series) -> ClockColumn:
    """Read `m:ss.s` and `h:mm:ss.s`, also mixed.

    Args:
        cells: Texts without blanks around them, shape (time,).
    """
    parts = cells.str.extract(f"^{CLOCK}$")
    hour = _numbers(parts["hour"].fillna("0"))
    minute = _numbers(parts["minute"])
    with_hour = parts["hour"].notna().to_numpy()
    seconds = 3600.0 * hour + 60.0 * minute + _numbers(parts["second"])
    seconds[with_hour & (minute >= 60)] = np.nan
    seconds = np.round(seconds, _decimals(parts["second"]))  # undo the rounding of the sum
    readable = np.isfinite(seconds)
    forms = [
        form
        for form, present in (
            ("minutes:seconds", (readable & ~with_hour).any()),
            ("hours:minutes:seconds", (readable & with_hour).any()),
        )
        if present
    ]
    return ClockColumn(seconds, f"read as {' and '.join(forms)}")


def read_dates(cells: pd.Series) -> ClockColumn:
    """Read dates with a time, in the order of day and month that the dates themselves show.

    Args:
        cells: As `read_clock`.
    """
    parts = cells.str.extract(f"^{DATE_TIME}$")
    triples = parts[["first", "middle", "last"]]
    unique = triples.dropna().drop_duplicates()
    signs = set(parts["sign"].dropna())
    order, reason = _order([tuple(row) for row in unique.to_numpy()], signs)
    days = {tuple(row): _day(tuple(row), order) for row in unique.to_numpy()}
    keys = zip(*(triples[name] for name in triples), strict=True)
    day = np.array([days.get(key, np.nan) for key in keys], dtype=float)

    hour = _numbers(parts["hour"])
    half = parts["half"].str.lower()
    twelve = half.notna().to_numpy()
    hour[twelve & ((hour < 1) | (hour > 12))] = np.nan
    hour = np.where(twelve, hour % 12 + 12 * (half == "pm").to_numpy(), hour)
    hour[hour > 24] = np.nan
    clock = 3600.0 * hour + 60.0 * _numbers(parts["minute"])
    clock += _numbers(parts["second"].fillna("0")) - _zone_seconds(parts["zone"])

    readable = np.flatnonzero(np.isfinite(day + clock))
    if readable.size == 0:
        return ClockColumn(np.full(len(cells), np.nan), "")
    first = readable[0]
    seconds = (day - day[first]) * SECONDS_PER_DAY + (clock - clock[first])
    seconds = np.round(seconds, _decimals(parts["second"]))
    return ClockColumn(
        seconds, f"read as {order} ({reason}), seconds from {cells.iloc[int(first)]}"
    )


def _numbers(texts: pd.Series) -> np.ndarray:
    return texts.str.replace(",", ".").astype(float).to_numpy(copy=True)


def _decimals(seconds: pd.Series) -> int:
    """Return the most decimals that any cell writes."""
    fraction = seconds.dropna().str.extract(r"[.,]([0-9]*)$")[0].dropna()
    return int(fraction.str.len().max()) if len(fraction) else 0


def _zone_seconds(zones: pd.Series) -> np.ndarray:
    """Return the offset from UTC [s]; 0 where none is written."""
    offsets = {
        zone: 0.0
        if zone == "Z"
        else float(f"{zone[0]}1") * (3600.0 * int(zone[1:3]) + 60.0 * int(zone[-2:]))
        for zone in zones.dropna().unique()
    }
    return zones.map(offsets).astype(float).fillna(0.0).to_numpy()


def _day(date: tuple[str, ...], order: str) -> float:
    """Return the day number of a date, NaN if there is no such day."""
    day, month, year = (int(date[place]) for place in ORDERS[order])
    try:
        return datetime.date(year + 2000 if year < 100 else year, month, day).toordinal()
    except ValueError:
        return np.nan


def _order(dates: list[tuple[str, ...]], signs: set[str]) -> tuple[str, str]:
    """Return the order of day, month and year that the dates allow, and why that one."""
    if all(len(date[0]) == 4 for date in dates):
        return "year-month-day", "the year comes first"
    if signs == {"."}:
        return "day/month/year", "dots between the numbers"
    for order, place in (("day/month/year", 0), ("month/day/year", 1)):
        decisive = [date for date in dates if int(date[place]) > 12]
        if decisive:
            return order, f"decided by {'/'.join(decisive[0])}"
    if len(dates) <= 1:
        return "day/month/year", "the order of day and month makes no difference on one day"
    spans = {order: np.ptp([_day(date, order) for date in dates]) for order in list(ORDERS)[:2]}
    best = min(spans, key=lambda order: spans[order])
    return best, f"the order that makes the test the shorter one, {spans[best] + 1:.0f} days"
