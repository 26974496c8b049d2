"""The phase resistance as the head of a file or its scalars state it, for a person to confirm.

Heads are written by hand: `Rs: 0.0062 ohm`, `Phasenwiderstand R20 = 6,2 mΩ`. A resistance between
terminals, of the insulation or of a shunt is none of the phase.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from .bench.free_columns import flat
from .bench.survey import Survey
from .io.printable import printable

NUMBER = r"[+-]?[0-9]{1,6}(?:[.,][0-9]+)?(?:[eE][+-]?[0-9]{1,2})?(?![\w.,]*[0-9])"
OHM = r"(?P<{0}>(?-i:[mMµμuk]?)(?:ohms?|[Ω\u2126])(?![a-z]))"
DEGREES = r"(?:°\s?C|deg\s?C|℃|C\b)"

SYMBOL = (
    r"R_?s(?:0|_?20|_?25)?|R_?ph(?:ase)?(?:_?20|_?25)?|R_?str(?:ang)?(?:_?20|_?25)?|R_?(?:20|25)"
)
WORDS = (
    r"phase resistance|resistance per phase|stator resistance|phasenwiderstand|strangwiderstand"
    r"|statorwiderstand|st[äa]nderwiderstand|resistenza (?:di|per) fase"
    r"|resistenza (?:di statore|statorica)|r[ée]sistance (?:de|par) phase"
    r"|r[ée]sistance statorique|resistencia de fase"
)
AT = rf"(?:bei|at|a|à|@)\s*{NUMBER}\s*{DEGREES}"
STATED = re.compile(
    rf"(?<![\w.])(?P<name>(?:(?:{WORDS})\s*)?(?:{SYMBOL})|{WORDS})(?!\w)"
    rf"(?P<between>(?:\s*(?:\([^()]*\)|\[[^\[\]]*\]|{AT}))*)"
    rf"[\s:=;,|]*(?P<number>{NUMBER})[\s;,|]*(?:{OHM.format('unit')})?",
    re.IGNORECASE,
)
"""Name, what stands between it and the number in brackets or as "at 20 °C", number and unit."""

OTHER = re.compile(
    r"terminal|klemme|line.?to.?line|line.?line|verkettet|concatenat|insulat|isol|shunt|between"
    r"|zwischen|morsett|bornes",
    re.IGNORECASE,
)
IN_BRACKET = re.compile(OHM.format("unit"), re.IGNORECASE)
AT_DEGREES = re.compile(rf"({NUMBER})\s*{DEGREES}", re.IGNORECASE)
BEHIND = re.compile(rf"\s*(?:bei|at|a|à|@|\()\s*({NUMBER})\s*{DEGREES}", re.IGNORECASE)
IN_NAME = re.compile(r"(20|25)$")
REFERENCE = re.compile(
    r"(?<![\w.])(?:Ts|T_?ref|T_?rif|reference temp(?:erature)?|Bezugstemperatur"
    rf"|Referenztemperatur|temperatura di riferimento)[\s:=;,|]*({NUMBER})[\s;,|]*{DEGREES}",
    re.IGNORECASE,
)
"""The temperature in a line of its own; `Ts` is that of `Rs` on the worksheet of the thesis."""

SCALAR = re.compile(rf"{SYMBOL}|phase_resistance(?:_ohm)?", re.IGNORECASE)
SCALAR_REFERENCE = re.compile(r"T_?ref|T_?rif|reference_temperature(?:_degC)?", re.IGNORECASE)

FACTORS = {"m": 1e-3, "µ": 1e-6, "μ": 1e-6, "u": 1e-6, "k": 1e3, "M": 1e6}
LEAST_OHM, MOST_OHM = 1e-6, 1e3
"""Phases of the largest generators and of the smallest motors [Ω]."""

COLDEST, HOTTEST = -60.0, 250.0
"""Temperatures at which a resistance may have been measured [°C]."""

Stated = tuple[float, str]
"""A value and where it stands."""


def stated_resistance(surveys: Sequence[Survey]) -> dict[str, dict[float, str]]:
    """Return values of `[winding]` by their key, with where each stands; none without a resistance.

    Args:
        surveys: What the files hold.
    """
    found: dict[str, dict[float, str]] = {
        "phase_resistance_ohm": {},
        "reference_temperature_degC": {},
    }
    ohms, degrees = found.values()
    for one in surveys:
        for (value, where), temperature in (*_in_head(one.preamble), *_in_scalars(one)):
            ohms.setdefault(value, where)
            if temperature is not None:
                degrees.setdefault(temperature, where)
    if not ohms:
        return {}
    for one in surveys:
        for value, where in _references(one):
            degrees.setdefault(value, where)
    return found


def stated_ohms(surveys: Sequence[Survey]) -> list[float]:
    """Return the phase resistances that the tests state [Ω]."""
    return list(stated_resistance(surveys).get("phase_resistance_ohm", ()))


def _in_head(lines: Sequence[str]) -> Iterator[tuple[Stated, float | None]]:
    """Yield each resistance [Ω] and its temperature [°C] where the line has one."""
    for line in lines:
        if OTHER.search(line):
            continue
        for found in STATED.finditer(line):
            in_bracket = IN_BRACKET.search(found["between"])
            unit = found["unit"] or (in_bracket["unit"] if in_bracket else "")
            # to 12 digits: 6.2 mΩ are 0.0062 Ω, and not the double next to it
            value = float(f"{_number(found['number']) * FACTORS.get(unit[:1], 1.0):.12g}")
            doubt = "" if unit else ", no unit given"
            if LEAST_OHM <= value <= MOST_OHM:
                yield (value, f"{_quoted(line)}{doubt}"), _temperature(found, line)


def _temperature(found: re.Match[str], line: str) -> float | None:
    inside = AT_DEGREES.search(found["between"])
    stated = inside or BEHIND.match(line, found.end()) or IN_NAME.search(found["name"])
    return next(_temperatures([stated[1]] if stated else []), None)


def _in_scalars(one: Survey) -> Iterator[tuple[Stated, float | None]]:
    for name, value in (one.constants or {}).items():
        if SCALAR.fullmatch(name) and LEAST_OHM <= value <= MOST_OHM:
            where = f"scalar '{printable(flat(name))}' of {_file(one)}, no unit given"
            yield (value, where), None


def _references(one: Survey) -> Iterator[Stated]:
    """Yield each reference temperature [°C] that stands apart from its resistance."""
    for line in one.preamble:
        for value in _temperatures(REFERENCE.findall(line)):
            yield value, _quoted(line)
    for name, value in (one.constants or {}).items():
        if SCALAR_REFERENCE.fullmatch(name) and COLDEST < value < HOTTEST:
            yield value, f"scalar '{printable(flat(name))}' of {_file(one)}"


def _temperatures(texts: Sequence[str]) -> Iterator[float]:
    values = (_number(text) for text in texts)
    return (value for value in values if COLDEST < value < HOTTEST)


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def _quoted(line: str) -> str:
    return f"the line '{printable(flat(line))[:80]}'"


def _file(one: Survey) -> str:
    return printable(flat(Path(one.path).name))
