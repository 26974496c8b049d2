"""Units as benches write them, and their conversion to the canonical unit of a quantity.

This is the only place where heatrun converts units. The table is our own: about fifty spellings
are in use on benches, and what matters is what a general library cannot know: that a plain A of
a phase is taken as rms, and that Hz of a speed must be refused.
"""

from __future__ import annotations

import difflib
import math
import re
import unicodedata
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class Unit:
    """A unit of one quantity: `canonical = factor * value + offset`.

    Attributes:
        symbol: As it is printed.
        spellings: Other ways in which benches write it.
        factor: Canonical units per unit.
        offset: Added after the factor, in canonical units.
    """

    symbol: str
    spellings: tuple[str, ...] = ()
    factor: float = 1.0
    offset: float = 0.0


ROOT_2 = math.sqrt(2.0)
RMS_SPELLINGS = ("A_rms", "Arms", "A rms", "A (rms)", "A eff", "A_eff", "Aeff", "ampere rms")
PEAK_SPELLINGS = ("A_peak", "Apeak", "A peak", "A_pk", "Apk", "A pk", "A amplitude", "A_ampl", "Â")

QUANTITIES: dict[str, tuple[Unit, ...]] = {
    "time": (
        Unit("s", ("sec", "secs", "second", "seconds", "sek", "Sekunden")),
        Unit("ms", ("msec", "millisecond", "milliseconds"), 1e-3),
        Unit("us", ("µs", "usec", "microseconds"), 1e-6),
        Unit("ns", ("nanoseconds",), 1e-9),
        Unit("min", ("mins", "minute", "minutes"), 60.0),
        Unit("h", ("hr", "hrs", "hour", "hours"), 3600.0),
    ),
    "temperature": (
        Unit("degC", ("°C", "C", "deg C", "deg. C", "deg_C", "Celsius", "degree C", "degrees C",
                      "grad C", "Cel", "Â°C", "\ufffdC", "?C")),
        Unit("K", ("kelvin", "degK", "°K"), 1.0, -273.15),
        Unit("degF", ("°F", "F", "deg F", "deg_F", "Fahrenheit", "Â°F", "\ufffdF", "?F"),
             5.0 / 9.0, -160.0 / 9.0),
    ),
    "phase current": (
        Unit("A_rms", ("A", "amp", "amps", "ampere", *RMS_SPELLINGS)),
        Unit("A_peak", PEAK_SPELLINGS, 1.0 / ROOT_2),
        Unit("mA_rms", ("mA",), 1e-3),
        Unit("kA_rms", ("kA",), 1e3),
    ),
    "dq current": (
        Unit("A", ("amp", "amps", "ampere", *PEAK_SPELLINGS)),
        Unit("A_rms", RMS_SPELLINGS, ROOT_2),
        Unit("mA", (), 1e-3),
        Unit("kA", (), 1e3),
    ),
    "direct current": (
        Unit("A", ("amp", "amps", "ampere", "A DC", "Adc", "A_dc")),
        Unit("mA", (), 1e-3),
        Unit("kA", (), 1e3),
    ),
    "voltage": (
        Unit("V", ("volt", "volts", "Vdc", "V DC", "V_dc")),
        Unit("mV", (), 1e-3),
        Unit("kV", (), 1e3),
    ),
    "power": (
        Unit("W", ("watt", "watts")),
        Unit("mW", (), 1e-3),
        Unit("kW", ("kilowatt",), 1e3),
        Unit("MW", (), 1e6),
    ),
    "speed": (
        Unit("rpm", ("1/min", "min-1", "min^-1", "min⁻¹", "/min", "U/min", "r/min", "rev/min",
                     "tr/min", "giri/min", "RPM", "r.p.m.")),
        Unit("krpm", (), 1e3),
        Unit("rad/s", ("rad s-1", "rad s^-1", "rads-1", "rad/sec"), 30.0 / math.pi),
        Unit("rev/s", ("rps", "U/s", "r/s"), 60.0),
    ),
    "torque": (
        Unit("Nm", ("N·m", "N*m", "N m", "N.m", "N-m", "newton metre", "newton meter")),
        Unit("mNm", ("mN·m", "mN*m", "mN m"), 1e-3),
        Unit("kNm", ("kN·m", "kN*m", "kN m"), 1e3),
        Unit("Ncm", ("N·cm", "N cm"), 1e-2),
        # NIST SP 811 (2008), appendix B.8: foot pound-force
        Unit("lbf·ft", ("lb-ft", "lbf ft", "lb ft", "ft-lb", "ft lbf"), 1.3558179483314004),
    ),
    "flow": (
        Unit("L/min", ("l/min", "lpm", "L per min", "l min-1", "L_per_min")),
        Unit("L/s", ("l/s",), 60.0),
        Unit("L/h", ("l/h",), 1.0 / 60.0),
        Unit("mL/min", ("ml/min",), 1e-3),
        Unit("m3/h", ("m³/h", "m^3/h", "cbm/h"), 1000.0 / 60.0),
    ),
    "velocity": (
        Unit("km/h", ("kmh", "kph", "km per h", "km/hr", "km_per_h")),
        Unit("m/s", ("m s-1",), 3.6),
        Unit("mph", ("mi/h",), 1.609344),
    ),
    "fraction": (
        Unit("1", ("-", "on/off", "0/1", "bool", "p.u.", "pu")),
        Unit("%", ("percent", "pct"), 1e-2),
    ),
}  # fmt: skip
"""The units of each quantity; the first of each has factor 1 and is the canonical one."""

