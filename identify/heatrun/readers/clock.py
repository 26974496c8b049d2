"""Times written as a clock, turned to seconds by the format of the header or by their own look.

Their look counts where it leaves one reading. Formats that headers state: hh:mm, [d:hh:mm],
mm:ss.fff, dd/mm/yyyy hh:mm:ss.
"""

import re
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from ..record.table import Question

LONGEST_FORMAT = 60
"""Letters; what is longer is no format, and need not be looked at."""

WORDS = {
    "d": "d dd ddd day days tag tage tt gg g t",
    "h": "h hh hhh hr hrs hour hours std stunden",
    "m": "m mm mmm min mins minute minutes minuten mn",
    "s": "s ss sss sec secs second seconds sek sekunden",
    "f": "f ff fff ffff ffffff x xx xxx z zz zzz 0 00 000 000000 ms msec cs",
    "y": "y yy yyyy year jjjj aaaa",
    "p": "am/pm ampm a/p",
}
KIND = {word: kind for kind, words in WORDS.items() for word in words.split()}
PIECE = re.compile(r"am/pm|a/p|[a-z]+|[0-9]+|[^a-z0-9]+")
CLOCK_ORDER = "dhmsf"
SECONDS = {"d": 86400.0, "h": 3600.0, "m": 60.0, "s": 1.0}
SIZE = {"h": 24, "m": 60, "s": 60}
"""How many of a part make one of the part before it."""

DATES = {"dmy": "day/month/year", "mdy": "month/day/year", "ymd": "year-month-day"}
SPOKEN = {"d": "days", "h": "hours", "m": "minutes", "s": "seconds", "f": "fraction"}
NAMED = re.compile(r"[\s_,;]+")
BRACKETED = re.compile(r"^(?P<label>[^()\[\]{}<>]*)[(\[{<](?P<inner>.*)[)\]}>]$", re.DOTALL)


@dataclass(frozen=True)
class TimeFormat:
    """How a column of times is written."""

    text: str  # As the header states it.
    parts: str  # Letters of what stands in a cell, in order: d, h, m, s and f (a fraction).
    separators: tuple[str, ...] = ()  # What stands between them.
    order: str = ""  # Order of the date, `"day/month/year"` and so on; empty for a clock.

    @property
    def spoken(self) -> str:
        """The format in words, such as `"hours:minutes"`."""
        return self.order or ":".join(SPOKEN[part] for part in self.parts if part != "f")


def parse_time_format(text: str) -> TimeFormat | None:
    """Return the format that a text states, such as `"[h]:mm:ss"` or `"%d.%m.%Y %H:%M:%S"`, or
    None.

    Example:
        >>> parse_time_format("hh:mm").spoken
        'hours:minutes'
        >>> parse_time_format("°C") is None
        True
    """
    if len(text) > LONGEST_FORMAT:
        return None
    plain = re.sub(r"[\[\](){}%]", "", text.strip().casefold())
    plain = re.sub(r"\s*(am/pm|a/p| tt)$", "", plain)
    plain = re.sub(r"(?<=[dy])t(?=h)", " ", plain)  # the T of ISO 8601
    pieces = PIECE.findall(plain)
    words, separators = pieces[::2], tuple(piece.strip() or " " for piece in pieces[1::2])
    if len(words) < 2 or len(words) != len(separators) + 1:
        return None
    kinds = [KIND.get(word) for word in words]
    if None in kinds or any(not set(sign) <= set(":.,-/_ '") for sign in separators):
        return None
    letters = "".join(kind for kind in kinds if kind)
    if "y" in letters or letters.startswith("dmh"):  # a date may leave the year out
        date, rest = (letters[:3], letters[3:]) if "y" in letters else ("dmy", letters[2:])
        if date not in DATES or (rest and not _clock(rest)):
            return None
        return TimeFormat(text, letters, separators, DATES[date])
    parts = _clock(letters)
    if parts is None or not (":" in separators or parts.startswith("hms")):
        return None
    return TimeFormat(text, parts, separators)


def stated_format(name: str, label: str, unit: str | None) -> tuple[str, TimeFormat | None]:
    """Return the label of a column and the format of times that its header states, if any.

    The label is the name in the file without what is known to be a unit.
    """
    if unit is not None:
        return label, parse_time_format(unit)
    if ":" not in name or len(name) > 4 * LONGEST_FORMAT:
        return label, None
    bracket = BRACKETED.match(name.strip())
    if bracket and (found := parse_time_format(bracket["inner"])):
        return bracket["label"].strip() or name, found
    if found := parse_time_format(name):
        return label, found
    for gap in NAMED.finditer(name):
        if found := parse_time_format(name[gap.end() :]):
            return name[: gap.start()].strip() or name, found
    return label, None


