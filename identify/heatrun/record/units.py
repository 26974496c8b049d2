"""The units of each quantity as benches write them, and their conversion to the canonical one.

This is the only place where heatrun converts units. The table is our own and no general library
such as pint stands behind it. What is asked of a unit here is decided by the quantity of the
channel, and mostly against the SI: C is degrees Celsius and not coulomb, F Fahrenheit and not
farad, a plain A of a phase is rms and one of the d axis an amplitude, U/min and tr/min are rpm, Hz
of a speed is refused. A library would need every one of these entries as an exception in front of
it and would answer for what has none, where a question is wanted; it would add an import to every
reading, to multiply by some forty factors.
"""

import difflib
import math
import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class Unit:
    """A unit of one quantity: `canonical = factor * value + offset`."""

    symbol: str  # As it is printed.
    spellings: tuple[str, ...] = ()  # Other ways in which benches write it.
    factor: float = 1.0  # Canonical units per unit.
    offset: float = 0.0  # Added after the factor, in canonical units.


ROOT_2 = math.sqrt(2.0)
RMS_WORDS = ("rms", "eff")
PEAK_WORDS = ("peak", "pk", "ampl", "amplitude")
DIRECT_WORDS = ("dc",)


def _kinds(symbols: Iterable[str], words: Iterable[str]) -> tuple[str, ...]:
    """Return the first symbol, and the others, with a word of the kind behind it."""
    first, *others = symbols
    joined = ("{0}_{1}", "{0}-{1}", "{0}.{1}", "{0}{1}", "{0}({1})", "{0},{1}")
    return (
        *(form.format(first, word) for word in words for form in joined),
        *(f"{other} {word}" for word in words for other in others),
    )


AMPERE = ("A", "amp", "amps", "ampere", "amperes", "ampère", "ampères", "安", "安培", "アンペア",
          "암페어")  # fmt: skip
MILLIAMPERE = ("mA", "milliamp", "milliamps", "milliampere", "milliamperes")
MICROAMPERE = ("µA", "uA", "microamp", "microamps", "microampere", "microamperes")
KILOAMPERE = ("kA", "kiloamp", "kiloamps", "kiloampere", "kiloamperes")

METRE_WORDS = ("metre", "metres", "meter", "meters")


def _newton(prefix: str, length: str = "") -> tuple[str, ...]:
    """Return the names of a torque in full, such as "kilonewton metres"."""
    words = tuple(f"{length}{word}" for word in METRE_WORDS)
    signs = ("", "-")
    return tuple(f"{prefix}newton{sign}{word}" for word in words for sign in signs)


def _per(first: Iterable[str], last: Iterable[str]) -> tuple[str, ...]:
    """Return one unit per another, such as "revs/min"."""
    return tuple(f"{one}/{other}" for one in first for other in last)


def _products(forces: Iterable[str], length: str) -> tuple[str, ...]:
    """Return a force times a length, in either order and with any sign between, as "in-lbf"."""
    pairs = [pair for force in forces for pair in ((force, length), (length, force))]
    return tuple(sign.join(pair) for pair in pairs for sign in (" ", "-", "."))


LITRE = ("L", "l", "litre", "litres", "liter", "liters", "Ltr")

REVOLUTION = ("rev", "revs", "revolutions", "turns", "Umdrehungen", "Umdr.", "giri", "tours", "tr",
              "U", "r", "obr", "ot", "varv", "omw", "omdr", "ford", "rot")  # fmt: skip

