"""Dates with a time, turned to seconds from the first one."""

from __future__ import annotations

import datetime
import re
from collections.abc import Mapping

import numpy as np
import pandas as pd

from ..record.table import Question
from .clock import DAY_S, HOUR_S, Times, Values, decimals, numbers, rises, spoken_duration

DATE = r"(?P<first>[0-9]{1,4})(?P<sign>[-/.])(?P<middle>[0-9]{1,2})[-/.](?P<last>[0-9]{1,4})"
DATE_TIME = (
    DATE + r"(?:\s*[T,_/-]\s*|\s+)(?P<hour>[0-9]{1,2}):(?P<minute>[0-5]?[0-9])"
    r"(?::(?P<second>[0-5]?[0-9](?:[.,][0-9]*)?))?\s*(?P<half>[AaPp][Mm])?"
    r"\s*(?P<zone>Z|[+-][0-9]{2}:?[0-9]{2})?"
)
DATE_TIME_CELL = re.compile(DATE_TIME)

PLACES = {"day/month/year": (0, 1, 2), "month/day/year": (1, 0, 2), "year-month-day": (2, 1, 0)}
"""Where day, month and year stand among the three numbers of a date."""

FORMATS = {
    "day/month/year": "dd/mm/yyyy hh:mm:ss",
    "month/day/year": "mm/dd/yyyy hh:mm:ss",
    "year-month-day": "yyyy-mm-dd hh:mm:ss",
}
"""How `[columns]` states an order."""

LONGEST_PAUSE_DAYS = 300
"""No test stands still for so long: an order that says so is none."""

NO_DIFFERENCE = "the order of day and month makes no difference"

Date = tuple[str, str, str]


def read_dates(
    cells: pd.Series, name: str = "time", order: str = "", *, known_by: str = ""
) -> Values:
    """Read dates with a time, in the one order of day, month and year that they allow.

    Args:
        cells: Texts without blanks around them, shape (time,).
        name: Name of the column, for the answers to a question.
        order: Key of `PLACES` that the header states, or empty.
        known_by: Why the order is known beforehand, or empty.
    """
    parts = cells.str.extract(f"^{DATE_TIME}$")
    triples = parts[["first", "middle", "last"]]
    dates: list[Date] = [tuple(row) for row in triples.dropna().drop_duplicates().to_numpy()]
    clock = _clock(parts)
    keys = list(zip(*(triples[name] for name in triples), strict=True))

    def seconds_by(order: str) -> np.ndarray:
        days = {date: _day(date, order) for date in dates}
        day = np.array([days.get(key, np.nan) for key in keys], dtype=float)
        known = np.flatnonzero(np.isfinite(day + clock))
        if known.size == 0:
            return np.full(len(cells), np.nan)
        first = known[0]
        seconds = (day - day[first]) * DAY_S + (clock - clock[first])
        return np.round(seconds, decimals(parts["second"]))

    orders = (order,) if order else _orders(dates, set(parts["sign"].dropna()))
    read = {order: seconds_by(order) for order in orders}
    if not any(np.isfinite(seconds).any() for seconds in read.values()):
        return Times(np.full(len(cells), np.nan), "")
    reason = known_by or ("as stated" if order else "")
    left, why = _possible(read, dates)
    best = left[0]
    seconds = read[best]
    row = int(np.flatnonzero(np.isfinite(seconds))[0])
    start = cells.iloc[row]
    question = None
    if len(left) > 1:
        spans = " or ".join(
            f"{one} ({spoken_duration(float(np.nanmax(read[one]) - np.nanmin(read[one])))} in all)"
            for one in left
        )
        end = cells.iloc[int(np.flatnonzero(np.isfinite(seconds))[-1])]
        question = Question(
            f"The dates, '{start}' to '{end}', may be {spans}; the file does not say which.",
            tuple(f"{name} [{FORMATS[one]}]" for one in left),
        )
    note = f"read as {best} ({reason or why}), seconds from {start}"
    day = _first_day(keys[row], best, read, why)
    minutes, rest = divmod(clock[row] + _zone_seconds(parts["zone"])[row], 60.0)
    hours, minutes = divmod(int(minutes), 60)
    return Times(seconds, note, question, start=f"{day}T{hours:02d}:{minutes:02d}:{rest:09.6f}")


