"""Reading the motor file: every key is known, every value checked, nothing guessed.

What lies outside the values that a parameter can have in any machine was mistyped, or is a test.
The ranges are wide: from a motor of some grams to a generator of thousands of tonnes. They keep
numbers out with which nothing can be computed, such as 1e300, and a unit that is wrong by far.
`[tests.NAME]` stands before them.
"""

import hashlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from ..errors import InputError
from ..io.open_file import read_start
from ..io.toml_text import (
    LARGEST_BYTES,
    check_keys,
    choice_of,
    parse_toml,
    section_of,
    shown,
    text_of,
)
from ..record.channels import BODIES, CHANNEL, parse_claims
from ..record.motor import (
    EQUILIBRIA,
    HEAT_LIMITS,
    LIMIT_DEGC,
    Adequacy,
    COEFFICIENTS_degC,
    GapLoad,
    Motor,
    ParameterOverride,
    PartsOfTest,
    Scales,
    ShutDown,
)
from ..record.stretch import Stretch, in_order, parse_time
from .certificate import parse_certificate
from .keys import KEYS, UNITS
from .population import HEAT, next_of_population

MOST_CHOICES = 20
"""Right-hand sides of one channel."""

MOST_PARTS = 200
"""Of one test; each stretch becomes a test with temperatures of its own at the start."""


def parse_parts(section: Mapping[str, Any], where: str) -> dict[str, PartsOfTest]:
    """Return what the `[tests.NAME]` of a motor file say, by name of the test.

    Raises:
        InputError: If a key is not known, or a window is no pair of times or rows in order.
    """
    parts = {}
    for name, keys in section.items():
        at = f"{where}, [tests.{name}]"
        if not isinstance(keys, dict):
            raise InputError(
                "Expected a section with use, use_rows, mask, bridge, gap or columns.",
                where=at,
                remedy=f"Write [tests.{name}] and below it use = [[600, 5400]], for example.",
            )
        check_keys(keys, KEYS["tests.NAME"], at, "key")
        if "use" in keys and "use_rows" in keys:
            raise InputError(
                "Both use and use_rows are given.", where=at, remedy="Keep one of them."
            )
        use = _stretches(keys, "use", at) + _stretches(keys, "use_rows", at)
        mask, bridge = (
            tuple((part.start, part.end) for part in _stretches(keys, key, at))
            for key in ("mask", "bridge")
        )
        if any(math.isinf(end) for _, end in (*mask, *bridge)):
            raise InputError("mask and bridge need both ends of a window.", where=at)
        columns = parse_columns(keys.get("columns", {}), at)
        late = "load_offset" in keys
        offset_s = _number(keys, "load_offset", ANY_NUMBER, at) if late else None
        parts[name] = PartsOfTest(use, mask, bridge, _gap_load(keys, at), columns, offset_s)
    return parts


def _gap_load(keys: Mapping[str, Any], where: str) -> GapLoad | None:
    section = keys.get("gap")
    load = section.get("load") if isinstance(section, dict) else section
    if section is None or (load in get_args(GapLoad) and section == {"load": load}):
        return load
    raise InputError(
        f"Expected the load in the gaps of the logger, got {str(section)[:80]}.",
        where=f"{where}, gap",
        remedy='Write gap.load = "held", "zero" or "unknown".',
    )


def parse_columns(section: Any, where: str) -> dict[str, str | tuple[str, ...]]:
    """Return `[columns]`, or that of a test.

    Raises:
        InputError: If a channel is not known, or what stands behind it is no text and no list.
    """
    at = f"{where}, [columns]"
    if not isinstance(section, dict):
        raise InputError("Expected a section with lines such as winding_degC = …", where=at)
    columns: dict[str, str | tuple[str, ...]] = {}
    for key, said in section.items():
        if not isinstance(said, list):
            columns[key] = text_of(section, key, at)
            continue
        if not 0 < len(said) <= MOST_CHOICES:
            raise InputError(
                f"Expected 1 to {MOST_CHOICES} columns for {key}, got {len(said)}.", where=at
            )
        columns[key] = tuple(text_of({key: text}, key, at) for text in said)
    parse_claims(columns, where)
    return columns


def _stretches(keys: Mapping[str, Any], key: str, where: str) -> tuple[Stretch, ...]:
    if key not in keys:
        return ()
    listed = keys[key]
    pairs = isinstance(listed, list) and all(
        isinstance(pair, list) and len(pair) == 2 for pair in listed
    )
    if not pairs or not listed or len(listed) > MOST_PARTS:
        raise InputError(
            f"Expected a list of 1 to {MOST_PARTS} pairs for {key}, got {str(listed)[:80]}.",
            where=where,
            remedy=f"Write {key} = [[600, 5400], [7200, 9000]]: first and last "
            f"{'row' if key == 'use_rows' else 'second'} of each.",
        )
    at = f"{where}, {key}"
    return tuple(
        in_order(Stretch(_end(first, key, at), _end(last, key, at), key == "use_rows"), at)
        for first, last in listed
    )