QUANTITIES: dict[str, tuple[Unit, ...]] = {
    "time": (
        Unit("s", ("sec", "secs", "sec.", "second", "seconds", "sek", "sek.", "Sekunde",
                   "Sekunden", "secondo", "secondi", "seconde", "secondes", "segundos", "秒",
                   "초")),
        Unit("ms", ("msec", "msecs", "millisecond", "milliseconds", "millisec", "millisecs",
                    "Millisekunde",
                    "Millisekunden", "millisecondi", "millisecondes", "毫秒", "ミリ秒"), 1e-3),
        Unit("us", ("µs", "usec", "µsec", "microsecond", "microseconds", "microsec",
                    "microsecs", "Mikrosekunden"), 1e-6),
        Unit("ns", ("nsec", "nanosecond", "nanoseconds", "Nanosekunden"), 1e-9),
        Unit("min", ("mins", "min.", "minute", "minutes", "Minuten", "minuto", "minuti",
                     "minutos", "分", "分钟", "분"), 60.0),
        Unit("h", ("hr", "hrs", "hour", "hours", "Std", "Std.", "Stunde", "Stunden", "ora", "ore",
                   "heure", "heures", "horas", "小时", "小時"), 3600.0),
        # no "day" and no "Tag": "time of day" and "time tag" name times of other units
        Unit("days", ("d", "Tage", "giorni", "jours", "datenum"), 86400.0),
    ),
    "temperature": (
        Unit("degC", ("°C", "C", "deg C", "deg. C", "deg_C", "deg-C", "Celsius", "degree C",
                      "degrees C", "degree Celsius", "degrees Celsius", "deg Celsius", "°Celsius",
                      "grad C", "Grad Celsius", "Grad", "gradi Celsius", "gradi C", "gradi",
                      "degré Celsius", "degrés Celsius", "degres Celsius", "degrés C",
                      "grados Celsius", "摄氏度", "攝氏度", "摂氏", "섭씨", "centigrade",
                      "degrees centigrade", "Cel", "oC", "Â°C",
                      "&deg;C", "\ufffdC", "?C",  # of a page of the web
                      "degree_Celsius", "degrees_Celsius", "degreesC", "degreeC", "degree_C",
                      "degrees_C")),  # of netCDF
        Unit("K", ("kelvin", "kelvins", "degK", "deg K", "deg_K", "°K", "degrees kelvin",
                   "Grad Kelvin", "gradi Kelvin", "degree_Kelvin", "degrees_Kelvin"), 1.0, -273.15),
        Unit("degF", ("°F", "F", "deg F", "deg. F", "deg_F", "degree F", "degrees F",
                      "Fahrenheit", "degree Fahrenheit", "degrees Fahrenheit", "deg Fahrenheit",
                      "Grad Fahrenheit", "gradi Fahrenheit", "oF", "Â°F", "\ufffdF", "?F",
                      "degree_Fahrenheit", "degrees_Fahrenheit"),
             5.0 / 9.0, -160.0 / 9.0),
    ),
    "phase current": (
        # the rms value of a direct current is the current
        Unit("A_rms", (*AMPERE, *_kinds(AMPERE, RMS_WORDS), "A AC", "AAC", "A DC", "ADC")),
        Unit("A_peak", (*_kinds(AMPERE, PEAK_WORDS), "Â"), 1.0 / ROOT_2),
        Unit("mA_rms", (*MILLIAMPERE, *_kinds(MILLIAMPERE, RMS_WORDS)), 1e-3),
        Unit("mA_peak", _kinds(MILLIAMPERE, PEAK_WORDS), 1e-3 / ROOT_2),
        Unit("kA_rms", (*KILOAMPERE, *_kinds(KILOAMPERE, RMS_WORDS)), 1e3),
        Unit("kA_peak", _kinds(KILOAMPERE, PEAK_WORDS), 1e3 / ROOT_2),
        Unit("µA_rms", (*MICROAMPERE, *_kinds(MICROAMPERE, RMS_WORDS)), 1e-6),
        Unit("µA_peak", _kinds(MICROAMPERE, PEAK_WORDS), 1e-6 / ROOT_2),
    ),
    "dq current": (
        Unit("A", (*AMPERE[1:], *_kinds(AMPERE, PEAK_WORDS), "Â")),
        Unit("A_rms", _kinds(AMPERE, RMS_WORDS), ROOT_2),
        Unit("mA", (*MILLIAMPERE[1:], *_kinds(MILLIAMPERE, PEAK_WORDS)), 1e-3),
        Unit("mA_rms", _kinds(MILLIAMPERE, RMS_WORDS), 1e-3 * ROOT_2),
        Unit("kA", (*KILOAMPERE[1:], *_kinds(KILOAMPERE, PEAK_WORDS)), 1e3),
        Unit("kA_rms", _kinds(KILOAMPERE, RMS_WORDS), 1e3 * ROOT_2),
    ),
    "direct current": (
        Unit("A", (*AMPERE[1:], *_kinds(AMPERE, DIRECT_WORDS))),
        Unit("mA", (*MILLIAMPERE[1:], *_kinds(MILLIAMPERE, DIRECT_WORDS)), 1e-3),
        Unit("kA", (*KILOAMPERE[1:], *_kinds(KILOAMPERE, DIRECT_WORDS)), 1e3),
    ),
    "voltage": (
        Unit("V", ("volt", "volts", "伏", "伏特", "ボルト", "볼트", "VDC", "V DC", "VAC", "V AC",
                   *_kinds(("V",), DIRECT_WORDS))),
        Unit("mV", ("millivolt", "millivolts", *_kinds(("mV",), DIRECT_WORDS)), 1e-3),
        Unit("kV", ("kilovolt", "kilovolts", *_kinds(("kV",), DIRECT_WORDS)), 1e3),
    ),
    "power": (
        Unit("W", ("watt", "watts", "瓦", "瓦特", "ワット", "와트")),
        Unit("mW", ("milliwatt", "milliwatts", "mWatt", "mWatts"), 1e-3),
        Unit("kW", ("kilowatt", "kilowatts", "kWatt", "kWatts", "chilowatt", "kilovatios",
                    "千瓦"), 1e3),
        Unit("MW", ("megawatt", "megawatts", "MWatt", "MWatts"), 1e6),
    ),
    "speed": (
        Unit("rpm", ("1/min", "min-1", "min^-1", "min^(-1)", "min⁻¹", "/min", "r.p.m.", "r.p.m",
                     "UpM", "1/minute",
                     "rev per min", "rev per minute", "revs per minute", "revolutions per minute",
                     "revolutions per min", "turns per minute", "Umdrehungen pro Minute",
                     "giri al minuto", "tours par minute", "tr/mn", "rev_per_min",
                     "转/分", "轉/分", "转每分钟", "回転/分", "회전/분", "dev/dk", "d/dk",
                     *_per(REVOLUTION, ("min", "minute")))),
        Unit("krpm", ("k rpm", "kRPM", "1000 U/min", "1000 r/min", "1000 rpm", "1000/min",
                      "1000 1/min", "10^3 rpm", "10³ rpm",
                      "x1000 rpm", "rpm x1000", "x 1000 min-1", "kilo rpm", "1000 min-1"), 1e3),
        Unit("rad/s", ("rad s-1", "rad s^-1", "rad.s-1", "rad.s^-1", "rad/sec", "radians/s",
                       "rad per s", "rad per second", "radians per second",
                       "Radiant pro Sekunde", "rad_per_s"),
             30.0 / math.pi),
        Unit("rev/s", ("rps", "r.p.s.", "r.p.s", "rev per s", "rev per second",
                       "revolutions per second",
                       "Umdrehungen pro Sekunde", "tours par seconde", "rev_per_s",
                       *_per(REVOLUTION, ("s", "sec"))), 60.0),
        Unit("deg/s", ("°/s", "deg/sec", "degrees per second", "Grad/s"), 1.0 / 6.0),
    ),
    "torque": (
        Unit("Nm", ("牛·米", "牛米", "N·m", "N*m", "N m", "N.m", "N-m", "N_m", *_newton(""))),
        Unit("mNm", ("mN·m", "mN*m", "mN m", "mN.m", "mN-m", *_newton("milli")), 1e-3),
        Unit("kNm", ("kN·m", "kN*m", "kN m", "kN.m", "kN-m", *_newton("kilo")), 1e3),
        Unit("Ncm", ("N·cm", "N cm", "N.cm", "N-cm", *_newton("", "centi")), 1e-2),
        Unit("Nmm", ("N·mm", "N mm", "N.mm", "N-mm", *_newton("", "milli")), 1e-3),
        Unit("daNm", ("daN·m", "daN m", "daN.m", "daN-m", *_newton("deca")), 10.0),
        # NIST SP 811 (2008), appendix B.8: foot, inch and ounce pound-force, kilogram-force
        Unit("lbf·ft", ("foot-pounds", "pound-feet", *_products(("lbf", "lb", "lbs"), "ft")),
             1.3558179483314004),
        Unit("lbf·in", _products(("lbf", "lb", "lbs"), "in"), 0.1129848290276167),
        Unit("ozf·in", _products(("ozf", "oz"), "in"), 0.00706155181422604),
        Unit("kgf·m", ("kp m", "kpm", *_products(("kgf",), "m")), 9.80665),
        Unit("kgf·cm", _products(("kgf",), "cm"), 0.0980665),
    ),
    "flow": (
        Unit("L/min", ("lpm", "l min-1", "L min^-1", "L per min", "L_per_min", "litres per minute",
                       "liters per minute", "Liter pro Minute", "litri al minuto",
                       "litres par minute", "L per minute", *_per(LITRE, ("min", "minute")))),
        Unit("L/s", ("l s-1", "litres per second", "liters per second",
                     *_per(LITRE, ("s", "sec"))), 60.0),
        Unit("L/h", ("l h-1", "litres per hour", "liters per hour", "Liter pro Stunde",
                     *_per(LITRE, ("h", "hr", "hour"))), 1.0 / 60.0),
        Unit("mL/min", ("cm3/min", "ccm/min", "cc/min", "millilitres per minute",
                        "milliliters per minute"), 1e-3),
        Unit("m3/h", ("m^3/h", "cbm/h", "m3/hr", "m3 h-1"), 1000.0 / 60.0),
        Unit("m3/s", ("m^3/s", "m3 s-1"), 60000.0),
    ),
    "velocity": (
        Unit("km/h", ("kmh", "kph", "km/hr", "km h-1", "km per h", "km_per_h", "km/hour",
                      "km per hour", "kilometres per hour", "kilometers per hour",
                      "Kilometer pro Stunde")),
        Unit("m/s", ("m s-1", "mps", "m/sec", "m per s", "metres per second",
                     "meters per second"), 3.6),
        Unit("mph", ("mi/h", "miles/h", "miles per hour"), 1.609344),
    ),
    "resistance": (
        Unit("ohm", ("Ω", "ohms")),
        Unit("mohm", ("mΩ", "mOhm", "mohms", "mOhms", "milliohm", "milliohms"), 1e-3),
        Unit("µohm", ("µΩ", "µOhm", "uohm", "uOhm", "uΩ", "microohm", "microohms"), 1e-6),
        Unit("kohm", ("kΩ", "kOhm", "kOhms", "kohms", "kiloohm", "kilohm"), 1e3),
        Unit("Mohm", ("MΩ", "MOhm", "megohm", "megaohm"), 1e6),
    ),
    "fraction": (
        Unit("1", ("-", "on/off", "0/1", "bool", "p.u.", "p.u", "pu", "dimensionless")),
        Unit("%", ("percent", "pct", "per cent", "Prozent", "percento", "pour cent"), 1e-2),
    ),
}  # fmt: skip
"""The units of each quantity; the first of each has factor 1 and is the canonical one."""

