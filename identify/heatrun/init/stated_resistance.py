"""The resistance of a phase and its temperature, as the head or scalars of a file state them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from ..io.quantities import printable
from .free_columns import flat
from .survey import Survey

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


def stated_resistance(surveys: Sequence[Survey]) -> dict[str, dict[float, str]]:
    """Return values of `[winding]` by their key, with where each stands; none without a resistance.

    Heads are written by hand: `Rs: 0.0062 ohm`, `Phasenwiderstand R20 = 6,2 mΩ`. A resistance
    between terminals, of the insulation or of a shunt is none of the phase.
    """
    ohms: dict[float, str] = {}
    degrees: dict[float, str] = {}
    for one in surveys:
        for value, where, temperature in _resistances(one):
            ohms.setdefault(value, where)
            if temperature is not None:
                degrees.setdefault(temperature, where)
    for one in () if ohms else surveys:
        for column, evidence in one.under_direct_current:
            if evidence.cold:
                ohm, degC = (float(f"{value:.5g}") for value in evidence.cold)
                began = f"the start, '{flat(column.name)}' over the current"
                ohms.setdefault(ohm, began)
                degrees.setdefault(degC, "the start, if the winding was as cold as the room")
    if not ohms:
        return {}
    for one in surveys:
        for value, where in _references(one):
            degrees.setdefault(value, where)
    return {"phase_resistance_ohm": ohms, "reference_temperature_degC": degrees}


def found_resistance(surveys: Sequence[Survey]) -> dict[str, str]:
    """Return the resistance and its temperature where a file states both as `Rrif` and `Trif`."""
    for one in surveys:
        held = one.constants or {}
        if held.get("Rrif", 0.0) > 0.0 and COLDEST < held.get("Trif", HOTTEST) < HOTTEST:
            return {
                "phase_resistance_ohm": f"{held['Rrif'] / 3.0:.9g}  # Rrif/3 of the file",
                "reference_temperature_degC": f"{held['Trif']:.9g}  # Trif of the file",
            }
    return {}


def _resistances(one: Survey) -> Iterator[tuple[float, str, float | None]]:
    """Yield each resistance [Ω], where it stands, and its temperature [°C] if that line has one."""
    for line in one.preamble:
        for found in STATED.finditer(line) if not OTHER.search(line) else ():
            in_bracket = IN_BRACKET.search(found["between"])
            unit = found["unit"] or (in_bracket["unit"] if in_bracket else "")
            # to 12 digits: 6.2 mΩ are 0.0062 Ω, and not the double next to it
            value = float(f"{number_in(found['number']) * FACTORS.get(unit[:1], 1.0):.12g}")
            doubt = "" if unit else ", no unit given"
            if LEAST_OHM <= value <= MOST_OHM:
                yield value, f"{quoted(line)}{doubt}", _temperature(found, line)
    for value, where in _scalars(one, SCALAR):
        if LEAST_OHM <= value <= MOST_OHM:
            yield value, f"{where}, no unit given", None


def _temperature(found: re.Match[str], line: str) -> float | None:
    inside = AT_DEGREES.search(found["between"])
    stated = inside or BEHIND.match(line, found.end()) or IN_NAME.search(found["name"])
    return next(_temperatures([stated[1]] if stated else []), None)


def _references(one: Survey) -> Iterator[tuple[float, str]]:
    """Yield each reference temperature [°C] that stands apart from its resistance."""
    for line in one.preamble:
        for value in _temperatures(REFERENCE.findall(line)):
            yield value, quoted(line)
    for value, where in _scalars(one, SCALAR_REFERENCE):
        if COLDEST < value < HOTTEST:
            yield value, where


def _scalars(one: Survey, called: re.Pattern[str]) -> Iterator[tuple[float, str]]:
    for name, value in (one.constants or {}).items():
        if called.fullmatch(name):
            yield value, f"scalar '{printable(flat(name))}' of {one.file}"


def _temperatures(texts: Sequence[str]) -> Iterator[float]:
    values = (number_in(text) for text in texts)
    return (value for value in values if COLDEST < value < HOTTEST)


def number_in(text: str) -> float:
    """Return the number that a text is, with a decimal point or comma."""
    return float(text.replace(",", "."))


def quoted(line: str) -> str:
    """Return a line of a file, in words."""
    return f"the line '{printable(flat(line))[:80]}'"
