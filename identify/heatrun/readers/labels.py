"""Labels of columns, with the quantity known: units that no mark sets off, and what is left.

A unit without a mark is found in the parts of a label between blanks, "_", "-", ".", ":", "|",
"=" and, as in "speedRpm", at a capital letter:

- The longest run of parts at the end that is a unit of the quantity: `P_kW`, `Losses kilo watts`.
  Words of statistics and numbers behind it do not count: `Pv_kW_mean`.
- Else one part anywhere that can be nothing else than a unit: `kW P_loss`, `P_kW_rotor`.
- A single letter behind "_" is a unit as it is written: `T_K`, not `T_f`. Elsewhere it is one only
  if it changes nothing: `Housing C`. `Temp K`, `Winding F` and `P_MW` (in German the mean value),
  or `losses at 10 kW`, may be read in two ways and are a question.
- At the end also what is a unit of another quantity and can be nothing else: an error.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache

from ..record.channels import CHANNEL, TIME_NAMES
from ..record.header import EFFECTIVE, MEANS, STATISTICS, plain, read_heading, unit_of_cell
from ..record.table import Column
from ..record.units import (
    BRACKETED_ONLY,
    MADE_UP,
    QUANTITIES,
    REFUSED,
    find_unit,
    quantities_of,
    refusal,
)
from .likely_names import likely_channels

SHORTEST_WORD = 2
"""Up to this length a label is a symbol, and case matters: t is a time, T a temperature."""

PARTS = re.compile(r"[^\s_\-.:|=,;]+")
CAPITAL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
NUM_PARTS = 6
"""So many parts a unit may have: "revolutions per minute" has three."""

NAME_WORDS = frozenset(
    ("min", "mins", "min.", "sec", "secs", "sec.", "sek", "us", "ns", "ms", "hr", "hrs", "Std",
     "Std.", "ora", "ore", "Cel", "oC", "oF", "C", "Grad", "grad C", "gradi", "deg", "amp", "amps",
     "A_dc", "Adc", "V_dc", "Vdc", "Arms", "A_rms", "Aeff", "A_eff", "Apk", "A_pk", "App", "A_pp",
     "bool", "pu", "pct", "MW", "volt", "kpm", "N_m", "PS", "CV", "var", "mps", "days", "degrees",
     "tours", "giri", "uA", "V-dc", "V.dc", "A-dc", "A.dc", "ADC", "AAC",
     "VAC", "-", "1")
)  # fmt: skip
"""Spellings that are also parts of names: a minimum, a stator voltage, the second winding."""

DOUBTFUL = {
    "MW": "MW may be megawatts or, in German, the mean value",
    "uA": "uA may be microamperes or the phase u in amperes",
}

DAYS = re.compile(r"(?:^|[\s_\-.:|=,;/(\[{<])d(?=$|[\s_\-.:|=,;/)\]}>])")
"""A d that stands alone in the name of a time: a question, unless the name is t_d."""

COUNTED = "belong to the number before it"

PREFIXED = {"power": "W", "voltage": "V", "torque": "Nm", "phase current": "A", "dq current": "A",
            "direct current": "A"}  # fmt: skip
"""What a prefix of the SI may stand before."""


@dataclass(frozen=True)
class NamedUnit:
    """A unit that stands in a label without a mark."""

    unit: str  # Its text.
    stem: str  # The label without it and what stands behind it.
    behind: tuple[str, ...] = ()  # Words of statistics and numbers behind it.
    is_sure: bool = False  # It can be nothing else than a unit.
    doubt: str = ""  # Why it may be none, or empty.


@lru_cache(maxsize=16384)
def named_unit(label: str, quantity: str) -> NamedUnit | None:
    """Return the unit that a label without its marked units names for a quantity, or None.

    It may also be one that is not accepted, which then is to be refused.
    """
    text = plain(label)
    whole = unit_of_cell(text)
    if whole and (find_unit(whole, quantity) or is_sure(whole)):
        return NamedUnit(whole, "", is_sure=is_sure(whole), doubt=DOUBTFUL.get(whole, ""))
    if quantity == "time" and DAYS.search(text) and len(text) > len("t_d"):
        return NamedUnit("d", text, doubt="d may be days or part of the name")
    parts = [found.span() for found in PARTS.finditer(text)][-4 * NUM_PARTS :]
    rests = list(_rests(text, parts))
    for rest, behind in rests:
        for start, stop in _tails(text, rest):
            found = _at_end(text, start, stop, quantity)
            if found is not None:
                return NamedUnit(*found[:2], behind, *found[2:])
    if inside := _inside(text, parts, quantity):
        return inside
    for rest, behind in rests:
        for start, stop in _tails(text, rest):
            word = text[start:stop]
            if start and is_sure(word) and quantities_of(word):
                if _after_number(text, start, word):
                    return None
                return NamedUnit(word, text, behind, is_sure=True)
    return None


def rival_unit(label: str, quantity: str) -> str | None:
    """Return the unit that a label seems to name, where another statement is held against it.

    Also one that may be part of the name, such as MW; but no single letter, no unit of a number in
    the name ("losses at 10 kW") no "amp", which is as often an amplitude, and no "uA", which may be
    the phase u.
    """
    named = named_unit(label, quantity)
    if named is None or COUNTED in named.doubt or named.unit.casefold() in ("amp", "ua"):
        return None
    is_short = len(named.unit) < 2
    return None if is_short or not find_unit(named.unit, quantity) else named.unit


def _inside(text: str, parts: list[tuple[int, int]], quantity: str) -> NamedUnit | None:
    """Return the unit at the beginning or in the middle of a label."""
    doubtful = None
    for first, (start, _) in enumerate(parts):
        for _, stop in reversed(parts[first : first + NUM_PARTS]):
            word = text[start:stop]
            unit = None if word in BRACKETED_ONLY else find_unit(word, quantity)
            if unit is None:
                continue
            stem = text[stop:].lstrip(" _-.:|=,;") if start == 0 else text
            if is_sure(word):
                return NamedUnit(word, stem, is_sure=True, doubt=_after_number(text, start, word))
            changes = (unit.factor, unit.offset) != (1.0, 0.0)
            if changes and doubtful is None and (start == 0 or len(word) > 1):
                doubt = f"{word} may be a unit or part of the name"
                doubtful = NamedUnit(word, text, doubt=doubt)
    return doubtful


def speaks_of(label: str, quantity: str = "", unit: str | None = None) -> dict[str, int]:
    """Return the channels that a label speaks of, as `likely_channels`, its unit left off.

    Where nothing states the unit it is that of the quantity which the label names.
    """
    named = named_unit(label, quantity) if quantity else None
    is_unit = named is not None and find_unit(named.unit, quantity)
    sure = named.unit if named and is_unit and named.is_sure and not named.doubt else None
    return likely_channels(words_in(label, quantity), unit or sure)


def words_in(label: str, quantity: str = "") -> str:
    """Return a label without the unit of a quantity that it names, with all that is no unit."""
    named = named_unit(label, quantity) if quantity else None
    if named is None or not find_unit(named.unit, quantity):
        return label
    return " ".join((named.stem, *named.behind)) if named.stem else label


TIMES = frozenset((*TIME_NAMES.entries, "time", "time_s"))
"""Names of the time, in lower case."""


def names_time(heading: str) -> bool:
    """Return whether a heading, with or without a unit, is a name of the time."""
    return without_sure_unit(read_heading(heading).label).casefold() in TIMES


def without_sure_unit(label: str) -> str:
    """Return a label without a unit at its end that can be nothing else, for any quantity."""
    text = plain(label)
    parts = [found.span() for found in PARTS.finditer(text)][-4 * NUM_PARTS :]
    for rest, _ in _rests(text, parts):
        for start, _ in rest[-NUM_PARTS:]:
            if start and is_sure(text[start : rest[-1][1]]):
                return text[:start].rstrip(" _-.:|=,;")
    return text


def is_sure(text: str) -> bool:
    """Return whether a text can be nothing else than a unit, wherever it stands in a name."""
    return "".join(text.split()) in _sure()


@lru_cache(maxsize=1)
def _sure() -> frozenset[str]:
    spellings = {
        "".join(spelling.split())
        for units in QUANTITIES.values()
        for unit in units
        for spelling in (unit.symbol, *unit.spellings)
    }
    spellings |= {text.lower() for text in spellings if len(text) > 4 and text.isalpha()}
    spellings |= {text.capitalize() for text in spellings if len(text) > 4 and text.isalpha()}
    refused = {"".join(unit.split()) for units in REFUSED.values() for unit in units}
    known = {text for text in spellings | refused if len(text) > 1}
    return frozenset(
        text
        for text in known - NAME_WORDS - {"".join(word.split()) for word in NAME_WORDS}
        if any(sign.isalpha() for sign in text)
    )


def _rests(
    text: str, parts: list[tuple[int, int]]
) -> Iterator[tuple[list[tuple[int, int]], tuple[str, ...]]]:
    """Yield the parts, then fewer of them as statistics and numbers at the end are left off."""
    behind: tuple[str, ...] = ()
    while parts:
        yield parts, behind
        word = text[slice(*parts[-1])].strip("()[]").casefold()
        if (word not in STATISTICS and not word.isdigit()) or len(behind) >= 3:
            return
        parts, behind = parts[:-1], (word, *behind)


def _tails(text: str, parts: list[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Yield where units may begin and end, the longest first."""
    stop = parts[-1][1]
    starts = [start for start, _ in parts[-NUM_PARTS:]]
    slash = text.find("/", parts[-1][0], stop - 2) + 1
    starts += [slash] if slash else []
    glued = range(max(parts[-1][0] + 1, stop - 4), stop - 1)
    starts += [start for start in glued if text[start:stop] in GLUED]
    starts += [found.start() for found in CAPITAL.finditer(text, parts[-1][0], stop)]
    for start in starts:
        if start:
            yield start, stop