def _end(value: Any, key: str, where: str) -> float:
    """Return one end of a window, a time [s] or a row."""
    is_row = key == "use_rows"
    is_number = isinstance(value, int if is_row else int | float) and not isinstance(value, bool)
    if is_number and (1 <= value < 10**15 if is_row else 0 <= value <= 1e12):
        return float(value)
    if not is_row and isinstance(value, str) and value.strip():
        rows = "Rows stand under use_rows, as numbers: use_rows = [[1, 5000]]."
        return parse_time(value, where, rows)
    kind = "a whole number from 1" if is_row else "seconds from 0, or a text such as '90 min'"
    raise InputError(
        f"Expected {kind} for an end of {key}, got {str(value)[:80]!r}.",
        where=where,
        remedy="Times are counted from the first sample of the file.",
    )


RANGES = {
    "J/K": (1e-3, 1e10),  # copper has 385 J/(kg K)
    "K/W": (1e-7, 1e5),  # still air around a thumb: some 100 K/W
    "ohm": (1e-9, 1e6),
    "degC": (-273.15, 1500.0),  # absolute zero; where iron melts
    "K": (-500.0, 500.0),
    "1": (-0.99, 10.0),  # relative errors: at -1 nothing is left of what is measured
    "N m": (-1e6, 1e6),
    "W": (-1e9, 1e9),
    "s": (-86400.0, 86400.0),
}
"""Lowest and highest value by unit."""

RELATIVE_SD = (1e-6, 1e3)
"""Standard deviation of a prior relative to its value [1]: below, the parameter is fixed; above,
the interval spans six powers of ten."""

SMALLEST_SHARE = 1e-12
"""Smallest standard deviation of a prior as a share of the range: below, the parameter is fixed."""

WIDTHS = 25.0
"""How far an effect's parameter may lie from the middle of its plausible range, in its widths; the
width is four standard deviations of the prior."""


LOG_WIDTHS = 10.0
"""The same for a log-normal parameter, in standard deviations of the logarithm."""


def refuse_implausible(
    name: str, said: ParameterOverride, unit: str, limits: tuple[float, float], where: str
) -> None:
    """Refuse what a motor file says of a parameter that no machine has.

    The limits are its lowest and highest value [its unit].

    Raises:
        InputError: With the range.
    """
    low, high = limits
    beyond, no_width = f"beyond what {name} is in any machine", f"no standard deviation of {name}"
    found = f"Correct it (the unit is {unit}), or leave it out to have it estimated."
    known = "Correct it, or write fixed = … for a value that is known."
    for label, lowest, highest, words, remedy in (
        ("fixed", low, high, beyond, found),
        ("value", low, high, beyond, found),
        ("sd", SMALLEST_SHARE * (high - low), high - min(low, 0.0), no_width, known),
        ("relative_sd", *RELATIVE_SD, f"{no_width} relative to its value (0.2 is 20 %)", known),
    ):
        number = getattr(said, label)
        of_unit = "" if unit == "1" or label == "relative_sd" else f" {unit}"
        if number is not None and not lowest <= number <= highest:
            raise InputError(
                f"{label} = {number:g}{of_unit} is {words}: "
                f"expected {lowest:g} to {highest:g}{of_unit}.",
                where=where,
                remedy=remedy,
            )


def limits_around(centre: float, sd: float, *, is_log: bool) -> tuple[float, float]:
    """Return the limits of an effect's parameter [its unit] from its prior, which is wide already.

    Its standard deviation is that of the logarithm [1] or of the parameter [its unit].
    """
    if is_log:
        reach = math.exp(min(LOG_WIDTHS * sd, 200.0))
        return centre / reach, centre * reach
    return centre - 4.0 * WIDTHS * sd, centre + 4.0 * WIDTHS * sd


PLAIN = ("motor", "winding", "vehicle", "adequacy", "population", "shutdown", "scales")
"""Sections whose keys are read one by one."""

OVERRIDE_KEYS = KEYS["parameters.NAME"]

LARGEST = 10**30
"""Beyond it no quantity of a motor means anything in any unit."""

MOST_PHASES = 99

Limits = tuple[float, float, str]
POSITIVE: Limits = (0.0, math.inf, "above 0")
NOT_NEGATIVE: Limits = (-1e-12, math.inf, "at least 0")
ANY_NUMBER: Limits = (-1e30, 1e30, "between -1e30 and 1e30")
FINITE: Limits = (-math.inf, math.inf, "to be finite")
SHARE: Limits = (-1e-12, 1.0, "at least 0 and below 1")

