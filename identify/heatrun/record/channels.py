"""The canonical channels, and `[columns]` of a motor file: which column of a bench file is which.

A channel has one name, one quantity, one unit and one meaning. Its name carries its unit;
`heatrun.record.units` converts a column to it when a file is read, and nothing converts afterwards.
Behind the channels stand the column names of known benches and programs, the scalars of a file, and
the lines of `[columns]`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError, did_you_mean
from .header import split_name
from .motor import Motor
from .record import Finding


@dataclass(frozen=True)
class Channel:
    """One quantity that a bench may record."""

    name: str  # Canonical name, with the unit at its end.
    quantity: str  # Key of `heatrun.record.units.QUANTITIES`.
    unit: str  # Canonical unit, as it is printed.
    meaning: str  # One sentence for lists and reports.


CHANNELS: tuple[Channel, ...] = (
    Channel("time_s", "time", "s", "Time from the first sample of the test"),
    Channel("phase_current_A", "phase current", "A", "Phase current, rms"),
    Channel("losses_W", "power", "W", "Losses that heat the machine (Pd, or Pol from a map)"),
    Channel("ambient_degC", "temperature", "degC", "Air around the machine"),
    Channel("winding_degC", "temperature", "degC", "Winding, as its sensor reads"),
    Channel("speed_rpm", "speed", "rpm", "Mechanical speed of the shaft"),
    Channel("torque_Nm", "torque", "Nm", "Torque at the shaft, positive as a motor"),
    Channel("stator_degC", "temperature", "degC", "Stator iron or stator body"),
    Channel("yoke_degC", "temperature", "degC", "Stator yoke"),
    Channel("tooth_degC", "temperature", "degC", "Stator tooth"),
    Channel("end_winding_degC", "temperature", "degC", "Winding overhang"),
    Channel("housing_degC", "temperature", "degC", "Housing"),
    Channel("rotor_degC", "temperature", "degC", "Rotor"),
    Channel("magnet_degC", "temperature", "degC", "Permanent magnets"),
    Channel("bearing_degC", "temperature", "degC", "Bearing"),
    Channel("controller_degC", "temperature", "degC", "Inverter or speed controller"),
    Channel("coolant_degC", "temperature", "degC", "Coolant at the inlet"),
    Channel("coolant_out_degC", "temperature", "degC", "Coolant at the outlet"),
    Channel("coolant_flow_L_per_min", "flow", "L/min", "Coolant flow"),
    Channel("fan", "fraction", "1", "Fan: 0 off, 1 full"),
    Channel("dc_voltage_V", "voltage", "V", "Voltage of the DC link"),
    Channel("dc_current_A", "direct current", "A", "Current of the DC link, mean"),
    Channel("dc_power_W", "power", "W", "Power from the DC link"),
    Channel("electrical_power_W", "power", "W", "Power into the motor's terminals"),
    Channel("mechanical_power_W", "power", "W", "Power at the shaft, positive as a motor"),
    Channel("efficiency", "fraction", "1", "Power at the shaft over the power that goes in"),
    Channel("u_d_V", "voltage", "V", "d-axis voltage, amplitude-invariant"),
    Channel("u_q_V", "voltage", "V", "q-axis voltage, amplitude-invariant"),
    Channel("i_d_A", "dq current", "A", "d-axis current, amplitude-invariant"),
    Channel("i_q_A", "dq current", "A", "q-axis current, amplitude-invariant"),
    Channel(
        "winding_resistance_ohm",
        "resistance",
        "ohm",
        "Resistance of the winding, from which winding_degC follows",
    ),
    Channel(
        "winding_voltage_V",
        "voltage",
        "V",
        "Direct voltage over the winding, which with the current gives its resistance",
    ),
    Channel("vehicle_speed_km_per_h", "velocity", "km/h", "Speed of the vehicle"),
)
"""Every channel that heatrun knows, those that a fit needs first."""

BODIES: tuple[str, ...] = (
    "stator_degC",
    "tooth_degC",
    "yoke_degC",
    "end_winding_degC",
    "housing_degC",
    "rotor_degC",
    "magnet_degC",
    "bearing_degC",
    "coolant_out_degC",
)
"""Temperatures of bodies beside the winding."""

OF_LOAD = ("phase current", "dq current", "direct current", "power", "torque", "speed", "voltage")
"""Quantities that are the load."""

READINGS: tuple[str, ...] = ("winding_degC", *BODIES)
"""Temperatures that a fit compares."""


def body_name(channel: str) -> str:
    """Return the name of a measured body, such as `"stator"` for its channel."""
    return channel.removesuffix("_degC")


CHANNEL: dict[str, Channel] = {channel.name: channel for channel in CHANNELS}
"""The same by name."""

REQUIRED: tuple[str, ...] = (
    "time_s",
    "phase_current_A",
    "losses_W",
    "ambient_degC",
    "winding_degC",
)
"""The channels that a fit of the two-node network needs."""


@dataclass(frozen=True)
class ColumnMap:
    """How one kind of bench names its columns.

    Labels are compared without their unit, first as written, then without regard to case.
    """

    name: str  # What the map is called in notes.
    entries: Mapping[str, str]  # Label of the column (without unit) to canonical channel.
    # Unit of a label where the file gives none; without an entry, the canonical unit.
    units: Mapping[str, str] = field(default_factory=dict)
    # So many labels of `entries` and `refused` must be present for the map to hold.
    num_needed: int = 1
    # Labels that hold zeros alone when the bench did not record them.
    zero_means_absent: frozenset[str] = frozenset()
    # Labels that look like a channel and are none, with the reason.
    refused: Mapping[str, str] = field(default_factory=dict)


THESIS = ColumnMap(
    "thesis (t, Is, Pd, Te, Tw_m)",
    {
        "t": "time_s",
        "Is": "phase_current_A",
        "Pd": "losses_W",
        "Te": "ambient_degC",
        "Tw_m": "winding_degC",
    },
    num_needed=3,
)

COMPUTED = "the worksheet computes it from the measured columns"

WORKSHEET = ColumnMap(
    "thesis worksheet (t, Tw, P, Is)",
    {"t": "time_s", "Is": "phase_current_A", "P": "losses_W", "Tw": "winding_degC"},
    num_needed=7,
    refused={
        "Tw mod": "it holds the mean of the ambient in its first row alone",
        **dict.fromkeys(("Req DC", "Rs", "Pjs", "Pol"), COMPUTED),
    },
)

PADERBORN = ColumnMap(
    "Paderborn electric motor temperature",
    {
        "u_d": "u_d_V",
        "u_q": "u_q_V",
        "i_d": "i_d_A",
        "i_q": "i_q_A",
        "motor_speed": "speed_rpm",
        "torque": "torque_Nm",
        "coolant": "coolant_degC",
        "ambient": "ambient_degC",
        "stator_winding": "winding_degC",
        "stator_tooth": "tooth_degC",
        "stator_yoke": "yoke_degC",
        "pm": "magnet_degC",
    },
    num_needed=4,
)

THERMOCOUPLES = ColumnMap(
    "thermocouple logger",
    {
        "Time": "time_s",
        "Winding Temp": "winding_degC",
        "Stator Body": "stator_degC",
        "Housing": "housing_degC",
        "Ambient": "ambient_degC",
    },
    num_needed=3,
)

SPEED_CONTROLLER = ColumnMap(
    "speed controller",
    {
        "Voltage": "dc_voltage_V",
        "Current": "dc_current_A",
        "Power": "dc_power_W",
        "Temperature": "controller_degC",
        "Phase Current": "phase_current_A",
    },
    num_needed=5,
    zero_means_absent=frozenset({"Phase Current"}),
    refused={
        "eRPM": "it is the electrical speed, the shaft's times the pole pairs",
        "Motor Duty": "it is the modulation of the inverter, no speed and no torque",
    },
)

MOTEUS = ColumnMap(
    "moteus servo controller",
    {
        "velocity": "speed_rpm",
        "torque": "torque_Nm",
        "q_current": "i_q_A",
        "d_current": "i_d_A",
        "voltage": "dc_voltage_V",
        "temperature": "controller_degC",  # of the board
    },
    units={"velocity": "rev/s"},
    num_needed=5,
)

CANONICAL_STEMS = ColumnMap(
    "canonical name with another unit",
    {channel.name.removesuffix(f"_{channel.unit}"): channel.name for channel in CHANNELS}
    | {"coolant_flow": "coolant_flow_L_per_min", "vehicle_speed": "vehicle_speed_km_per_h"},
)

TIME_NAMES = ColumnMap(
    "names of the time",
    dict.fromkeys(
        (
            *("t", "timestamp", "time stamp", "elapsed time", "date time", "datetime", "date/time"),
            "x_value",  # of LabVIEW
            *("时间", "时刻", "時間", "時刻", "経過時間", "시간", "время"),
            *("zeit", "uhrzeit", "tempo", "temps", "tiempo"),
        ),
        "time_s",
    ),
)

COLUMN_MAPS: tuple[ColumnMap, ...] = (
    THESIS,
    WORKSHEET,
    PADERBORN,
    THERMOCOUPLES,
    SPEED_CONTROLLER,
    MOTEUS,
    CANONICAL_STEMS,
    TIME_NAMES,
)
"""In order of precedence; a channel found by one is not looked for by the next."""


MEANINGS: Mapping[str, str] = {
    "B": "B of the R(T) law [degC]",
    "Rrif": "3 times the phase resistance at Trif [ohm]",
    "Trif": "temperature that Rrif holds for [degC]",
    "Ceqw": "Ceq_w [J/K]",
    "Ceqsr": "Ceq_sr [J/K]",
    "Reqw": "Req_w [K/W]",
    "Reqsr": "Req_sr [K/W]",
    "Two": "winding temperature at the start [degC]",
    "Tso": "stator temperature at the start [degC]",
}
"""The scalars of the thesis' `prova.mat`."""

