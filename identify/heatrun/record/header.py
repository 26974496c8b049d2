"""Column names as benches write them: what is the name, what is the unit.

One tokenizer reads names, cells of a row of units, comment lines and the right-hand sides of
`[columns]`. A unit that is marked as one is told from the text alone:

    cell    = label with any of these in it
    bracket = "[" unit "]"                    always a unit, known or not, wherever it stands
            | "(" unit ")" | "{" … | "<" …    if it is known, nearly so, made like one, or behind
                                              "in" or "unit:"; else part of the label
    mark    = label ("/" | "," | " in " | ":" | "|" | "=" | " - ") unit
            | label blank unit                if the unit holds "/", "°", "%" or a power
    unit    = a spelling of `units`, with words of statistics around it ("kW, mean"),
              or a format of clock times ("hh:mm"), handed on as it stands

A mark counts with no bracket alone, the leftmost one that leaves a unit. Behind " in " and " / "
also what is not known counts, unless it is the name of a place ("temperature in stator"); mapped
to a channel, it is an error. A single letter behind ":", "|" or " - ", and an F behind "=", is left
in the label.

A unit that is not marked ("P_kW", "P_loss kW avg") stays in the label. It is read by
`heatrun.readers.labels`, once it is known which quantity the column is to be: `T_C` is a
temperature in degC, `I_C` the current of the third phase.

Blanks that do not break, full-width signs and dashes of all lengths count as the plain ones. Time
and memory grow with the length of the cell alone, and a cell is at most `LONGEST_NAME` long.
"""

import re
from dataclasses import dataclass
from functools import lru_cache

from ..errors import InputError
from .units import DEGREES, LONGEST_UNIT, find_unit, is_unit, looks_like_unit

MEANS = frozenset(
    ("mean", "avg", "average", "avrg", "ave", "mittel", "mittelwert", "mw", "media", "medio",
     "moyenne", "moy")
)  # fmt: skip
"""A channel averaged is the channel: a name that ends in one of these is known without it."""

EFFECTIVE = frozenset(("rms", "eff", "effective", "effektiv"))
"""The same for a phase current, which is taken as rms."""

PEAKS = frozenset(("peak", "pk", "ampl", "amplitude", "crest", "scheitel", "spitze", "pp", "p-p"))

STATISTICS = (
    MEANS
    | EFFECTIVE
    | PEAKS
    | frozenset(
        ("min", "max", "minimum", "maximum", "median", "med", "std", "sd", "stdev", "filt",
         "filtered", "smooth", "smoothed", "raw", "act", "actual", "ist", "meas", "measured",
         "gemessen", "inst", "calc", "calculated", "corr", "corrected", "total", "sum", "abs",
         "value", "val", "signal", "sig")
    )
)  # fmt: skip
"""What may stand behind the unit of a name."""

PLACES = frozenset(
    (
        "air", "ambient", "aussen", "außen", "back", "bearing", "bearings", "between", "body",
        "bottom", "box", "cabinet", "cable", "case", "center", "centre", "chamber", "channel",
        "circuit", "coil", "control", "controller", "coolant", "cooler", "cooling", "core", "de",
        "drive", "electronics", "end", "engine", "exit", "flow", "fluid", "front", "fuel", "gap",
        "gear", "gearbox", "gehäuse", "head", "hot", "house", "housing", "hub", "in", "inlet",
        "inner", "inside", "inverter", "iron", "jacket", "lab", "layer", "left", "line", "link",
        "load", "luft", "machine", "magnet", "magnets", "mid", "middle", "mode", "module",
        "motor", "nde", "neutral", "nut", "oel", "oil", "out", "outer", "outlet", "outside",
        "phase", "pipe", "pipes", "plate", "point", "position", "primary", "pump", "rear",
        "right", "room", "rotor", "secondary", "sensor", "set", "shaft", "side", "sink", "slot",
        "spot", "state", "stationary", "stator", "steel", "supply", "surface", "system", "tank",
        "teeth", "temp", "temperature", "test", "the", "tooth", "top", "turn", "wall", "wasser",
        "water", "wicklung", "winding", "windings", "wire", "yoke", "zone", "öl",
    )
)  # fmt: skip
"""Where something was measured: "temperature in stator" names no unit."""


def is_name(text: str) -> bool:
    """Return whether a text, as `"slot 3"`, is made of words of a name, so that it is no unit."""
    words = text.casefold().replace("_", " ").replace("-", " ").replace("/", " ").split()
    return any(word in PLACES or word in STATISTICS or word.isdigit() for word in words)


LONGEST_NAME = 1000
"""Characters; names of a bench are below 100, paths of a model below 300."""

BRACKETS = {"]": "[", ")": "(", "}": "{", ">": "<"}

