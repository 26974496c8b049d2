"""Reading the motor file: every key is known, every value checked, nothing guessed."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, cast

from .bench.channels.schema import BODIES, CHANNEL
from .bench.readers.open_file import read_start
from .certificate_file import parse_certificate
from .errors import InputError, did_you_mean
from .io.toml_text import LARGEST_BYTES, check_keys, parse_toml
from .io.toml_values import shown, text_of
from .motor import HEAT_LIMITS, Adequacy, COEFFICIENTS_degC, Motor, ParameterOverride
from .motor_parts import parse_columns, parse_parts
from .motor_population import next_of_population
from .plausible import RANGES, UNITS, refuse_implausible

INSULATION_CLASSES = ("A", "E", "B", "F", "H", "N", "R")
"""Letters of IEC 60085, in the order of their temperature."""

KEYS: dict[str, tuple[str, ...]] = {
    "motor": (
        "name",
        "phases",
        "losses",
        "sink",
        "insulation_class",
        "rated_speed_rpm",
        "rated_current_A",
        "mass_kg",
        "raster_s",
        "decimal",
    ),
    "winding": (
        "material",
        "resistance_coefficient_degC",
        "phase_resistance_ohm",
        "reference_temperature_degC",
        "measured_resistance_ohm",
        "lead_resistance_ohm",
        "conductor_mass_kg",
    ),
    "vehicle": ("gear_ratio", "wheel_radius_m"),
    "adequacy": ("unmodelled_heat", "heat_time_s"),
    "population": ("run",),
}
"""Sections with a fixed set of keys; `[columns]` and `[parameters.NAME]` have their own."""

OVERRIDE_KEYS = ("fixed", "value", "relative_sd", "sd", "per_test")

LARGEST = 10**30
"""Beyond it no quantity of a motor means anything in any unit."""

MOST_PHASES = 99

Limits = tuple[float, float, str]
POSITIVE: Limits = (0.0, math.inf, "above 0")
NOT_NEGATIVE: Limits = (-1e-12, math.inf, "at least 0")
ANY_NUMBER: Limits = (-1e30, 1e30, "between -1e30 and 1e30")
COEFFICIENT_RANGE: Limits = (100.0, 400.0, "between 100 and 400 degC (copper 234.5)")
HEAT_RANGE: Limits = (
    *HEAT_LIMITS,
    f"between {HEAT_LIMITS[0]:g} and {HEAT_LIMITS[1]:g} of the mean loss "
    f"(usual: {Adequacy().unmodelled_heat:g})",
)
HEAT_TIME_RANGE: Limits = (60.0, 86400.0, "between 60 and 86400 s (usual: 1200)")
REFERENCE_RANGE: Limits = (-60.0, 250.0, "between -60 and 250 degC")


def load_motor(path: str | Path) -> Motor:
    """Read a motor file.

    Args:
        path: A TOML file with `[motor]` and optionally `[winding]`, `[vehicle]`, `[columns]`,
            `[constants]`, `[sensors]`, `[model]`, `[adequacy]`, `[population]`, `[tests.NAME]`,
            `[certificate]` and `[parameters.NAME]`.

    Raises:
        InputError: If the file cannot be read, has a section or key that is not known (with the
            closest one), a value of another type or out of range, or two that contradict.
    """
    return parse_motor(read_start(path, LARGEST_BYTES), str(path))


def parse_motor(data: bytes, where: str) -> Motor:
    """Return the machine of a motor file; errors as `load_motor`.

    Args:
        data: The bytes of the file.
        where: The file, for messages.
    """
    content = parse_toml(data, where)
    check_keys(
        content,
        (*KEYS, "model", "columns", "constants", "sensors", "tests", "parameters", "certificate"),
        where,
        "section",
    )
    sections = {name: _section(content, name, where) for name in KEYS}
    for name, keys in KEYS.items():
        check_keys(sections[name], keys, f"{where}, [{name}]", "key")
    motor, winding, vehicle, adequacy, population = (sections[name] for name in KEYS)
    sisters = next_of_population(population, where)
    effects = _effects(_section(content, "model", where), where)
    if "name" not in motor:
        raise InputError(
            "Expected the name of the motor, found none.",
            where=f"{where}, [motor]",
            remedy='Add: name = "…".',
        )
    at, at_winding, at_vehicle, at_adequacy, _ = (f"{where}, [{name}]" for name in KEYS)
    return Motor(
        name=text_of(motor, "name", at),
        phases=_phases(motor, at),
        losses=cast(
            Literal["balance", "map"], _choice(motor, "losses", ("balance", "map"), at) or "balance"
        ),
        sink=cast(
            Literal["ambient", "coolant"],
            _choice(motor, "sink", ("ambient", "coolant"), at) or "ambient",
        ),
        insulation_class=_choice(motor, "insulation_class", INSULATION_CLASSES, at),
        rated_speed_rpm=_number(motor, "rated_speed_rpm", POSITIVE, at),
        rated_current_A=_number(motor, "rated_current_A", POSITIVE, at),
        resistance_coefficient_degC=_coefficient(winding, at_winding),
        mass_kg=_number(motor, "mass_kg", POSITIVE, at),
        conductor_mass_kg=_conductor_mass(winding, motor, where),
        phase_resistance_ohm=_number(winding, "phase_resistance_ohm", POSITIVE, at_winding),
        reference_temperature_degC=_or_default(
            _number(winding, "reference_temperature_degC", REFERENCE_RANGE, at_winding),
            Motor.reference_temperature_degC,
        ),
        measured_resistance_ohm=_number(winding, "measured_resistance_ohm", POSITIVE, at_winding),
        lead_resistance_ohm=_leads(winding, at_winding),
        gear_ratio=_number(vehicle, "gear_ratio", POSITIVE, at_vehicle),
        wheel_radius_m=_number(vehicle, "wheel_radius_m", POSITIVE, at_vehicle),
        columns=parse_columns(_section(content, "columns", where), where),
        constants=_constants(_section(content, "constants", where), where),
        parameters={
            **sisters.parameters,
            **_parameters(_section(content, "parameters", where), where),
        },
        sensors=_sensors(_section(content, "sensors", where), where),
        tests=parse_parts(_section(content, "tests", where), where),
        effects=tuple(dict.fromkeys((*effects, *sisters.effects))),
        adequacy=_adequacy(adequacy, sisters.unmodelled_heat, at_adequacy),
        certificate=parse_certificate(_section(content, "certificate", where), where),
        raster_s=_number(motor, "raster_s", POSITIVE, at),
        decimal=cast(Literal[".", ","] | None, _choice(motor, "decimal", (".", ","), at)),
        sha256=hashlib.sha256(data).hexdigest(),
        path=where,
    )


def _section(content: Mapping[str, Any], name: str, where: str) -> Mapping[str, Any]:
    section = content.get(name, {})
    if not isinstance(section, dict):
        raise InputError(
            f"Expected a section, got {shown(section)}.",
            where=f"{where}, {name}",
            remedy=f"Write [{name}] on a line of its own.",
        )
    return section


def _choice(
    section: Mapping[str, Any], key: str, choices: tuple[str, ...], where: str
) -> str | None:
    if key not in section:
        return None
    value = section[key]
    if value not in choices:
        near = did_you_mean(value, choices) if isinstance(value, str) else ""
        raise InputError(
            f"Expected one of {', '.join(choices)} for {key}, got {shown(value)}. {near}".strip(),
            where=where,
            remedy=f'Write {key} = "{choices[0]}", for example.',
        )
    return value


def _number(section: Mapping[str, Any], key: str, limits: Limits, where: str) -> float | None:
    if key not in section:
        return None
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


def _or_default(value: float | None, default: float) -> float:
    return default if value is None else value


def _phases(motor: Mapping[str, Any], where: str) -> int:
    value = motor.get("phases", Motor.phases)
    if isinstance(value, int) and value > MOST_PHASES:
        raise InputError(f"Expected at most {MOST_PHASES} phases, got {shown(value)}.", where=where)
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise InputError(
            f"Expected a whole number of phases above 0, got {shown(value)}.",
            where=where,
            remedy="Write phases = 3.",
        )
    return value


def _coefficient(winding: Mapping[str, Any], where: str) -> float:
    material = _choice(winding, "material", tuple(COEFFICIENTS_degC), where)
    coefficient = _number(winding, "resistance_coefficient_degC", COEFFICIENT_RANGE, where)
    if material is not None and coefficient is not None:
        raise InputError(
            f"Both material = '{material}' ({COEFFICIENTS_degC[material]:g} degC) and "
            f"resistance_coefficient_degC = {coefficient:g} are given.",
            where=where,
            remedy="Keep one of them.",
        )
    if coefficient is not None:
        return coefficient
    return COEFFICIENTS_degC[material or "copper"]


def _conductor_mass(
    winding: Mapping[str, Any], motor: Mapping[str, Any], where: str
) -> float | None:
    """Return the mass of the conductor [kg], which is a part of that of the machine."""
    conductor = _number(winding, "conductor_mass_kg", POSITIVE, f"{where}, [winding]")
    whole = _number(motor, "mass_kg", POSITIVE, f"{where}, [motor]")
    if conductor is not None and whole is not None and conductor >= whole:
        raise InputError(
            f"Expected conductor_mass_kg below mass_kg, got {conductor:g} of {whole:g} kg.",
            where=f"{where}, [winding]",
            remedy="Write both in kg; mass_kg is that of the whole machine.",
        )
    return conductor


def _leads(winding: Mapping[str, Any], where: str) -> float:
    """Return the resistance of the leads [ohm], which is a part of the measured one."""
    leads = _number(winding, "lead_resistance_ohm", NOT_NEGATIVE, where) or 0.0
    whole = _number(winding, "measured_resistance_ohm", POSITIVE, where)
    if whole is not None and leads >= whole:
        raise InputError(
            f"Expected lead_resistance_ohm below measured_resistance_ohm, got {leads:g} of "
            f"{whole:g} ohm.",
            where=where,
            remedy="Write both in ohm; measured_resistance_ohm is that of winding and leads.",
        )
    return leads


def _effects(section: Mapping[str, Any], where: str) -> tuple[str, ...]:
    at = f"{where}, [model]"
    check_keys(section, ("effects",), at, "key")
    effects = section.get("effects", [])
    if not isinstance(effects, list) or not all(isinstance(e, str) for e in effects):
        raise InputError(
            f"Expected a list of effects, got {shown(effects)}.",
            where=at,
            remedy='Write effects = ["speed_cooling"]; the ids stand in the README.',
        )
    return tuple(effects)


def _constants(section: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return the value of each channel that is constant."""
    at = f"{where}, [constants]"
    known = [name for name in CHANNEL if name not in ("time_s", "winding_degC")]
    check_keys(section, known, at, "channel")
    values = {name: _number(section, name, ANY_NUMBER, at) for name in section}
    return {name: value for name, value in values.items() if value is not None}


def _sensors(section: Mapping[str, Any], where: str) -> dict[str, str]:
    """Return the node of each measured body by its channel."""
    at = f"{where}, [sensors]"
    check_keys(section, BODIES, at, "channel")
    return {channel: text_of(section, channel, at) for channel in section}


def _adequacy(section: Mapping[str, Any], of_sisters: float | None, where: str) -> Adequacy:
    usual = Adequacy()
    heat = _or_default(of_sisters, usual.unmodelled_heat)
    return Adequacy(
        unmodelled_heat=_or_default(_number(section, "unmodelled_heat", HEAT_RANGE, where), heat),
        heat_time_s=_or_default(
            _number(section, "heat_time_s", HEAT_TIME_RANGE, where), usual.heat_time_s
        ),
    )


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
    finite: Limits = (-math.inf, math.inf, "to be finite")
    return ParameterOverride(
        fixed=_number(keys, "fixed", finite, where),
        value=_number(keys, "value", finite, where),
        relative_sd=_number(keys, "relative_sd", POSITIVE, where),
        sd=_number(keys, "sd", POSITIVE, where),
        per_test=per_test,
    )