TOLERANCE = 0.01
"""Two statements of one resistance may differ by this share: more is no rounding any longer."""


def constant_notes(constants: Mapping[str, float]) -> tuple[str, ...]:
    """Return a sentence for each scalar of a file."""
    return tuple(
        f"Constant of the file: {name} = {value:g}"
        + (f", {MEANINGS[name]}." if name in MEANINGS else ".")
        for name, value in constants.items()
    )


def resistance_conflict(
    constants: Mapping[str, float], motor: Motor, where: str
) -> Iterator[Finding]:
    """Yield a finding if `Rrif` of a file and the motor file are another phase resistance."""
    if motor.phase_resistance_ohm is None or not {"Rrif", "Trif"} <= constants.keys():
        return
    in_file = constants["Rrif"] / 3.0
    ratio = float(motor.resistance_ratio(np.asarray(constants["Trif"])))
    expected = motor.phase_resistance_ohm * ratio
    if abs(in_file - expected) > TOLERANCE * expected:
        yield Finding(
            "resistance_conflict",
            "warning",
            f"Rrif/3 is {in_file:.4g} ohm at {constants['Trif']:g} degC; the motor file "
            f"gives {expected:.4g} ohm there, which is used.",
            where,
            "Check phase_resistance_ohm in [winding].",
            values={"file_ohm": in_file, "motor_ohm": expected},
        )