EXACT_ONLY = frozenset(("oC", "oF", "Std", "ora", "ore", "Grad", "uA", "d"))
"""Spellings that are other words in another case: "of", "std" for a standard deviation."""

BRACKETED_ONLY = frozenset(("d",))
"""Spellings that are units in square brackets and in rows of units alone; elsewhere an axis."""

SPAN = "it is the span between both peaks, twice the amplitude of a sine alone"

REFUSED: dict[str, dict[str, str]] = {
    "temperature": {
        **dict.fromkeys(("deg", "°", "degrees", "º"), "it does not say of which scale"),
        **dict.fromkeys(("degR", "°R", "Rankine"), "heatrun does not convert it"),
    },
    "phase current": dict.fromkeys(
        ("A_pp", "App", "A pp", "A_pkpk", "A pk-pk", "A peak-peak", "A p-p"), SPAN
    ),
    "dq current": dict.fromkeys(("A_pp", "App", "A pp", "A pk-pk", "A p-p"), SPAN),
    "power": {
        **dict.fromkeys(
            ("hp", "bhp", "horsepower"), "mechanical, metric and electrical horsepower differ"
        ),
        "PS": "heatrun does not convert it",
        **dict.fromkeys(("VA", "kVA", "MVA"), "it is an apparent power, which heats nothing"),
        **dict.fromkeys(("var", "kvar"), "it is a reactive power, which heats nothing"),
        **dict.fromkeys(("Wh", "kWh", "kJ", "MJ", "Ws"), "it is an energy"),
        **dict.fromkeys(("BTU/h", "kcal/h", "J/s", "kJ/s"), "heatrun does not convert it"),
    },
    "speed": {
        **dict.fromkeys(("Hz", "kHz"), "it may be the electrical or the mechanical frequency"),
        **dict.fromkeys(
            ("1/s", "s-1", "s^-1", "/s", "1/sec"), "it may be revolutions or radians per second"
        ),
        "g/min": "it may be giri or grams per minute",
        "eRPM": "the electrical speed is the shaft's times the pole pairs",
    },
    "flow": {
        **dict.fromkeys(("gpm", "gal/min"), "the American and the British gallon differ"),
        **dict.fromkeys(("kg/min", "kg/h", "kg/s", "g/s", "g/min"), "it is a mass, not a volume"),
    },
}
"""Units that exist but do not determine the channel, with the reason."""


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
    r"|(?:lbf?|lbs|ozf?|kgf?|kp|gf?)[.-](?:in|inch|ft|mm|cm|m)"
    r"|(?:in|inch|ft|mm|cm|m)[.-](?:lbf?|lbs|ozf?|kgf?|kp|gf?)"
)
"""Words that are units by their form: a prefix of the SI and a unit, something per time, or a force
times a length."""

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


