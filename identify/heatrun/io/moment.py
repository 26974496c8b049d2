"""The time that is written into files: that of SOURCE_DATE_EPOCH where it is set, else now.

The same command with the same seed writes the same bytes. Only the manifest of a run says when it
was made; with SOURCE_DATE_EPOCH (seconds since 1970, of the Reproducible Builds project) it too is
the same every time. Other files carry that date where their format wants one, or none.
"""

from __future__ import annotations

import datetime
import os

from ..errors import UsageError

VARIABLE = "SOURCE_DATE_EPOCH"

NO_DATE = datetime.datetime(1980, 1, 1, tzinfo=datetime.UTC)
"""What stands where a format needs a date and none is given: the first that ZIP knows."""


def stated_moment() -> datetime.datetime | None:
    """Return the moment of SOURCE_DATE_EPOCH in UTC, or None where it is not set.

    Raises:
        UsageError: If it is no number of seconds.
    """
    text = os.environ.get(VARIABLE)
    if not text:
        return None
    try:
        if not (text.isascii() and text.isdigit()):
            raise ValueError
        return datetime.datetime.fromtimestamp(int(text), tz=datetime.UTC)
    except (ValueError, OverflowError, OSError) as error:
        raise UsageError(
            f"the environment variable {VARIABLE} is {text[:40]!r}; expected whole seconds since "
            "1970-01-01, such as 1700000000. Correct it, or unset it."
        ) from error


def check_stated_moment() -> None:
    """Refuse a wrong SOURCE_DATE_EPOCH before any work, and drop an empty one: NumPy fails on it.

    Raises:
        UsageError: As `stated_moment`.
    """
    if stated_moment() is None:
        os.environ.pop(VARIABLE, None)


def moment() -> datetime.datetime:
    """Return the moment of a run in UTC: the stated one, or now."""
    return stated_moment() or datetime.datetime.now(datetime.UTC)