COMBINED = re.compile(
    r"(?P<how>mean|hottest|sum)\s*\((?P<parts>[^()]*(?:\([^()]*\)[^()]*)*)\)(?:\s*\[(?P<unit>[^\[\]]+)\])?",
    re.DOTALL,
)
"""Right-hand side of `[columns]`; a unit behind it holds for all of its columns."""

COMBINES = {
    "mean": ("temperature", "phase current", "resistance"),
    "hottest": ("temperature",),
    "sum": ("power",),
}
"""Quantities of which several columns make one channel, by how they do."""

MOST_PARTS = 64


def split_parts(text: str) -> list[str]:
    """Return the columns between the brackets; a comma inside brackets separates none."""
    return [part.strip() for part in re.split(r",(?![^\[(]*[\])])", text)]


def columns_named(text: str) -> list[str]:
    """Return the columns that a right-hand side of `[columns]` names, with their units."""
    several = COMBINED.fullmatch(text.strip())
    return [text] if several is None else [text, *split_parts(several["parts"])]


def refuse_combination(channel: str, how: str, num_parts: int, where: str) -> None:
    """Refuse what cannot be combined.

    Raises:
        InputError: If the channel is not of a quantity that is combined so, or fewer than two
            columns are named.
    """
    if CHANNEL[channel].quantity not in COMBINES[how]:
        raise InputError(
            f"Expected one column for {channel}, got {how}(…).",
            where=where,
            remedy="mean(…) is for temperatures, resistances and phase currents, hottest(…) for "
            "temperatures, sum(…) for powers.",
        )
    if not 2 <= num_parts <= MOST_PARTS:
        raise InputError(
            f"Expected 2 to {MOST_PARTS} columns in {how}(…), got {num_parts}.",
            where=where,
            remedy="Write the names with commas between them, as in mean(T_U, T_V, T_W).",
        )


NOT_RECORDED = "none"
"""Right-hand side of `[columns]` by which no column becomes the channel."""

BRACKET_AT_END = re.compile(r"(?P<base>.*\S)\s*\[(?P<unit>[^\[\]]+)\]", re.DOTALL)
RATE = re.compile(r"^rate\s+(?P<rate>[0-9.eE+-]+)\s*Hz$", re.IGNORECASE)


@dataclass(frozen=True)
class Claim:
    """What one line of `[columns]` says."""

    channel: str  # Canonical name.
    text: str  # The right-hand side as written.
    label: str  # Its column name without the unit.
    unit: str | None  # Its unit text, or None.
    # What stands before square brackets at its end, whatever it is; empty without them.
    base: str = ""
    bracket: str = ""  # What stands in them.
    rate_Hz: float | None = None  # Sampling rate that stands for a time column [Hz], or None.
    how: str = ""  # `"mean"`, `"hottest"` or `"sum"` of several columns; empty for one.
    parts: tuple[Claim, ...] = ()  # What it says of each of them.
    is_choice: bool = False  # It is one of several that hold in the files that have them.