def _first_day(date: Date, best: str, read: Mapping[str, np.ndarray], why: str) -> str:
    """Return the day of the first time; empty where other orders give the same times."""
    orders = list(read) if why == NO_DIFFERENCE else [best]
    days = {_day(date, order) for order in orders}
    day = days.pop()
    return "" if days or not np.isfinite(day) else datetime.date.fromordinal(int(day)).isoformat()


def _clock(parts: pd.DataFrame) -> np.ndarray:
    """Return the time of the day in UTC [s]; NaN where there is no such time."""
    hour = numbers(parts["hour"])
    half = parts["half"].str.lower()
    twelve = half.notna().to_numpy()
    hour[twelve & ((hour < 1) | (hour > 12))] = np.nan
    hour = np.where(twelve, hour % 12 + 12 * (half == "pm").to_numpy(), hour)
    clock = HOUR_S * hour + 60.0 * numbers(parts["minute"]) + numbers(parts["second"].fillna("0"))
    clock[clock > DAY_S] = np.nan
    return clock - _zone_seconds(parts["zone"])


def _zone_seconds(zones: pd.Series) -> np.ndarray:
    """Return the offset from UTC [s]; 0 where none is written."""
    offsets = {
        zone: 0.0
        if zone == "Z"
        else float(f"{zone[0]}1") * (3600.0 * int(zone[1:3]) + 60.0 * int(zone[-2:]))
        for zone in zones.dropna().unique()
    }
    return zones.map(offsets).astype(float).fillna(0.0).to_numpy()


def _day(date: Date, order: str) -> float:
    """Return the day number of a date, NaN if there is no such day."""
    day, month, year = (int(date[place]) for place in PLACES[order])
    try:
        return datetime.date(year + 2000 if year < 100 else year, month, day).toordinal()
    except ValueError:
        return np.nan


def _orders(dates: list[Date], signs: set[str]) -> tuple[str, ...]:
    """Return the orders in which such dates are written."""
    if all(len(date[0]) == 4 for date in dates):
        return ("year-month-day",)
    if signs == {"."}:  # in no country is the month or a short year before two dots
        return ("day/month/year",)
    if any(len(date[2]) == 4 for date in dates):
        return ("day/month/year", "month/day/year")
    return ("day/month/year", "month/day/year", "year-month-day")


def _possible(read: Mapping[str, np.ndarray], dates: list[Date]) -> tuple[list[str], str]:
    """Return the orders that give different times and are all possible, and why no other is."""
    orders = list(read)
    if len(orders) == 1:
        four = all(len(date[0]) == 4 for date in dates)
        return orders, "the year comes first" if four else "dots between the numbers"
    known = {order: int(np.isfinite(read[order]).sum()) for order in orders}
    left = [order for order in orders if known[order] == max(known.values())]
    if len(left) == 1:
        return left, f"decided by {_decisive(dates, left[0])}"
    left = _distinct(read, left)
    if len(left) == 1:
        return left, NO_DIFFERENCE
    for is_possible, why in (
        (rises, "another order would run backwards"),
        (_has_no_long_pause, "another order would leave a pause of a year"),
    ):
        kept = [order for order in left if is_possible(read[order])]
        left = kept or left
        if len(left) == 1:
            return left, why
    return left, "the order is not known"


def _decisive(dates: list[Date], order: str) -> str:
    """Return a date that is one in this order alone."""
    for date in dates:
        days = [np.isfinite(_day(date, one)) for one in PLACES]
        if np.isfinite(_day(date, order)) and sum(days) == 1:
            return "/".join(date)
    return "the dates that exist"


def _distinct(read: Mapping[str, np.ndarray], orders: list[str]) -> list[str]:
    kept: list[str] = []
    for order in orders:
        if not any(np.array_equal(read[order], read[one], equal_nan=True) for one in kept):
            kept.append(order)
    return kept


def _has_no_long_pause(seconds: np.ndarray) -> bool:
    steps = np.diff(seconds[np.isfinite(seconds)])
    return bool(np.all(steps < LONGEST_PAUSE_DAYS * DAY_S))