NUMBERS: dict[str, Limits] = {
    "resistance_coefficient_degC": (100.0, 400.0, "between 100 and 400 degC (copper 234.5)"),
    "reference_temperature_degC": (-60.0, 250.0, "between -60 and 250 degC"),
    "lead_resistance_ohm": NOT_NEGATIVE,
    HEAT: (
        *HEAT_LIMITS,
        f"between {HEAT_LIMITS[0]:g} and {HEAT_LIMITS[1]:g} of the mean loss "
        f"(usual: {Adequacy().unmodelled_heat:g})",
    ),
    "heat_time_s": (60.0, 86400.0, "between 60 and 86400 s (usual: 1200)"),
    "fixed": FINITE,
    "value": FINITE,
    **{key: SHARE if key.endswith(("_after", "_sd")) else NOT_NEGATIVE for key in KEYS["shutdown"]},
}
"""Limits of the numbers that need not be above 0."""

CHOICES: dict[str, tuple[str, ...]] = {
    "losses": ("balance", "map"),
    "sink": ("ambient", "coolant"),
    "insulation_class": tuple(LIMIT_DEGC),
    "utilisation_class": tuple(LIMIT_DEGC),  # letters of IEC 60085 both
    "equilibrium": tuple(EQUILIBRIA),
    "decimal": (".", ","),
    "material": tuple(COEFFICIENTS_degC),
}
"""Keys that hold one of some words."""

READ_APART = ("name", "phases", "per_test")

OF_A_WHOLE = (
    ("conductor_mass_kg", "mass_kg", "kg", "that of the whole machine"),
    ("lead_resistance_ohm", "measured_resistance_ohm", "ohm", "that of winding and leads"),
)
"""Keys of `[winding]` that are a part of another one, with the unit and what that is."""


def load_motor(path: str | Path) -> Motor:
    """Read a motor file.

    Args:
        path: A TOML file with `[motor]` and optionally `[winding]`, `[vehicle]`, `[columns]`,
            `[constants]`, `[sensors]`, `[model]`, `[adequacy]`, `[population]`, `[shutdown]`,
            `[scales]`, `[tests.NAME]`, `[certificate]` and `[parameters.NAME]`.

    Raises:
        InputError: If the file cannot be read, has a section or key that is not known (with the
            closest one), a value of another type or out of range, or two that contradict.
    """
    return parse_motor(read_start(path, LARGEST_BYTES), str(path))


def parse_motor(data: bytes, where: str) -> Motor:
    """Return the machine of a motor file; errors as `load_motor`."""
    content = parse_toml(data, where)
    check_keys(content, list(dict.fromkeys(n.partition(".")[0] for n in KEYS)), where, "section")
    sections = {name: section_of(content, name, where) for name in PLAIN}
    for name, section in sections.items():
        check_keys(section, KEYS[name], f"{where}, [{name}]", "key")
    sisters = next_of_population(sections["population"], where)
    effects = _effects(section_of(content, "model", where), where)
    if "name" not in sections["motor"]:
        raise InputError(
            "Expected the name of the motor, found none.",
            where=f"{where}, [motor]",
            remedy='Add: name = "…".',
        )
    said = {
        name: _said(sections[name], f"{where}, [{name}]") for name in PLAIN if name != "population"
    }
    machine = {
        **said["motor"],
        **_winding(said["winding"], said["motor"], where),
        **said["vehicle"],
    }
    return Motor(
        name=text_of(sections["motor"], "name", f"{where}, [motor]"),
        phases=_phases(sections["motor"], f"{where}, [motor]"),
        **machine,
        columns=parse_columns(section_of(content, "columns", where), where),
        constants=_constants(section_of(content, "constants", where), where),
        parameters={
            **sisters.parameters,
            **_parameters(section_of(content, "parameters", where), where),
        },
        sensors=_sensors(section_of(content, "sensors", where), where),
        tests=parse_parts(section_of(content, "tests", where), where),
        effects=tuple(dict.fromkeys((*effects, *sisters.effects))),
        scales=Scales(**said["scales"]),
        adequacy=Adequacy(**{**sisters.adequacy, **said["adequacy"]}),
        shutdown=ShutDown(**said["shutdown"]),
        certificate=parse_certificate(section_of(content, "certificate", where), where),
        sha256=hashlib.sha256(data).hexdigest(),
        path=where,
    )


