"""Dates: with a time, turned to seconds from the first one, and the day of a test.

That day stands in the lines above its table, or in the clock of the recording. Clocks and dates may
have words or other signs in them: the month in letters, no signs at all, a colon before the
thousandths, hours and minutes by their letter, years and days by their character.
"""

import datetime
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

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

    Cells have no blanks around them, shape (time,); the name is for the answers to a question. The
    header may state an order, a key of `PLACES`; `known_by` says why it is known beforehand.
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
    known = np.flatnonzero(np.isfinite(seconds))
    row = int(known[0])
    start = cells.iloc[row]
    question = None
    if len(left) > 1:
        spans = " or ".join(
            f"{one} ({spoken_duration(float(np.nanmax(read[one]) - np.nanmin(read[one])))} in all)"
            for one in left
        )
        end = cells.iloc[int(known[-1])]
        question = Question(
            f"The dates, '{start}' to '{end}', may be {spans}; the file does not say which.",
            tuple(f"{name} [{FORMATS[one]}]" for one in left),
        )
    shown = start.replace(f".{NO_YEAR} ", ". ")
    note = f"read as {best} ({reason or why}), seconds from {shown}"
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
    unlike: list[str] = []
    for order in left:
        if not any(np.array_equal(read[order], read[one], equal_nan=True) for one in unlike):
            unlike.append(order)
    if len(unlike) == 1:
        return unlike, NO_DIFFERENCE
    left = unlike
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


def _has_no_long_pause(seconds: np.ndarray) -> bool:
    steps = np.diff(seconds[np.isfinite(seconds)])
    return bool(np.all(steps < LONGEST_PAUSE_DAYS * DAY_S))


STAMP = re.compile(r"([0-9]{4})-([0-9]{2})-([0-9]{2})(?![0-9])")

CLOCK_OF_DAY, HEADER = "clock of the record", "header of the file"
"""What can say the day of a test."""

FIRST_YEAR = 1990
"""Clocks that nobody has set begin in 1904, 1970 or 1980."""


def day_of(start: str) -> str:
    """Return the day of a moment, the year first, as ISO 8601; empty of a clock that was never set.

    Example:
        >>> day_of("2026-03-04T10:00:00+00:00"), day_of("1970-01-01"), day_of("")
        ('2026-03-04', '', '')
    """
    found = STAMP.match(start)
    return "" if found is None else _iso(*map(int, found.groups()))


TIME_OF_DAY = re.compile(r"[T ]([0-9]{1,2}):([0-9]{2})(?::([0-9]+(?:\.[0-9]*)?))?")


def second_of_day(start: str) -> float | None:
    """Return how long after midnight a moment is [s]; None of a clock that was never set.

    Example:
        >>> second_of_day("2026-03-04T10:00:02.5"), second_of_day("1970-01-01T10:00:00")
        (36002.5, None)
    """
    found = TIME_OF_DAY.search(start)
    if found is None or (STAMP.match(start) and not day_of(start)):
        return None
    hours, minutes, seconds = (float(part or 0.0) for part in found.groups())
    return 3600.0 * hours + 60.0 * minutes + seconds


MONTHS = (
    "jan january januar janvier gen gennaio jän jänner janv",
    "feb february februar février févr fév febbraio",
    "mar march mär märz mrz mars marzo",
    "apr april avril avr aprile",
    "may mai maggio mag",
    "jun june juni juin giu giugno",
    "jul july juli juil juillet lug luglio",
    "aug august août aou aoû ago agosto",
    "sep sept september septembre set settembre",
    "oct october okt oktober octobre ott ottobre",
    "nov november novembre",
    "dec december dez dezember déc décembre dic dicembre",
)
"""Names and abbreviations in English, German, French and Italian."""

NUMBER_OF = {word: number for number, words in enumerate(MONTHS, 1) for word in words.split()}

