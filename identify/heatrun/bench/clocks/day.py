"""The day on which a recording began, as its own clock says."""

from __future__ import annotations

import datetime
import re

STAMP = re.compile(r"(?P<year>[0-9]{4})-(?P<month>[0-9]{2})-(?P<day>[0-9]{2})(?![0-9])")

CLOCK, HEADER = "clock of the record", "header of the file"
"""What can say the day of a test."""

FIRST_YEAR = 1990
"""Clocks that nobody has set begin in 1904, 1970 or 1980."""


def day_of(start: str) -> str:
    """Return the day of a moment as ISO 8601; empty without one or of a clock that was never set.

    Args:
        start: A day or a moment, the year first.

    Example:
        >>> day_of("2026-03-04T10:00:00+00:00"), day_of("1970-01-01"), day_of("")
        ('2026-03-04', '', '')
    """
    found = STAMP.match(start)
    if found is None or int(found["year"]) < FIRST_YEAR:
        return ""
    try:
        return datetime.date.fromisoformat(found[0]).isoformat()
    except ValueError:
        return ""