REFUSED: dict[tuple[str, str], str] = {
    ("speed", "Hz"): "it may be the electrical or the mechanical frequency",
    ("speed", "1/s"): "it may be revolutions or radians per second",
    ("speed", "eRPM"): "the electrical speed is the shaft's times the pole pairs",
}
"""Units that exist but do not determine the channel, with the reason."""


def _key(spelling: str) -> str:
    """Return a spelling without what carries no meaning: blanks, signs of degree and product."""
    text = spelling.strip()
    for sign in ("º", "˚"):  # NFKC would turn them into letters
        text = text.replace(sign, "°")
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
        folded.setdefault(key.casefold(), set()).add(unit)
    return exact, {key: units.pop() for key, units in folded.items() if len(units) == 1}


def find_unit(spelling: str, quantity: str) -> Unit | None:
    """Return the unit of a quantity that a spelling stands for, or None.

    Case is only ignored where it decides nothing: mW and MW stay apart.

    Args:
        spelling: Unit as the file writes it, such as `"°C"`.
        quantity: Key of `QUANTITIES`.
    """
    exact, folded = _spellings(quantity)
    key = _key(spelling)
    return exact.get(key) or folded.get(key.casefold())


def quantities_of(spelling: str) -> tuple[str, ...]:
    """Return the quantities that know a spelling, in the order of `QUANTITIES`."""
    return tuple(name for name in QUANTITIES if find_unit(spelling, name) is not None)


def is_unit(spelling: str) -> bool:
    """Return whether a spelling is a unit of any quantity, accepted or refused with a reason."""
    refused = {_key(unit).casefold() for _, unit in REFUSED}
    return bool(quantities_of(spelling)) or _key(spelling).casefold() in refused


def closest_unit(
    spelling: str, quantity: str | None = None, *, likeness: float = 0.6
) -> str | None:
    """Return the known spelling nearest to one that is not known, or None if none is near.

    Args:
        spelling: Unit as the file writes it.
        quantity: Key of `QUANTITIES`, or None for all of them.
        likeness: Least similarity of the two spellings, from 0 to 1 [1].
    """
    known: dict[str, str] = {}
    for name in QUANTITIES if quantity is None else (quantity,):
        for unit in QUANTITIES[name]:
            for candidate in (unit.symbol, *unit.spellings):
                known.setdefault(_key(candidate).casefold(), candidate)
    near = difflib.get_close_matches(_key(spelling).casefold(), known, n=1, cutoff=likeness)
    return known[near[0]] if near else None


def require_unit(spelling: str, quantity: str, *, where: str) -> Unit:
    """Return the unit that a spelling stands for.

    Args:
        spelling: Unit as the file writes it.
        quantity: Key of `QUANTITIES`.
        where: File and column, for the message.

    Raises:
        InputError: If the unit is refused, belongs to another quantity or is not known; with the
            accepted units and the closest one.
    """
    unit = find_unit(spelling, quantity)
    if unit is not None:
        return unit
    symbols = [known.symbol for known in QUANTITIES[quantity]]
    accepted = ", ".join(symbols)
    for (refused_quantity, refused), reason in REFUSED.items():
        if refused_quantity == quantity and _key(refused).casefold() == _key(spelling).casefold():
            raise InputError(
                f"A {quantity} in {spelling} is refused because {reason}.",
                where=where,
                remedy=f"Record it in one of: {accepted}.",
            )
    others = quantities_of(spelling)
    near = closest_unit(spelling, quantity)
    if others:
        problem = f"Expected a unit of {quantity}, got {spelling}, a unit of {others[0]}."
    else:
        meant = f" Did you mean {near}?" if near else ""
        problem = f"The unit '{spelling}' is not known for a {quantity}.{meant}"
    raise InputError(
        problem,
        where=where,
        remedy=f"Accepted are: {accepted}. Write one behind the name: 'name [{symbols[0]}]'.",
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
