"""Units as benches write them, and their conversion to the canonical unit of a quantity.

This is the only place where heatrun converts units. The table (`heatrun.bench.channels.unit_table`)
is our own and no general library such as pint stands behind it. What is asked of a unit here is
decided by the quantity of the channel, and mostly against the SI: C is degrees Celsius and not
coulomb, F Fahrenheit and not farad, a plain A of a phase is rms and one of the d axis an amplitude,
U/min and tr/min are rpm, Hz of a speed is refused. A library would need every one of these entries
as an exception in front of it and would answer for what has none, where a question is wanted; it
would add an import to every reading, to multiply by some forty factors.
"""

from __future__ import annotations

import difflib
import re
import unicodedata
from functools import cache, lru_cache

import numpy as np

from ...errors import InputError
from .unit_table import BRACKETED_ONLY, EXACT_ONLY, QUANTITIES, REFUSED, Unit

LONGEST_UNIT = 40
"""Characters; a longer text is none."""

LONGEST_SYMBOL = 4
"""Characters of a symbol in which case may matter; longer spellings are words."""

MISSPELLING = 0.75
"""Likeness from which a word is a misspelled unit: "Celcius" is, "outlet" is not."""

SHORTEST_MISSPELLING = 4
"""Letters; below it, anything resembles some unit."""

MADE_UP = re.compile(
    r"(?:µ|u|n|m|k|M|G)(?:W|V|A|VA|var|Wh|J|N|Nm|Hz|Pa|bar|ohm|Ohm|Ω|K|min|L)"
    r"|\S{1,7}/(?:s|sec|min|h|hr|m|m2|m3|kg|K)"
)
"""Words that are units by their form: a prefix of the SI and a unit, or something per time."""

FOREIGN = frozenset(
    ("Wh", "VA", "var", "bar", "Pa", "hPa", "psi", "kg", "mm", "cm", "ohm", "Ω", "Ohm", "dB", "rad",
     "lbf", "cNm", "dNm", "µm")
)  # fmt: skip
"""Units of quantities that are no channel of heatrun, or in none of its tables."""


DEGREES: dict[int, str] = dict.fromkeys(map(ord, "º˚ﾟ゜\u309a∘◦⁰ᵒ"), "°") | {
    ord("℃"): "°C",
    ord("℉"): "°F",
}
"""Signs that stand for the degree of a temperature, to the plain one."""


@lru_cache(maxsize=4096)
def _key(spelling: str) -> str:
    """Return a spelling without what carries no meaning: blanks, signs of degree and product."""
    text = spelling.strip().translate(DEGREES)  # NFKC would turn some of them into letters
    text = unicodedata.normalize("NFKC", text)
    return re.sub(r"[\s·∙⋅*]+", "", text.replace("−", "-").replace("μ", "µ"))


@cache
def _spellings(quantity: str) -> tuple[dict[str, Unit], dict[str, Unit]]:
    """Return the units of a quantity by exact key, and by lower-case key where unambiguous."""
    exact: dict[str, Unit] = {}
    for unit in QUANTITIES[quantity]:
        for spelling in (unit.symbol, *unit.spellings):
            exact.setdefault(_key(spelling), unit)
    folded: dict[str, set[Unit]] = {}
    for key, unit in exact.items():
        if key in EXACT_ONLY:
            continue
        folded.setdefault(key.casefold(), set()).add(unit)
    return exact, {key: units.pop() for key, units in folded.items() if len(units) == 1}


@cache
def _refused(quantity: str) -> dict[str, str]:
    return {_key(unit).casefold(): why for unit, why in REFUSED.get(quantity, {}).items()}


@lru_cache(maxsize=4096)
def find_unit(spelling: str, quantity: str) -> Unit | None:
    """Return the unit of a quantity that a spelling stands for, or None.

    Case is only ignored where it decides nothing: mW and MW stay apart, a prefix M is never read
    as m, whose unit it exceeds by nine orders, and short symbols are of one case but for their
    first letter ("KW", "Rpm", not "nM").

    Args:
        spelling: Unit as the file writes it, such as `"°C"`.
        quantity: Key of `QUANTITIES`.
    """
    if len(spelling) > LONGEST_UNIT:
        return None
    exact, folded = _spellings(quantity)
    key = _key(spelling)
    unit = exact.get(key) or folded.get(key.casefold())
    if unit is None or key in exact:
        return unit
    if len(key) <= LONGEST_SYMBOL:
        meant = next(known for known in exact if known.casefold() == key.casefold())
        is_other_case = key in (key.lower(), key.upper()) or key[1:] == meant[1:]
        is_mega = key[:1] == "M" and meant[:1] == "m" and meant[1:2].isupper()
        return unit if is_other_case and not is_mega else None
    return unit