CLOCK = (
    r"(?P<clock>[0-9]{1,2}:[0-5][0-9](?::[0-5]?[0-9](?:[.,][0-9]*)?)?\s*(?:[AaPp][Mm])?"
    r"\s*(?:Z|[+-][0-9]{2}:?[0-9]{2})?)"
)
WORD = r"(?P<month>[A-Za-zäéû]{3,9})\.?"
DAY_FIRST = rf"(?P<day>[0-9]{{1,2}})\.?[- /]{WORD}[- /](?P<year>[0-9]{{4}}),?[T _]\s*{CLOCK}"
MONTH_FIRST = rf"{WORD}[- ](?P<day>[0-9]{{1,2}}),?[- ](?P<year>[0-9]{{4}}),?[T _]\s*{CLOCK}"
COMPACT = (
    r"(?P<year>(?:19|20)[0-9]{2})(?P<month>[01][0-9])(?P<day>[0-3][0-9])[T_ ]"
    r"(?P<hour>[0-2][0-9])(?P<minute>[0-5][0-9])(?P<second>[0-5][0-9](?:[.,][0-9]*)?)?"
    r"(?P<zone>Z|[+-][0-9]{2}:?[0-9]{2})?"
)
FORMS = {
    "the month stands in letters": (DAY_FIRST, MONTH_FIRST),
    "the year comes first": (COMPACT,),
}
CELLS = tuple(re.compile(form) for forms in FORMS.values() for form in forms)


FRACTION = re.compile(r"(?P<clock>[0-9]+:[0-5]?[0-9]:[0-5]?[0-9])[: ](?P<digits>[0-9]{6}|[0-9]{3})")
SHORT_FRACTION = re.compile(
    r"(?P<clock>[0-9]+[-/.][0-9]+[-/.][0-9]+[T ,_-]+[0-9]+:[0-9]+:[0-9]+):(?P<digits>[0-9]{1,2})"
)
"""Behind a date, where the first of four numbers is no day."""

NO_YEAR = "1904"
"""Stands for the year where a date has none: a leap year before `FIRST_YEAR`, so no day is told."""


def _half(found: re.Match[str]) -> str:
    """Return the half of a day, written in Spanish or Greek, as AM or PM."""
    return f" {(found[1] or ('p' if found[2] else 'a')).upper()}M"


def _of_year(found: re.Match[str]) -> str:
    """Return the day of a year, such as 2024-065, as a date; as it is if there is no such day."""
    try:
        return f"{datetime.datetime.strptime(f'{found[1]} {found[2]}', '%Y %j'):%Y-%m-%d}"
    except ValueError:
        return found[0]


LETTERED = (
    (re.compile(r"^[\[(]\s*(.*)[\])]$"), r"\1"),
    (re.compile(r"^T?\+\s*(?=[0-9]+:)|\s*Uhr$|^'(?=[0-9])"), ""),
    (re.compile(r"(?<=[0-9])\s*(?:([AaPp])\.\s?[Mm]\.?|(?:π\.?|(μ\.?))\s?μ\.?)$"), _half),
    (re.compile(r"^([0-9]{1,2}:[0-9:.,]+)\s*(?:UTC|GMT)$"), r"\1"),
    (re.compile(r"(?<=[0-9])\s*(?:UTC|GMT)$"), "Z"),
    (re.compile(r"^([0-9]{4})[-/]([0-9]{3})(?=[T ])"), _of_year),
    (re.compile(r"^(?:mon|tue|wed|thu|fri|sat|sun)[a-z]*[.,]?\s+(?=[0-9A-Z])", re.IGNORECASE), ""),
    # behind the day of the week, as C and Unix write it
    (re.compile(r"^([A-Z][a-z]{2}) +([0-9]{1,2}) ([0-9:.,]+) ([0-9]{4})$"), r"\2-\1-\4 \3"),
    (re.compile(r"([0-9]+)[年년]\s*([0-9]+)[月월]\s*([0-9]+)[日일]\s*"), r"\1-\2-\3 "),
    (re.compile(r"(?:上午|午前|오전)\s*(\S+)"), r"\1 AM"),
    (re.compile(r"(?:下午|午後|오후)\s*(\S+)"), r"\1 PM"),
    (
        re.compile(
            r"([0-9]+)\s*(?:h|[時时点시])\s*([0-9]+)\s*(?:m|min|[分분])\s*([0-9]+(?:[.,][0-9]+)?)\s*[s秒초]?"
        ),
        r"\1:\2:\3",
    ),
    # behind a date, minus or point in a clock too
    (
        re.compile(
            r"^([0-9]+[-/.][0-9]+[-/.][0-9]+[T ,_]+[0-9]{1,2})([-.])([0-5][0-9])\2([0-5][0-9])"
            r"(?![-.]?[0-9]+[-.])"
        ),
        r"\1:\3:\4",
    ),
    (re.compile(r"^([0-9]{1,2}\.[0-9]{1,2}\.)\s+(?=[0-9]+:)"), rf"\g<1>{NO_YEAR} "),
)