GLUED = frozenset(
    ("kW", "mW", "mA", "kA", "mV", "kV", "mNm", "kNm", "degC", "degF", "rpm", "°C", "°F")
)
"""Units that are told from the letters before them by their case, as in "PlosskW"."""


def _at_end(text: str, start: int, stop: int, quantity: str) -> tuple[str, str, bool, str] | None:
    """Return unit, stem, whether it is sure and any doubt, if a tail is a unit of the quantity."""
    word = text[start:stop]
    before = text[start - 1]
    is_part = not before.isalnum()
    stem = text[:start].rstrip(" _-.:|=,;") if is_part else text[:start]
    if word in BRACKETED_ONLY:
        return None
    unit = find_unit(word, quantity)
    sure = is_part and is_sure(word)
    if unit is None:
        is_foreign = is_part and len(word) > 1 and _is_foreign(word, quantity)
        return (word, stem, sure, "") if is_foreign else None
    changes = (unit.factor, unit.offset) != (1.0, 0.0)
    doubt = ""
    if changes:
        doubt = DOUBTFUL.get(word, "") or _after_number(text, start, word)
        is_exact = unit.symbol == word or word in unit.spellings
        if len(word) == 1 and (before != "_" or not is_exact):
            doubt = f"{word} may be a unit or part of the name"
    return word, stem, sure, doubt


