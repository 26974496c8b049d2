"""Column names as benches write them: what is the name, what is the unit."""

from __future__ import annotations

import re

from .units import closest_unit, is_unit

SHORTEST_MISSPELLING = 4
"""Letters; below it, anything resembles some unit."""

MISSPELLING = 0.75
"""Likeness from which a bracketed word is a misspelled unit: "Celcius" is, "outlet" is not."""

SQUARE = re.compile(r"^(?P<label>.*?)\s*\[(?P<unit>[^\[\]]*)\]$")
ROUND = re.compile(r"^(?P<label>.*?)\s*[({](?P<unit>[^{}]*)[)}]$")
SPACED_SLASH = re.compile(r"^(?P<label>.*?\S)\s+/\s+(?P<unit>.+)$")  # DIN: "P / W"
SLASH = re.compile(r"^(?P<label>.*?\S)\s*/\s*(?P<unit>.+)$")  # "n/min-1"
RATIO = re.compile(r"^(?P<label>.*?\S)\s+(?P<unit>[^\s/]+/[^\s/]+)$")  # "speed rad/s"
WORD = re.compile(r"^(?P<label>.*?\S)(?:,\s*|\s+in\s+)(?P<unit>\S.*)$")  # "Speed in rpm"


def split_name(name: str) -> tuple[str, str | None]:
    """Return the label and the unit text of a column name.

    Square brackets always hold a unit, even one that is not known. Round brackets hold one if
    it is known or nearly so (a misspelled unit must not pass as part of a name); behind a slash,
    a comma or "in" it must be known.

    Args:
        name: Column name as it stands in the file, such as `"Winding Temp (°C)"`.

    Example:
        >>> split_name("Winding Temp (°C)")
        ('Winding Temp', '°C')
        >>> split_name("Temperature (stator)")
        ('Temperature (stator)', None)
    """
    name = name.strip()
    if is_unit(name):  # "km/h" is no label with the unit h
        return name, None
    square = SQUARE.match(name)
    if square and square["label"]:
        return square["label"], square["unit"].strip() or None
    bracket = ROUND.match(name)
    if bracket and bracket["label"] and _is_nearly_unit(bracket["unit"]):
        return bracket["label"], bracket["unit"].strip()
    if is_unit(name):  # "km/h" is no kilometre in hours
        return name, None
    for pattern in (SPACED_SLASH, WORD, RATIO, SLASH):  # a slash may stand within the unit
        found = pattern.match(name)
        if found and is_unit(found["unit"]):
            return found["label"], found["unit"].strip()
    return name, None


def unit_of_cell(cell: str) -> str | None:
    """Return the unit text of a cell in a row of units, or None if it holds none.

    Args:
        cell: Such as `"[degC]"`, `"(s)"` or `"rpm"`.
    """
    text = cell.strip()
    inner = text[1:-1].strip() if text[:1] + text[-1:] in ("[]", "()", "{}") else text
    return inner if inner and (is_unit(inner) or text[:1] == "[") else None


def _is_nearly_unit(text: str) -> bool:
    """Return whether a bracket holds a unit or a misspelled one, and no "(1)" or "(outlet)"."""
    if not any(sign.isalpha() or sign in "%°" for sign in text):
        return False
    is_word = len(text.strip()) >= SHORTEST_MISSPELLING
    return is_unit(text) or (is_word and closest_unit(text, likeness=MISSPELLING) is not None)
