"""The day of a test from the lines above its table: a date that is said to be that of the test."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from .date_words import NUMBER_OF, WORD
from .day import FIRST_YEAR

DATE = re.compile(
    r"(?<![0-9])(?:"
    r"(?P<iso>[0-9]{4}[-/.][0-9]{1,2}[-/.][0-9]{1,2})"
    r"|(?P<compact>(?:19|20)[0-9]{6})"
    r"|(?P<numbers>[0-9]{1,2}[-/.][0-9]{1,2}[-/.][0-9]{4}|[0-9]{1,2}\.[0-9]{1,2}\.[0-9]{2})"
    rf"|(?P<worded>[0-9]{{1,2}}\.?[- ]{WORD}[- ][0-9]{{4}})"
    r")(?![0-9])"
)
OF_THE_TEST = re.compile(
    r"(?<!\w)(?:dat(?:e|um|a|i)(?!\w)|day|tag(?!\w)|start|begin|inizi|d[ée]but|record|measure|mess"
    r"|aufnahme|aufzeichnung|test|pr[üu]f|prova|versuch|acqui|protokoll|run(?!\w)|lauf|vom(?!\w))",
    re.IGNORECASE,
)
"""What stands before the day of a test."""

OF_SOMETHING_ELSE = re.compile(
    r"calib|kalib|eich|taratura|export|print|druck|stampa|version|software|firmware|release|build"
    r"|due(?!\w)|valid|g[üu]ltig|next|n[äa]chst|expir|scad|licen|lizenz|copyright|modif|chang|geändert"
    r"|(?<!\w)(?:end|stop|fine|fin)(?:e|ed)?(?!\w)|saved|install|manufact|baujahr|deliver|received"
    r"|norm(?!\w)|(?<!\w)(?:iso|iec|din|en|norm)(?!\w)",
    re.IGNORECASE,
)
"""What stands before a date of the instruments, the program, the file or the end."""

MOST_LINES = 200


@dataclass(frozen=True)
class HeaderDay:
    """What the header says of the day of a test.

    Attributes:
        day: ISO 8601; empty if it says none, or several.
        note: Where the day is from, or why there is none; empty if no line speaks of it.
    """

    day: str = ""
    note: str = ""


def header_day(lines: Iterable[str]) -> HeaderDay:
    """Return the day of a test by the lines above its table.

    A date counts where the words before it say that it is that of the test, or where it begins its
    line. 03/04/2025 could be March or April, and counts for nothing.

    Args:
        lines: The preamble of a text table or of a sheet.

    Example:
        >>> header_day(["Kalibriert: 01.02.2023", "Datum: 04.03.2025"]).day
        '2025-03-04'
    """
    found = {}
    for _, line in zip(range(MOST_LINES), lines, strict=False):
        for day in _days(line):
            found.setdefault(day, " ".join(line.split())[:80])
    if len(found) > 1:
        days = ", ".join(sorted(found))
        return HeaderDay(
            note=f"The header holds several dates ({days}): none is taken for that of the test."
        )
    for day, line in found.items():
        return HeaderDay(day, f"Date of the test: {day}, by the line '{line}' of the header.")
    return HeaderDay()


def _days(line: str) -> Iterator[str]:
    """Give the days of a line that may be those of the test."""
    past = 0
    for found in DATE.finditer(line):
        before, past = line[past : found.start()], found.end()
        is_first = found.start() == len(before)
        if OF_SOMETHING_ELSE.search(before):
            continue
        if not OF_THE_TEST.search(before) and (not is_first or re.search(r"\w", before)):
            continue
        if day := _day(found):
            yield day


def _day(found: re.Match[str]) -> str:
    """Return a date as ISO 8601; empty if there is no such day or it can be read in two ways."""
    if found["compact"]:
        text = found["compact"]
        return _iso(int(text[:4]), int(text[4:6]), int(text[6:]))
    if found["worded"]:
        month = NUMBER_OF.get(found["month"].casefold(), 0)
        day, year = (int(number) for number in re.findall("[0-9]+", found["worded"]))
        return _iso(year, month, day)
    first, second, third = (int(number) for number in re.findall("[0-9]+", found[0]))
    if found["iso"]:
        return _iso(first, second, third)
    year = third + 2000 if third < 100 else third
    if "." in found[0] or first > 12 or first == second:
        return _iso(year, second, first)
    return _iso(year, first, second) if second > 12 else ""


def _iso(year: int, month: int, day: int) -> str:
    try:
        date = datetime.date(year, month, day)
    except ValueError:
        return ""
    return date.isoformat() if year >= FIRST_YEAR else ""