def _clock(letters: str) -> str | None:
    """Return the parts of a clock, from large to small without a gap, or None."""
    parts = letters
    if re.fullmatch(r"d?h?m?s[msf]", letters):  # ss.mmm and ss.sss count thousandths
        parts = letters[:-1] + "f"
    start = CLOCK_ORDER.find(parts[0])
    is_run = start >= 0 and parts == CLOCK_ORDER[start : start + len(parts)]
    return parts if is_run and len(parts) > 1 and parts != "sf" else None


HALF = r"(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
CLOCK = r"(?:(?P<hour>[0-9]+):)?(?P<minute>[0-9]+):(?P<second>[0-5]?[0-9](?:[.,][0-9]*)?)" + HALF
CLOCK_CELL = re.compile(CLOCK)

OF_DAY = r"(?P<hour>[0-9]{1,2}):(?P<minute>[0-5][0-9]):(?P<second>[0-5][0-9](?:\.[0-9]*)?)"
DAYS = (
    r"(?P<day>[0-9]+)\s*(?:days?|d|Tage?),?\s+"
    r"(?P<clock>[0-9]{1,2}:[0-5][0-9]:[0-5][0-9](?:\.[0-9]*)?)"
)
DAYS_CELL = re.compile(DAYS)
"""Durations as Python and pandas write them: "0 days 00:00:10", "1 day, 0:00:10"."""

DAY_S = 86400.0
HOUR_S = 3600.0
LONGEST_PAUSE_S = 60.0
LONGEST_PAUSE_STEPS = 5.0
"""Across midnight a clock may skip so much, in seconds or in steps; a longer pause leaves the
backward step as it is, which the checks refuse."""

FAR_LESS_REGULAR = 3.0
"""Ratio of the largest to the smallest step; so many times that of another reading is a doubt."""


@dataclass(frozen=True)
class Values:
    """The values of one column."""

    # Float64, shape (time,); of dates seconds from the first one; NaN where a cell holds no such
    # value.
    numbers: np.ndarray
    note: str = ""  # How they were read if not as plain numbers, as a sentence without its subject.
    question: Question | None = None  # What the cells leave open, or None.
    doubt: str = ""  # What speaks against the reading, as a sentence, or empty.
    # Day of the first time, ISO 8601; empty where the cells do not say it for certain.
    start: str = ""
    is_time: bool = False  # The cells were clock times or dates; the numbers are seconds.
    # Which cells hold something that could not be read, shape (time,).
    unreadable: np.ndarray | None = None
    first_text: str = ""  # What stands in the first of these, or empty.


Times = partial(Values, is_time=True)


def read_stated(cells: pd.Series, stated: TimeFormat) -> Values:
    """Read clock times in the format that the header or `[columns]` states, and in no other."""
    parts = cells.str.extract(f"^{_pattern(stated)}$")
    seconds = np.zeros(len(cells))
    for index, part in enumerate(stated.parts):
        if part == "f":
            whole = numbers(parts["f"].fillna("0"))
            digits = parts["f"].fillna("0").str.len().to_numpy(dtype=float)
            seconds += whole / 10.0**digits
            continue
        value = numbers(parts[part])
        if index:
            value[value >= SIZE[part]] = np.nan
        seconds += SECONDS[part] * value
    if "h" in stated.parts:
        seconds = _half_days(seconds, parts["half"])
    if "s" in stated.parts:
        places = "." + parts["f"] if "f" in stated.parts else parts["s"]
        seconds = np.round(seconds, decimals(places))  # undo the rounding of the sum
    seconds, wrapped = unwrapped(seconds, stated.parts)
    return Times(seconds, f"read as {stated.spoken}, as stated{wrapped}")