def _is_foreign(word: str, quantity: str) -> bool:
    """Return whether a word is a unit that exists and is not accepted for a quantity."""
    if refusal(word, quantity):
        return True
    symbols = {unit.symbol.casefold() for unit in QUANTITIES[quantity]}
    base = PREFIXED.get(quantity)
    is_prefixed = base is not None and word.endswith(base) and MADE_UP.fullmatch(word) is not None
    return word.casefold() in symbols or is_prefixed


def _after_number(text: str, start: int, word: str) -> str:
    """Return the doubt about a unit behind a number, as in "losses at 10 kW"."""
    before = PARTS.findall(text[max(0, start - 20) : start])
    return f"{word} may be the unit or {COUNTED}" if (before and before[-1].isdigit()) else ""


def columns_of(label: str, channel: str, pool: Iterable[Column]) -> list[Column]:
    """Return the columns of a label, as written or else without regard to case.

    Columns of which nothing but a unit of the channel's quantity has to be left off come before
    those that are also called a mean.
    """
    folded = label.casefold()
    near = [column for column in pool if folded in column.label.casefold()]
    for with_mean in (False, True):
        forms = [(column, _forms(column.label, channel, with_mean)) for column in near]
        exact = [column for column, names in forms if label in names]
        if exact or len(label) <= SHORTEST_WORD:
            if exact:
                return exact
            continue
        found = [column for column, names in forms if folded in (name.casefold() for name in names)]
        if found:
            return found
    return []


def _forms(label: str, channel: str, with_mean: bool) -> tuple[str, ...]:
    """Return a label with and without its unit, and on wish without "mean" behind it."""
    known = CHANNEL.get(channel)
    if known is None:
        return (label,)
    forms = [label]
    plain_words = MEANS | (EFFECTIVE if known.quantity == "phase current" else frozenset())
    named = named_unit(label, known.quantity)
    if named and named.stem and all(word in plain_words for word in named.behind):
        is_letter = len(named.unit) == 1 and f"_{named.unit}" not in label
        if not is_letter and (with_mean or not named.behind):
            forms.append(named.stem)
    if with_mean:
        for form in tuple(forms):
            parts = [found.span() for found in PARTS.finditer(form)]
            if len(parts) > 1 and form[slice(*parts[-1])].strip("()").casefold() in plain_words:
                forms.append(form[: parts[-1][0]].rstrip(" _-.:|=,;("))
    return tuple(forms)