PLAIN: dict[int, int | str | None] = {
    **{code: code - 0xFEE0 for code in range(0xFF01, 0xFF5F)},  # full-width signs and letters
    **dict.fromkeys([*range(0x09, 0x0E), 0xA0, 0x1680, *range(0x2000, 0x200B)], " "),
    **dict.fromkeys([0x202F, 0x205F, 0x3000], " "),
    **dict.fromkeys([0xAD, 0x200B, 0x200C, 0x200D, 0x2060, 0xFEFF], None),  # of no width
    **dict.fromkeys([*range(0x2010, 0x2016), 0x2212], "-"),
    **dict.fromkeys(map(ord, "⁄∕"), "/"),
    **{ord(sign): "[" for sign in "【〔「"},
    **{ord(sign): "]" for sign in "】〕」"},
    **{ord(sign): "<" for sign in "⟨〈"},
    **{ord(sign): ">" for sign in "⟩〉"},
    **DEGREES,
}

CLOCK_FORMAT = re.compile(
    r"(?:[dD]{1,4}|[hH]{1,2}|[mM]{1,3}|min|[sS]{1,2}|sec|[yYjJ]{2,4}|[fF0]{1,9}|[tT]{2})"
    r"(?:(?:[:.,\-/ ]|[.,]?(?=[fF0]))"
    r"(?:[dD]{1,4}|[hH]{1,2}|[mM]{1,3}|min|[sS]{1,2}|sec|[yYjJ]{2,4}|[fF0]{1,9}|[tT]{2})){1,7}"
)
LEAD = re.compile(
    r"(?:in\s+|(?:in\s+)?(?:units?|einheit(?:en)?|unità|unités?)\s*[:=]?\s*)(?=\S)", re.I
)
MARK = re.compile(r"\s*,?\s+in\s+|\s*[/:|=,]\s*|\s+-\s+|[\s_.\-]+|(?=[°%])")
COUNT = re.compile(r"(?:^|[\s_x×*])(?:[0-9]{2,}|10\^?[0-9³]+)$")
STATISTIC_TAIL = re.compile(rf"[\s_,;.(\-]+(?:{'|'.join(sorted(STATISTICS))})\)?$", re.I)
COMPOUND = re.compile(r"[/°%^⁻]|-1")
COMMENT = re.compile(r"^(?:#+|%+(?=\s))\s*")
EDGES = " _-:|,/=."


@dataclass(frozen=True)
class Heading:
    """What a column name says."""

    label: str  # The name without its marked units.
    units: tuple[str, ...]  # The marked units in their order, mostly one or none.


def split_name(name: str, where: str = "") -> tuple[str, str | None]:
    """Return the label and the marked unit of a column name; see the grammar above.

    Raises:
        InputError: If the name is longer than `LONGEST_NAME`.

    Example:
        >>> split_name("Winding Temp (°C)")
        ('Winding Temp', '°C')
        >>> split_name("[kW] P_loss avg")
        ('P_loss avg', 'kW')
        >>> split_name("Temperature (stator)")
        ('Temperature (stator)', None)
    """
    heading = read_heading(name, where)
    return heading.label, heading.units[0] if heading.units else None


def read_heading(name: str, where: str = "") -> Heading:
    """Return all that a column name says; as `split_name`."""
    if len(name) > LONGEST_NAME:
        raise InputError(
            f"Expected a column name of at most {LONGEST_NAME} characters, got {len(name)}: "
            f"'{name[:40]}…'.",
            where=where,
            remedy="Give the column a shorter name.",
        )
    return _heading(name)


@lru_cache(maxsize=16384)
def _heading(name: str) -> Heading:
    text = plain(name)
    if is_unit(text):  # "km/h" is no label with the unit h
        return Heading(name.strip(), ())
    label, units = _bracketed(text)
    if not units:
        label, units = _marked(label)
    label = COMMENT.sub("", " ".join(label.split()))
    return Heading(label, units) if label.strip(EDGES) else Heading(text, ())


def plain(text: str) -> str:
    """Return a text with plain blanks, brackets and dashes, without blanks around it."""
    return text.translate(PLAIN).strip()


def unit_of_cell(cell: str) -> str | None:
    """Return the unit text of a cell in a row of units, such as `"in kW"`; None without one."""
    text = plain(cell)
    if not 0 < len(text) <= 2 * LONGEST_UNIT:
        return None
    is_square = text[0] == "[" and text[-1] == "]"
    inner = text[1:-1] if BRACKETS.get(text[-1]) == text[0] else text
    if is_unit(inner.strip()):
        return inner.strip()
    found = _unit_in_bracket(inner, is_square=is_square)
    return found if found and (is_square or is_unit(found) or is_clock_format(found)) else None


def is_clock_format(text: str) -> bool:
    """Return whether a text says how times of day are written, such as "hh:mm" or "d:hh:mm"."""
    return ":" in text and len(text) <= LONGEST_UNIT and bool(CLOCK_FORMAT.fullmatch(text))