def read_clock(cells: pd.Series, name: str = "time") -> Values:
    """Read `m:ss.s` and `h:mm:ss.s`, also mixed; `a:b` only where it can be but one of two.

    Cells are texts without blanks around them, shape (time,); `name` is for the answers to a
    question.
    """
    parts = cells.str.extract(f"^{CLOCK}$")
    hour = numbers(parts["hour"].fillna("0"))
    minute = numbers(parts["minute"])
    with_hour = parts["hour"].notna().to_numpy()
    readable = parts["minute"].notna().to_numpy()
    has_fraction = bool(parts["second"].str.contains(r"[.,]", na=False).any())
    if not (with_hour & readable).any() and not has_fraction:
        return _two_parts(parts, name)
    seconds = HOUR_S * hour + 60.0 * minute + numbers(parts["second"])
    seconds[with_hour & (minute >= 60)] = np.nan
    seconds = _half_days(seconds, parts["half"])
    seconds = np.round(seconds, decimals(parts["second"]))  # undo the rounding of the sum
    readable = np.isfinite(seconds)
    forms = [
        (form, letters)
        for form, letters, present in (
            ("minutes:seconds", "ms", (readable & ~with_hour).any()),
            ("hours:minutes:seconds", "hms", (readable & with_hour).any()),
        )
        if present
    ]
    note = f"read as {' and '.join(form for form, _ in forms)}"
    if len(forms) != 1:
        return Times(seconds, note)
    seconds, wrapped = unwrapped(seconds, forms[0][1])
    question = None
    if forms[0][1] == "hms" and not has_fraction and parts["half"].isna().all():
        question = _other_parts(seconds, parts, name)
    return Times(seconds, note + wrapped, question)


def read_days(cells: pd.Series) -> Values:
    """Read durations of days and a clock; where no days stand, there are none."""
    days = cells.str.extract(f"^{DAYS}$")
    clocks = days["clock"].fillna(cells)
    parts = clocks.str.extract(f"^{OF_DAY}$")
    hour = numbers(parts["hour"])
    hour[hour >= SIZE["h"]] = np.nan
    seconds = HOUR_S * hour + 60.0 * numbers(parts["minute"]) + numbers(parts["second"])
    seconds += DAY_S * numbers(days["day"].fillna("0"))
    seconds = np.round(seconds, decimals(parts["second"]))  # undo the rounding of the sum
    return Times(seconds, "read as days hours:minutes:seconds")


def _two_parts(parts: pd.DataFrame, name: str) -> Values:
    """Return `a:b`: minutes and seconds, or hours and minutes."""
    first, second = numbers(parts["minute"]), numbers(parts["second"])
    short, short_wrapped = unwrapped(60.0 * first + second, "ms")
    long, long_wrapped = unwrapped(_half_days(HOUR_S * first + 60.0 * second, parts["half"]), "hm")
    if parts["half"].notna().any():
        return Times(long, f"read as hours:minutes, for they have am or pm{long_wrapped}")
    forward = rises(short), rises(long)
    if forward == (False, True):
        note = "read as hours:minutes, as minutes:seconds would run backwards"
        return Times(long, f"{note}{long_wrapped}")
    if forward == (True, False):
        note = "read as minutes:seconds, as hours:minutes would run backwards"
        return Times(short, f"{note}{short_wrapped}")
    largest = float(np.nanmax(first))
    either = f"minutes:seconds ({_spoken(short)}) or hours:minutes ({_spoken(long)})"
    if largest >= SIZE["m"]:
        why = f"for the first number goes up to {largest:.0f}"
        doubt = f"The times may be {either}; minutes:seconds is taken, {why}."
        return Times(short, f"read as minutes:seconds, {why}", doubt=doubt)
    problem = f"The times, {_example(parts)}, may be {either}; the file does not say which."
    question = Question(problem, (f"{name} [mm:ss]", f"{name} [hh:mm]"))
    return Times(short, "read as minutes:seconds", question)


def _other_parts(seconds: np.ndarray, parts: pd.DataFrame, name: str) -> Question | None:
    """Return the question of `a:b:c` that is far more regular in another reading, or None."""
    first, middle, last = (numbers(parts[part]) for part in ("hour", "minute", "second"))
    other = DAY_S * first + HOUR_S * middle + 60.0 * last
    other[middle >= SIZE["h"]] = np.nan
    hundredths = 60.0 * first + middle + 0.01 * last
    for times, spoken, answer in (
        (other, "days:hours:minutes", "d:hh:mm"),
        (hundredths, "minutes:seconds:hundredths", "mm:ss:ff"),
    ):
        if np.isfinite(times).sum() < np.isfinite(seconds).sum() or not rises(times):
            continue
        if not rises(seconds) or _irregularity(seconds) > FAR_LESS_REGULAR * _irregularity(times):
            return Question(
                f"The times, {_example(parts)}, may be hours:minutes:seconds "
                f"({_spoken(seconds)}), with jumps, or {spoken} ({_spoken(times)}), without.",
                (f"{name} [hh:mm:ss]", f"{name} [{answer}]"),
            )
    return None


