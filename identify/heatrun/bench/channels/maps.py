"""The column names of known benches and programs, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from .schema import CHANNELS


@dataclass(frozen=True)
class ColumnMap:
    """How one kind of bench names its columns.

    Labels are compared without their unit, first as written, then without regard to case.

    Attributes:
        name: What the map is called in notes.
        entries: Label of the column (without unit) to canonical channel.
        units: Unit of a label where the file gives none; without an entry, the canonical unit.
        num_needed: So many labels of `entries` and `refused` must be present for the map to hold.
        zero_means_absent: Labels that hold zeros alone when the bench did not record them.
        refused: Labels that look like a channel and are none, with the reason.
    """

    name: str
    entries: Mapping[str, str]
    units: Mapping[str, str] = field(default_factory=dict)
    num_needed: int = 1
    zero_means_absent: frozenset[str] = frozenset()
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
    {
        "t": "time_s",
        "Is": "phase_current_A",
        "P": "losses_W",
        "Tw": "winding_degC",
    },
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
    CANONICAL_STEMS,
    TIME_NAMES,
)
"""In order of precedence; a channel found by one is not looked for by the next."""