def _said(section: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the values of the keys that hold a number or one of some words."""
    return {
        key: choice_of(section, key, CHOICES[key], where)
        if key in CHOICES
        else _number(section, key, NUMBERS.get(key, POSITIVE), where)
        for key in section
        if key not in READ_APART
    }


def _number(section: Mapping[str, Any], key: str, limits: Limits, where: str) -> float:
    value = section[key]
    low, high, spoken = limits
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(
            f"Expected a number for {key}, got {shown(value)}.",
            where=where,
            remedy=f"Write {key} = 1.0, without quotes and unit.",
        )
    if isinstance(value, int) and abs(value) > LARGEST:  # an integer may be too large for a float
        raise InputError(f"Expected {key} {spoken}, got {shown(value)}.", where=where)
    # Not `value <= low`: NaN must be refused too.
    if not (low < value < high):
        raise InputError(f"Expected {key} {spoken}, got {value:g}.", where=where)
    return float(value)


def _phases(motor: Mapping[str, Any], where: str) -> int:
    value = motor.get("phases", Motor.phases)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MOST_PHASES:
        raise InputError(
            f"Expected a whole number of phases from 1 to {MOST_PHASES}, got {shown(value)}.",
            where=where,
            remedy="Write phases = 3.",
        )
    return value


def _winding(winding: dict[str, Any], motor: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return what the values of `[winding]` say of the machine, beside those of `[motor]`."""
    at = f"{where}, [winding]"
    material = winding.pop("material", None)
    if material is not None and "resistance_coefficient_degC" in winding:
        raise InputError(
            f"Both material = '{material}' ({COEFFICIENTS_degC[material]:g} degC) and "
            f"resistance_coefficient_degC = {winding['resistance_coefficient_degC']:g} are given.",
            where=at,
            remedy="Keep one of them.",
        )
    if material is not None:
        winding["resistance_coefficient_degC"] = COEFFICIENTS_degC[material]
    all_of = {**motor, **winding}
    for part, whole, unit, meant in OF_A_WHOLE:
        if all_of.get(part, -math.inf) >= all_of.get(whole, math.inf):
            raise InputError(
                f"Expected {part} below {whole}, got {all_of[part]:g} of {all_of[whole]:g} {unit}.",
                where=at,
                remedy=f"Write both in {unit}; {whole} is {meant}.",
            )
    return winding


def _effects(section: Mapping[str, Any], where: str) -> tuple[str, ...]:
    at = f"{where}, [model]"
    check_keys(section, KEYS["model"], at, "key")
    effects = section.get("effects", [])
    if not isinstance(effects, list) or not all(isinstance(e, str) for e in effects):
        raise InputError(
            f"Expected a list of effects, got {shown(effects)}.",
            where=at,
            remedy='Write effects = ["speed_cooling"]; the ids stand in docs/motor_file.md.',
        )
    return tuple(effects)


def _constants(section: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return the value of each channel that is constant."""
    at = f"{where}, [constants]"
    known = [name for name in CHANNEL if name not in ("time_s", "winding_degC")]
    check_keys(section, known, at, "channel")
    return {name: _number(section, name, ANY_NUMBER, at) for name in section}


def _sensors(section: Mapping[str, Any], where: str) -> dict[str, str]:
    """Return the node of each measured body by its channel."""
    at = f"{where}, [sensors]"
    check_keys(section, BODIES, at, "channel")
    return {channel: text_of(section, channel, at) for channel in section}


def _parameters(section: Mapping[str, Any], where: str) -> dict[str, ParameterOverride]:
    overrides = {}
    for name in section:
        at = f"{where}, [parameters.{name}]"
        keys = section[name]
        if not isinstance(keys, dict) or not keys:
            raise InputError(
                f"Expected a section with one of {', '.join(OVERRIDE_KEYS)}, got {shown(keys)}.",
                where=at,
                remedy=f"Write [parameters.{name}] and below it fixed = 0.1, for example.",
            )
        check_keys(keys, OVERRIDE_KEYS, at, "key")
        overrides[name] = said = _override(keys, at)
        unit = UNITS.get(name)
        if unit is not None:  # those of effects are looked at where the effects are known
            refuse_implausible(name, said, unit, RANGES[unit], at)
    return overrides


def _override(keys: Mapping[str, Any], where: str) -> ParameterOverride:
    beside_fixed = [key for key in OVERRIDE_KEYS[1:] if key in keys]
    if "fixed" in keys and beside_fixed:
        raise InputError(
            f"A fixed parameter has no {' and no '.join(beside_fixed)}.",
            where=where,
            remedy="Remove either fixed or the others.",
        )
    if "sd" in keys and "relative_sd" in keys:
        raise InputError(
            "Both sd and relative_sd are given.", where=where, remedy="Keep one of them."
        )
    per_test = keys.get("per_test")
    if per_test is not None and not isinstance(per_test, bool):
        raise InputError(
            f"Expected true or false for per_test, got {shown(per_test)}.", where=where
        )
    return ParameterOverride(
        **_said(keys, where),
        per_test=per_test,
    )