MOST_LOOKED_AT = 1000
"""Cells of a column of which one must need it, before all are gone through."""


def plain_clock(cell: str) -> str:
    """Return a time or date with the signs that a clock has: 9h05m10s as 9:05:10.

    Example:
        >>> plain_clock("01/26/2024 08:07:12:237")
        '01/26/2024 08:07:12.237'
        >>> plain_clock("2024年9月27日 下午 1:05:00")
        '2024-9-27 1:05:00 PM'
    """
    for pattern, plain in LETTERED:
        cell = pattern.sub(plain, cell)
    found = FRACTION.search(cell)
    if found is None or re.match("[0-9:.,]", cell[found.end() :]):
        return cell
    return f"{cell[: found.end('clock')]}.{cell[found.start('digits') :]}"


def plain_clocks(cells: pd.Series) -> pd.Series:
    """Return such times and dates; as `plain_clock`, and with fractions of one or two digits.

    A fraction that is as long in every cell is one; else it counts thousandths.
    """
    first = cells[cells != ""].iloc[:MOST_LOOKED_AT]
    if first.map(plain_clock).equals(first) and not first.str.fullmatch(SHORT_FRACTION).any():
        return cells
    cells = cells.map(plain_clock)
    digits = cells.str.extract(f"^{SHORT_FRACTION.pattern}$")
    short = digits["digits"].notna()
    if not short.any():
        return cells
    counts = (
        digits["digits"].str.len()[short].nunique() > 1
        or cells[~short].str.contains(r":[0-9]+\.[0-9]{3}$").any()
    )
    fraction = digits["digits"].str.zfill(3) if counts else digits["digits"]
    return cells.where(~short, digits["clock"] + "." + fraction)


def is_worded_date(cell: str) -> bool:
    """Return whether a cell is a date with a time as this module reads it."""
    for pattern in CELLS:
        found = pattern.fullmatch(cell)
        if found is not None:
            return found["month"].isdigit() or found["month"].casefold() in NUMBER_OF
    return False


def numbered_dates(cells: pd.Series) -> tuple[pd.Series, str]:
    """Return such dates as year-month-day and clock, and why their order is known.

    Other cells stay as they are; the reason is empty if no cell is such a date.
    """
    for reason, forms in FORMS.items():
        for form in forms:
            parts = cells.str.extract(f"^{form}$")
            if parts["year"].isna().all():
                continue
            named = parts["month"].str.casefold().map(NUMBER_OF)
            month = named.astype("Int64").astype("string").fillna(parts["month"]).astype(object)
            if "clock" not in parts:
                second = parts["second"].fillna("00")
                clock = parts["hour"] + ":" + parts["minute"] + ":" + second
                parts["clock"] = clock + parts["zone"].fillna("")
            day = parts["year"] + "-" + month + "-" + parts["day"]
            is_date = parts["year"].notna() & month.str.fullmatch("[0-9]{1,2}").eq(True)
            if is_date.any():
                return cells.where(~is_date, day + " " + parts["clock"]), reason
    return cells, ""


DATE_IN_LINE = re.compile(
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


class HeaderDay(NamedTuple):
    """Day of a test, empty without one or of several, and where it is from or why there is none."""

    day: str = ""
    note: str = ""


def header_day(lines: Iterable[str]) -> HeaderDay:
    """Return the day of a test by the lines above its table.

    A date counts where the words before it say that it is that of the test, or where it begins its
    line. 03/04/2025 could be March or April, and counts for nothing.

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
    for found in DATE_IN_LINE.finditer(line):
        before, past = line[past : found.start()], found.end()
        is_first = found.start() == len(before)
        if OF_SOMETHING_ELSE.search(before):
            continue
        if not OF_THE_TEST.search(before) and (not is_first or re.search(r"\w", before)):
            continue
        if day := _day_in(found):
            yield day


def _day_in(found: re.Match[str]) -> str:
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