Columns = Mapping[str, str | tuple[str, ...]]
"""`[columns]`: canonical channel to a right-hand side, or to several of which the first counts
whose column a file has."""


def lines_of(columns: Columns | None) -> Iterator[tuple[str, str]]:
    """Yield each channel with each of its right-hand sides."""
    for channel, said in (columns or {}).items():
        for text in (said,) if isinstance(said, str) else said:
            yield channel, text


def parse_claims(columns: Columns, where: str) -> tuple[Claim, ...]:
    """Return what `[columns]` says, in its order; one claim for each of several right-hand sides.

    `"none"` leaves a channel out, and `time_s` may also be `"rate 10 Hz"`.

    Raises:
        InputError: If a channel is not known or a rate is not positive. Units are checked where
            a column is converted, since brackets may be part of its name.
    """
    claims = []
    for channel, text in lines_of(columns):
        if channel not in CHANNEL:
            raise InputError(
                f"[columns] names the channel '{channel}', which is not known. "
                f"{did_you_mean(channel, CHANNEL)}".strip(),
                where=where,
                remedy=f"Channels are: {', '.join(CHANNEL)}.",
            )
        rate = RATE.match(text.strip())
        if rate and channel == "time_s":
            claim = Claim(channel, text, text, None, rate_Hz=_rate(rate["rate"], where))
        else:
            claim = _claim(channel, text.strip(), f"{where}, [columns] {channel}")
        claims.append(replace(claim, is_choice=not isinstance(columns[channel], str)))
    return tuple(claims)


def _claim(channel: str, text: str, where: str) -> Claim:
    several = COMBINED.fullmatch(text)
    if several is not None:
        named = split_parts(several["parts"])
        refuse_combination(channel, several["how"], len(named), where)
        unit = f" [{several['unit']}]" if several["unit"] else ""
        parts = tuple(
            _claim(channel, part if BRACKET_AT_END.fullmatch(part) else f"{part}{unit}", where)
            for part in named
        )
        return Claim(channel, text, text, None, how=several["how"], parts=parts)
    base = BRACKET_AT_END.fullmatch(text)
    pair = (base["base"], base["unit"].strip()) if base else ("", "")
    return Claim(channel, text, *split_name(text, where), *pair)


CALL = re.compile(r"[^\W\d]\w*\s*\(.*\)(?:\s*\[[^\[\]]+\])?", re.DOTALL)
DIFFERENCE = re.compile(r"\s[-\u2212]\s")
ARITHMETIC = re.compile(r"\s[-+*/\u2212\u00d7]\s|[*\u00d7]")


def instead_of(claim: Claim) -> str:
    """Return how to write what a line of `[columns]` asks for that is no column; or nothing."""
    text = claim.text
    if claim.channel == "time_s" and re.match(r"rate\b", text, re.IGNORECASE):
        return 'A rate is stated in hertz: time_s = "rate 10 Hz"; 30 a minute are "rate 0.5 Hz".'
    if CALL.fullmatch(text):
        return (
            "Several columns are combined by mean(…), of temperatures, resistances and phase "
            "currents, hottest(…), of temperatures, or sum(…), of powers, and by nothing else."
        )
    if claim.channel == "losses_W" and DIFFERENCE.search(text):
        return (
            "[columns] computes nothing: name both powers, electrical_power_W = … and "
            "mechanical_power_W = …, and the losses are their difference."
        )
    if ARITHMETIC.search(text):
        return (
            "[columns] computes nothing: state the unit of the column, as in "
            f'{claim.channel} = "COLUMN [UNIT]", or compute a column of its own in the file.'
        )
    return ""


def _rate(text: str, where: str) -> float:
    where = f"{where}, [columns] time_s"
    try:
        rate_Hz = float(text)
    except ValueError as error:
        problem = f"Expected a rate such as 'rate 10 Hz', got 'rate {text} Hz'."
        raise InputError(problem, where=where) from error
    return positive_rate(rate_Hz, where)


def positive_rate(rate_Hz: float, where: str) -> float:
    """Return a sampling rate [Hz] if it is one.

    Raises:
        InputError: If the rate is not a positive number.
    """
    if not (math.isfinite(rate_Hz) and rate_Hz > 0):
        raise InputError(
            f"Expected a sampling rate above 0 Hz, got {rate_Hz:g} Hz.",
            where=where,
            remedy="Give the samples per second, such as 10.",
        )
    return rate_Hz