def quantities_of(spelling: str) -> tuple[str, ...]:
    """Return the quantities that know a spelling, in the order of `QUANTITIES`."""
    return tuple(name for name in QUANTITIES if find_unit(spelling, name) is not None)


def refusal(spelling: str, quantity: str) -> str | None:
    """Return why a unit that exists does not determine a quantity, or None.

    Args:
        spelling: Unit as the file writes it.
        quantity: Key of `QUANTITIES`.
    """
    known = len(spelling) <= LONGEST_UNIT
    return _refused(quantity).get(_key(spelling).casefold()) if known else None


@lru_cache(maxsize=4096)
def is_unit(spelling: str) -> bool:
    """Return whether a spelling is a unit of any quantity, accepted or refused with a reason.

    Not so what is one in square brackets alone.
    """
    if spelling.strip() in BRACKETED_ONLY:
        return False
    return bool(quantities_of(spelling)) or any(refusal(spelling, name) for name in REFUSED)


@lru_cache(maxsize=4096)
def looks_like_unit(text: str) -> bool:
    """Return whether a text is a unit, known or not, or a misspelled one.

    Args:
        text: Such as `"kVA"`, `"gal/min"` or `"Celcius"`.
    """
    if not 0 < len(text) <= LONGEST_UNIT:
        return False
    key = _key(text)
    if is_unit(text) or key in FOREIGN or MADE_UP.fullmatch(key):
        return True
    is_word = len(key) >= SHORTEST_MISSPELLING and key.strip("°.").isalpha()
    return is_word and closest_unit(text, likeness=MISSPELLING) is not None


def closest_unit(
    spelling: str, quantity: str | None = None, *, likeness: float = 0.6
) -> str | None:
    """Return the known spelling nearest to one that is not known, or None if none is near.

    Args:
        spelling: Unit as the file writes it.
        quantity: Key of `QUANTITIES`, or None for all of them.
        likeness: Least similarity of the two spellings, from 0 to 1 [1].
    """
    if len(spelling) > LONGEST_UNIT:
        return None
    known: dict[str, str] = {}
    for name in QUANTITIES if quantity is None else (quantity,):
        known |= {key: first for key, first in _candidates(name).items() if key not in known}
    near = difflib.get_close_matches(_key(spelling).casefold(), known, n=1, cutoff=likeness)
    return known[near[0]] if near else None


@cache
def _candidates(quantity: str) -> dict[str, str]:
    """Return the spellings of a quantity by their lower-case key."""
    known: dict[str, str] = {}
    for unit in QUANTITIES[quantity]:
        for candidate in (unit.symbol, *unit.spellings):
            known.setdefault(_key(candidate).casefold(), candidate)
    return known


def require_unit(spelling: str, quantity: str, *, where: str, remedy: str = "") -> Unit:
    """Return the unit that a spelling stands for.

    Args:
        spelling: Unit as the file writes it.
        quantity: Key of `QUANTITIES`.
        where: File and column, for the message.
        remedy: What to do, put behind the accepted units; by default how to write a unit.

    Raises:
        InputError: If the unit is refused, belongs to another quantity or is not known; with the
            accepted units and the closest one.
    """
    unit = find_unit(spelling, quantity)
    if unit is not None:
        return unit
    symbols = [known.symbol for known in QUANTITIES[quantity]]
    others = quantities_of(spelling)
    shown = spelling if len(spelling) <= LONGEST_UNIT else f"{spelling[:LONGEST_UNIT]}…"
    if reason := refusal(spelling, quantity):
        problem = f"A {quantity} in {shown} is refused because {reason}."
    elif others:
        problem = f"Expected a unit of {quantity}, got {shown}, a unit of {others[0]}."
    else:
        near = closest_unit(spelling, quantity)
        # another first letter may be another prefix: watt is not what kWat means
        is_alike = near is not None and near[:1].casefold() == spelling[:1].casefold()
        meant = f" Did you mean {near}?" if is_alike else ""
        problem = f"The unit '{shown}' is not known for a {quantity}.{meant}"
    raise InputError(
        problem,
        where=where,
        remedy=f"Accepted are: {', '.join(symbols)}. "
        + (remedy or f"Write one behind the name: 'name [{symbols[0]}]'."),
    )


def to_canonical(values: np.ndarray, unit: Unit) -> np.ndarray:
    """Return values converted to the canonical unit of their quantity, shape (time,).

    Args:
        values: Values in `unit`, shape (time,).
        unit: A unit of `QUANTITIES`.
    """
    if unit.factor == 1.0 and unit.offset == 0.0:
        return values
    # The offset of degF is a factor's multiple: (F - 32) is exact where F*5/9 - 160/9 is not.
    return (values + unit.offset / unit.factor) * unit.factor
