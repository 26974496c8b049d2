"""What the drive of a record did: electrical power and road speed, from whatever was recorded."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from heatrun.bench.channels.derive import dq_power, shaft_power
from heatrun.bench.checks.samples import samples
from heatrun.bench.record import Record
from heatrun.errors import InputError
from heatrun.motor import Motor

KM_PER_H_PER_M_PER_S = 3.6

DC = "at the DC link: the losses of the inverter are in it"
TERMINALS = "at the motor's terminals: the losses of the inverter are not in it"


@dataclass(frozen=True)
class Course:
    """A quantity over the time of a record, and the formula behind it.

    Attributes:
        values: Shape (time,).
        formula: For the report.
    """

    values: Float[np.ndarray, " time"]
    formula: str


def has(record: Record, *channels: str) -> bool:
    """Return whether a record holds a measured sample, with a time, of each channel."""
    return all(samples(record, channel)[0].size > 0 for channel in channels)


def electrical_power(record: Record, motor: Motor) -> Course:
    """Return the electrical power drawn [W], positive when the motor drives.

    Taken, in this order, from DC voltage times DC current, DC power, power at the terminals, or
    voltages and currents in d and q.

    Args:
        record: Any record.
        motor: Gives the number of phases.

    Raises:
        InputError: If none of them was recorded.
    """
    if has(record, "dc_voltage_V", "dc_current_A"):
        values = record["dc_voltage_V"] * record["dc_current_A"]
        return Course(values, f"P = dc_voltage_V · dc_current_A, {DC}")
    if has(record, "dc_power_W"):
        return Course(record["dc_power_W"], f"P = dc_power_W, {DC}")
    if has(record, "electrical_power_W"):
        return Course(record["electrical_power_W"], f"P = electrical_power_W, {TERMINALS}")
    if has(record, "u_d_V", "u_q_V", "i_d_A", "i_q_A"):
        values = dq_power(record.channels, motor.phases)
        return Course(values, f"P = phases/2 · (u_d·i_d + u_q·i_q), {TERMINALS}")
    raise InputError(
        "Expected dc_voltage_V and dc_current_A, dc_power_W, electrical_power_W, or u_d_V, u_q_V, "
        f"i_d_A and i_q_A for the electrical power; the channels are {_listed(record)}.",
        where=record.name,
        remedy='Map them in the motor file, such as [columns] dc_voltage_V = "U_dc [V]".',
    )


def is_of_vehicle(record: Record, motor: Motor) -> bool:
    """Return whether a machine drives a vehicle: its speed was recorded, or a gear is stated."""
    stated = (motor.gear_ratio, motor.wheel_radius_m)
    return has(record, "vehicle_speed_km_per_h") or any(value is not None for value in stated)


def road_speed(record: Record, motor: Motor) -> Course:
    r"""Return the speed of the vehicle [m/s], negative in reverse.

    Recorded, or from the motor's speed: $v = 2\pi n / 60 \cdot r / i$ with the gear ratio i and
    the rolling radius r of the motor file, without slip.

    Args:
        record: Any record.
        motor: Gives gear ratio and wheel radius.

    Raises:
        InputError: If no speed was recorded, or gear ratio or wheel radius is missing for it.
    """
    if has(record, "vehicle_speed_km_per_h"):
        values = record["vehicle_speed_km_per_h"] / KM_PER_H_PER_M_PER_S
        return Course(values, "v = vehicle_speed_km_per_h / 3.6")
    if not has(record, "speed_rpm"):
        raise InputError(
            "Expected vehicle_speed_km_per_h or speed_rpm for the distance; the channels are "
            f"{_listed(record)}.",
            where=record.name,
            remedy='Map one in the motor file, such as [columns] speed_rpm = "n [rpm]".',
        )
    ratio, radius = motor.gear_ratio, motor.wheel_radius_m
    if ratio is None or radius is None:
        lacking = [n for n, v in (("gear_ratio", ratio), ("wheel_radius_m", radius)) if v is None]
        raise InputError(
            f"The distance from the motor's speed needs {' and '.join(lacking)}, which the motor "
            "file does not give.",
            where=motor.path or motor.name,
            remedy="Add [vehicle] gear_ratio = ... and wheel_radius_m = ... (m).",
        )
    values = record["speed_rpm"] * math.pi / 30.0 * radius / ratio
    return Course(values, f"v = 2π·speed_rpm/60 · {radius:g} m / {ratio:g}, no slip")


def with_powers(record: Record, motor: Motor) -> Record:
    """Return a record with DC and mechanical power as channels, where they follow from others."""
    channels = dict(record.channels)
    if "dc_power_W" not in channels and has(record, "dc_voltage_V", "dc_current_A"):
        channels["dc_power_W"] = record["dc_voltage_V"] * record["dc_current_A"]
    if "mechanical_power_W" not in channels and has(record, "torque_Nm", "speed_rpm"):
        channels["mechanical_power_W"] = shaft_power(record.channels)
    return replace(record, channels=channels)


def _listed(record: Record) -> str:
    return ", ".join(record.channels)