def spoken_duration(seconds: float) -> str:
    """Return a duration [s] in the largest unit of which it has at least two."""
    for unit, size in (("days", DAY_S), ("h", HOUR_S), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"


def _spoken(seconds: np.ndarray) -> str:
    """Return median step and span of times, in words."""
    known = seconds[np.isfinite(seconds)]
    if known.size < 2:
        return "one time alone"
    step, span = float(np.median(np.diff(known))), float(np.ptp(known))
    return f"a step of {spoken_duration(step)}, {spoken_duration(span)} in all"


def _example(parts: pd.DataFrame) -> str:
    """Return the first and the last time as they stand in the file."""
    known = parts[parts["minute"].notna()]
    shown = []
    for _, row in known.iloc[[0, -1]].iterrows():
        cells = [row["hour"], row["minute"], row["second"]]
        shown.append(":".join(cell for cell in cells if isinstance(cell, str)))
    return f"'{shown[0]}' to '{shown[1]}'"


def _pattern(stated: TimeFormat) -> str:
    pieces = [rf"(?P<{stated.parts[0]}>[0-9]+)"]
    for part, sign in zip(stated.parts[1:], stated.separators, strict=False):
        if part == "f":  # a cell may leave the fraction out
            pieces.append(rf"(?:{'[.,]' if sign in '.,' else re.escape(sign)}(?P<f>[0-9]+))?")
            continue
        between = r"\s+" if sign == " " else rf"\s*{re.escape(sign)}\s*"
        fraction = r"(?:[.,][0-9]*)?" if part == "s" and "f" not in stated.parts else ""
        pieces.append(rf"{between}(?P<{part}>[0-9]{{1,2}}{fraction})")
    return "".join(pieces) + HALF


def _half_days(seconds: np.ndarray, half: pd.Series) -> np.ndarray:
    """Return times of a day of twice twelve hours; NaN where there is no such hour."""
    twelve = half.notna().to_numpy()
    if not twelve.any():
        return seconds
    within = (seconds >= HOUR_S) & (seconds < 13 * HOUR_S)
    afternoon = (half.str.lower() == "p").to_numpy()
    counted = np.where(within, seconds % (DAY_S / 2) + DAY_S / 2 * afternoon, np.nan)
    return np.where(twelve, counted, seconds)


def unwrapped(seconds: np.ndarray, parts: str) -> tuple[np.ndarray, str]:
    """Return times that go on where the clock begins anew, and words for it.

    Only what is plainly the clock's own turn is followed: at midnight, or at the full hour for
    minutes and seconds alone. Any other backward step stays, and the checks refuse it.
    """
    period = DAY_S if "h" in parts else HOUR_S
    known = np.flatnonzero(np.isfinite(seconds))
    if "d" in parts or np.max(np.abs(seconds[known]), initial=0.0) >= period:
        return seconds, ""
    steps = np.diff(seconds[known])
    turns = steps < 0
    if not turns.any():
        return seconds, ""
    forward = steps[steps > 0]
    step = float(np.median(forward)) if forward.size else 0.0
    pause = steps[turns] + period
    if np.any(pause > max(LONGEST_PAUSE_S, LONGEST_PAUSE_STEPS * step)):
        return seconds, ""
    moved = seconds.copy()
    moved[known[1:]] += period * np.cumsum(turns)
    count, where = int(turns.sum()), "midnight" if "h" in parts else "the full hour"
    return moved, f", going on past {where}{f' ({count} times)' if count > 1 else ''}"


def rises(seconds: np.ndarray) -> bool:
    """Return whether times, shape (time,), never step back; NaN is passed over."""
    known = seconds[np.isfinite(seconds)]
    return known.size > 0 and bool(np.all(np.diff(known) >= 0))


def _irregularity(seconds: np.ndarray) -> float:
    """Return the largest step over the smallest of those forward [1]."""
    steps = np.diff(seconds[np.isfinite(seconds)])
    forward = steps[steps > 0]
    return float(np.max(forward) / np.min(forward)) if forward.size else 1.0


def numbers(texts: pd.Series) -> np.ndarray:
    """Return texts of numbers, with point or comma, as numbers; NaN where there is none."""
    return texts.str.replace(",", ".").astype(float).to_numpy(copy=True)


def decimals(seconds: pd.Series) -> int:
    """Return the most decimals that any cell writes."""
    fraction = seconds.dropna().str.extract(r"[.,]([0-9]*)$")[0].dropna()
    return int(fraction.str.len().max()) if len(fraction) else 0
