"""Formats of times as headers state them: hh:mm, [d:hh:mm], mm:ss.fff, dd/mm/yyyy hh:mm:ss."""

from __future__ import annotations

import re
from dataclasses import dataclass

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
    """How a column of times is written.

    Attributes:
        text: As the header states it.
        parts: Letters of what stands in a cell, in order: d, h, m, s and f (a fraction).
        separators: What stands between them.
        order: Order of the date, `"day/month/year"` and so on; empty for a clock.
    """

    text: str
    parts: str
    separators: tuple[str, ...] = ()
    order: str = ""

    @property
    def spoken(self) -> str:
        """The format in words, such as `"hours:minutes"`."""
        return self.order or ":".join(SPOKEN[part] for part in self.parts if part != "f")


def parse_time_format(text: str) -> TimeFormat | None:
    """Return the format that a text states, or None if it states none.

    Args:
        text: Such as `"hh:mm"`, `"[h]:mm:ss"`, `"min:s"` or `"%d.%m.%Y %H:%M:%S"`.

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
    if "y" in letters:
        date, rest = letters[:3], letters[3:]
        if date not in DATES or (rest and not _clock(rest)):
            return None
        return TimeFormat(text, letters, separators, DATES[date])
    parts = _clock(letters)
    if parts is None or not (":" in separators or parts.startswith("hms")):
        return None
    return TimeFormat(text, parts, separators)


def stated_format(name: str, label: str, unit: str | None) -> tuple[str, TimeFormat | None]:
    """Return the label of a column and the format of times that its header states, if any.

    Args:
        name: Name of the column as it stands in the file.
        label: The name without what is known to be a unit.
        unit: Its unit text, or None.
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