def _bracketed(text: str) -> tuple[str, tuple[str, ...]]:
    """Return the label and the units that stand in brackets."""
    pieces, units, end = [], [], 0
    for start, stop in _pairs(text):
        is_square = text[start] == "["
        # so long a content is not even looked at: pairs may stand within each other
        if start < end or (not is_square and stop - start > 2 * LONGEST_UNIT):
            continue
        unit = _unit_in_bracket(text[start + 1 : stop - 1], is_square=is_square)
        if unit is None and not (is_square and not text[start + 1 : stop - 1].strip()):
            continue
        pieces.append(text[end:start])
        units += [unit] if unit else []
        end = stop
    label = " ".join((*(piece.rstrip(" /,:|=") for piece in pieces), text[end:].lstrip()))
    if text[end : end + 1] in ("_", "-", "."):  # "P[kW]_mean"
        label = "".join((*pieces, text[end:]))
    return label.replace(" )", ")").strip().rstrip("_-"), tuple(units)


def _pairs(text: str) -> list[tuple[int, int]]:
    """Return where brackets open and close again, outer ones first."""
    pairs: list[tuple[int, int]] = []
    stack: list[int] = []
    num_open = dict.fromkeys(BRACKETS.values(), 0)
    for position, sign in enumerate(text):
        if sign in num_open:
            stack.append(position)
            num_open[sign] += 1
        elif sign in BRACKETS and num_open[BRACKETS[sign]]:
            while stack:
                start = stack.pop()
                num_open[text[start]] -= 1
                if text[start] == BRACKETS[sign]:
                    pairs.append((start, position + 1))
                    break
    return sorted(pairs)


def _unit_in_bracket(content: str, *, is_square: bool) -> str | None:
    """Return the unit text of a bracket, None if it is part of the name."""
    text = content.strip()
    if is_clock_format(text):
        return text
    lead = LEAD.match(text)
    text = text[lead.end() :] if lead else text
    if not is_square and not _has_letter(text):
        return None
    if is_unit(text):
        return text
    kept = _without_statistics(text)
    if kept == "" or (kept and is_unit(kept)):
        return kept or None
    if is_square or (lead and not is_name(text)):
        return text or None
    return text if not is_name(text) and looks_like_unit(text) else None


def _without_statistics(text: str) -> str | None:
    """Return a unit without words of statistics around it, None if it cannot be told apart."""
    if len(text) > 2 * LONGEST_UNIT:
        return None
    words = [word for word in re.split(r"[\s,;]+", text) if word]
    without_mean = " ".join(word for word in words if word.casefold() not in MEANS)
    if is_unit(without_mean):
        return without_mean
    kept = [word for word in words if word.casefold() not in STATISTICS]
    if not kept and len(units := [word for word in words if is_unit(word)]) == 1 < len(words):
        return units[0]  # "min" and "MW" are both
    unit = " ".join(kept)
    dropped = {word.casefold() for word in words} & (PEAKS | EFFECTIVE)
    # of a current, these decide on a factor
    return None if kept and dropped and find_unit(unit, "phase current") else unit


def _marked(text: str) -> tuple[str, tuple[str, ...]]:
    """Return the label and the unit behind a mark; units that are known come first."""
    shortened = [text]
    while len(shortened) < 4:
        start = max(0, len(shortened[-1]) - LONGEST_UNIT)
        tail = STATISTIC_TAIL.search(shortened[-1], start)
        if tail is None:
            break
        shortened.append(shortened[-1][: tail.start()])
    for is_known in (True, False):
        for part in shortened:
            # a unit has at most LONGEST_UNIT characters, and a mark some more
            for mark in MARK.finditer(part, max(0, len(part) - 2 * LONGEST_UNIT)):
                label, unit = part[: mark.start()], part[mark.end() :]
                is_joint = not mark.group().strip(" _.-")
                if is_joint and COUNT.search(label, max(0, len(label) - 8)):
                    continue  # "1000 1/min"
                if label.strip(EDGES) and _is_behind(mark.group(), unit, is_known=is_known):
                    return label.rstrip(EDGES) + text[len(part) :], (unit,)
    return text, ()


def _is_behind(mark: str, text: str, *, is_known: bool) -> bool:
    """Return whether a text behind a mark is a unit."""
    if not _has_letter(text) or len(text) > LONGEST_UNIT:
        return False
    sign = mark.strip()
    if not sign.strip("_.-") and mark != " - ":
        is_sure = COMPOUND.search(text) and (is_unit(text) if is_known else looks_like_unit(text))
        return is_clock_format(text) or bool(is_sure and (is_known or " " not in text))
    if is_known:
        is_clear = sign in ("/", ",") or sign.endswith("in") or (sign == "=" and text != "F")
        is_single = not is_clear and len(text) == 1
        return is_unit(text) and not is_single
    if is_name(text):
        return False
    if sign.endswith("in") or mark == " / ":
        return len(text.split()) <= 3
    return len(text) > 1 and looks_like_unit(text)


def _has_letter(text: str) -> bool:
    return any(sign.isalpha() or sign in "%°℃℉" for sign in text)