CYRILLIC = {
    "кгс": "kgf", "мин": "min", "сек": "s", "час": "h", "рад": "rad", "Вт": "W", "Ом": "ohm",
    "об": "rev", "Гц": "Hz", "л": "L", "м": "m", "к": "k", "А": "A", "В": "V", "Н": "N", "с": "s",
    "ч": "h", "С": "C", "К": "K", "М": "M",
}  # fmt: skip
"""What units in Russian are made of, the longer ones first."""

IN_CYRILLIC = re.compile("|".join(CYRILLIC))


@lru_cache(maxsize=4096)
def _key(spelling: str) -> str:
    """Return a spelling without what carries no meaning: blanks, signs of degree and product."""
    text = spelling.strip().translate(DEGREES)  # NFKC would turn some of them into letters
    text = IN_CYRILLIC.sub(lambda part: CYRILLIC[part[0]], unicodedata.normalize("NFKC", text))
    return re.sub(r"[\s·∙⋅・*]+", "", text.replace("−", "-").replace("μ", "µ"))


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
    """
    if len(spelling) > LONGEST_UNIT:
        return None
    exact, folded = _spellings(quantity)
    key = _key(spelling)
    unit = exact.get(key) or folded.get(key.casefold())
    if unit is None or key in exact or len(key) > LONGEST_SYMBOL:
        return unit
    meant = next(known for known in exact if known.casefold() == key.casefold())
    is_other_case = key in (key.lower(), key.upper()) or key[1:] == meant[1:]
    is_mega = key[:1] == "M" and meant[:1] == "m" and meant[1:2].isupper()
    return unit if is_other_case and not is_mega else None


def quantities_of(spelling: str) -> tuple[str, ...]:
    """Return the quantities that know a spelling, in the order of `QUANTITIES`."""
    return tuple(name for name in QUANTITIES if find_unit(spelling, name) is not None)


def refusal(spelling: str, quantity: str) -> str | None:
    """Return why a unit that exists does not determine a quantity, or None."""
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
    """Return whether a text is a unit, known or not, or a misspelled one, as `"Celcius"`."""
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
    """Return the known spelling of a quantity, or of any, nearest to one that is not known.

    None if none is near: their similarity, from 0 to 1 [1], is less than the likeness.
    """
    if len(spelling) > LONGEST_UNIT:
        return None
    known: dict[str, str] = {}
    for name in QUANTITIES if quantity is None else (quantity,):
        for unit in QUANTITIES[name]:
            for one in (unit.symbol, *unit.spellings):
                known.setdefault(_key(one).casefold(), one)
    near = difflib.get_close_matches(_key(spelling).casefold(), known, n=1, cutoff=likeness)
    return known[near[0]] if near else None


def require_unit(spelling: str, quantity: str, *, where: str, remedy: str = "") -> Unit:
    """Return the unit that a spelling stands for; the remedy is put behind the accepted units.

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
    """Return values, shape (time,), in a unit converted to the canonical one of its quantity."""
    if unit.factor == 1.0 and unit.offset == 0.0:
        return values
    # The offset of degF is a factor's multiple: (F - 32) is exact where F*5/9 - 160/9 is not.
    return (values + unit.offset / unit.factor) * unit.factor
