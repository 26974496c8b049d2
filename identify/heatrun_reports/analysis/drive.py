"""What the drive of a record did: electrical power, road speed, integrals, losses split.

The operating map spreads power and efficiency over the torque-speed plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from heatrun.checks.time_axis import GAP_STEPS
from heatrun.errors import InputError
from heatrun.record.derive import RAD_PER_S_PER_RPM, dq_power, shaft_power
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import has, median_step, samples

KM_PER_H_PER_M_PER_S = 3.6

DC = "at the DC link: the losses of the inverter are in it"
TERMINALS = "at the motor's terminals: the losses of the inverter are not in it"


@dataclass(frozen=True)
class Course:
    """A quantity over the time of a record, and the formula behind it for the report."""

    values: Float[np.ndarray, " time"]
    formula: str


def electrical_power(record: Record, motor: Motor) -> Course:
    """Return the electrical power drawn [W], positive when the motor drives.

    Taken, in this order, from DC voltage times DC current, DC power, power at the terminals, or
    voltages and currents in d and q of so many phases as the motor has.

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
        f"i_d_A and i_q_A for the electrical power; the channels are {', '.join(record.channels)}.",
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

    Raises:
        InputError: If no speed was recorded, or gear ratio or wheel radius is missing for it.
    """
    if has(record, "vehicle_speed_km_per_h"):
        values = record["vehicle_speed_km_per_h"] / KM_PER_H_PER_M_PER_S
        return Course(values, "v = vehicle_speed_km_per_h / 3.6")
    if not has(record, "speed_rpm"):
        raise InputError(
            "Expected vehicle_speed_km_per_h or speed_rpm for the distance; the channels are "
            f"{', '.join(record.channels)}.",
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


def measured(record: Record, *values: Float[np.ndarray, " time"]) -> tuple[np.ndarray, ...]:
    """Return time and values over the time of a record, where all are; as `samples`."""
    columns = {f"values_{place}": each for place, each in enumerate(values)}
    return samples(Record(record.name, {"time_s": record.time_s, **columns}), *columns)


@dataclass(frozen=True)
class Integral:
    """An integral over time, its parts above and below zero apart."""

    positive: float  # Integral of the part above zero [unit of the values times s].
    negative: float  # Integral of the part below zero, not above 0 [the same].
    covered_s: float  # Time that was integrated over [s].
    left_out_s: float  # Time in gaps, which was not [s].
    num_gaps: int  # Number of gaps.

    @property
    def net(self) -> float:
        """The integral itself."""
        return self.positive + self.negative

    @property
    def absolute(self) -> float:
        """The integral of the magnitude."""
        return self.positive - self.negative


def bridged_steps(time_s: Float[np.ndarray, " time"]) -> Float[np.ndarray, " step"]:
    """Return the steps of a time axis [s], those across a gap as 0."""
    steps = np.diff(time_s)
    return np.where(steps <= GAP_STEPS * median_step(time_s), steps, 0.0)


def weights(time_s: Float[np.ndarray, " time"]) -> Float[np.ndarray, " time"]:
    """Return the time that each sample stands for [s], by trapezoids; gaps left out."""
    steps = bridged_steps(time_s)
    return 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))


def integrate(time_s: Float[np.ndarray, " time"], values: Float[np.ndarray, " time"]) -> Integral:
    r"""Return the trapezoidal integral of samples over their own time axis, by sign.

    $$ \int x\,dt = \sum_i \tfrac12 (x_i + x_{i+1})(t_{i+1} - t_i) $$

    Between two samples of different sign the straight line's zero is one more point, so that the
    part above zero is not counted too high. A step above three usual ones is a gap: nothing is
    known of the values in it, so it adds nothing, and its length is returned.
    """
    steps = np.diff(time_s)
    bridged = bridged_steps(time_s)
    start, end = values[:-1], values[1:]
    span = np.abs(start) + np.abs(end)
    crosses = start * end < 0.0
    at_crossing = np.maximum(start, end) ** 2 / (2.0 * np.where(crosses, span, 1.0))
    mean = 0.5 * (start + end)
    above = np.where(crosses, at_crossing, np.maximum(mean, 0.0))
    return Integral(
        positive=float(np.sum(above * bridged)),
        negative=float(np.sum((mean - above) * bridged)),
        covered_s=float(np.sum(bridged)),
        left_out_s=float(np.sum(steps[bridged == 0.0])),
        num_gaps=int(np.sum(bridged == 0.0)),
    )


@dataclass(frozen=True)
class LossSplit:
    """P_Js of the winding, P_ol of iron, magnets and friction [W], and the formula behind them."""

    joule_W: Float[np.ndarray, " time"]
    other_W: Float[np.ndarray, " time"]
    formula: str


def split_losses(record: Record, motor: Motor) -> LossSplit:
    r"""Split the losses by the measured winding temperature.

    $$ P_{Js} = m I_s^2 R_{s0} \frac{B + T_w}{B + T_{ref}}, \quad P_{ol} = P_d - P_{Js} $$

    Where the motor file calls the losses a map, they are P_ol already.

    Raises:
        InputError: If `phase_current_A`, `losses_W`, `winding_degC` or the phase resistance is
            missing.
    """
    needed = ("phase_current_A", "losses_W", "winding_degC")
    missing = [channel for channel in needed if not has(record, channel)]
    if missing:
        raise InputError(
            f"The losses cannot be split without {' and '.join(missing)}.",
            where=record.name,
            remedy=f'Map it in the motor file: [columns] {missing[0]} = "name in the file [unit]".',
        )
    if motor.phase_resistance_ohm is None:
        raise InputError(
            "The losses cannot be split without the phase resistance.",
            where=motor.path or motor.name,
            remedy="Give [winding] phase_resistance_ohm.",
        )
    B, T_ref = motor.resistance_coefficient_degC, motor.reference_temperature_degC
    joule = motor.copper_loss_W(record["phase_current_A"], record["winding_degC"])
    formula = (
        f"P_Js = {motor.phases}·Is²·{motor.phase_resistance_ohm:g} Ω·({B:g} + Tw)/"
        f"({B:g} + {T_ref:g}), "
    )
    if motor.losses == "map":
        return LossSplit(joule, record["losses_W"], formula + "P_ol = losses_W, from a map")
    return LossSplit(joule, record["losses_W"] - joule, formula + "P_ol = Pd − P_Js")


NUM_CELLS = 16
"""Cells along each axis [1]: some 400 rpm wide on a traction motor, and still filled by a test."""


@dataclass(frozen=True)
class OperatingMap:
    """Means over cells of the torque-speed plane; NaN where the test never was."""

    speed_rpm: Float[np.ndarray, " edge"]  # Edges of the cells [rpm], shape (cell + 1,).
    torque_Nm: Float[np.ndarray, " edge"]  # Edges of the cells [N m], shape (cell + 1,).
    # Mean electrical power [W], shape (torque cell, speed cell).
    power_W: Float[np.ndarray, "torque speed"]
    # Output over input energy [1], shape as `power_W`; as a motor mechanical over electrical, as a
    # generator electrical over mechanical, NaN where the signs differ.
    efficiency: Float[np.ndarray, "torque speed"]


def operating_map(record: Record, motor: Motor) -> OperatingMap | None:
    """Return power and efficiency over the torque-speed plane.

    Energies are summed over each cell before they are divided, so that a cell's efficiency is that
    of its energy, not a mean of ratios. None without torque, speed, electrical power or any spread
    of them.
    """
    if not has(record, "torque_Nm", "speed_rpm"):
        return None
    try:
        power = electrical_power(record, motor)
    except InputError:
        return None
    columns = record["speed_rpm"], record["torque_Nm"], power.values
    time_s, speed, torque, electrical = measured(record, *columns)
    if time_s.size < 2 or not (np.ptp(speed) > 0.0 and np.ptp(torque) > 0.0):
        return None
    weight = weights(time_s)
    mechanical = torque * speed * RAD_PER_S_PER_RPM
    edges = [np.linspace(v.min(), v.max(), NUM_CELLS + 1) for v in (torque, speed)]

    def total(values: np.ndarray) -> np.ndarray:
        return np.histogram2d(torque, speed, bins=edges, weights=values * weight)[0]

    dwell, input_J, shaft_J = total(np.ones_like(speed)), total(electrical), total(mechanical)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.where(dwell > 0.0, input_J / dwell, np.nan)
        efficiency = np.where(
            (input_J > 0.0) & (shaft_J > 0.0),
            shaft_J / input_J,
            np.where((input_J < 0.0) & (shaft_J < 0.0), input_J / shaft_J, np.nan),
        )
    return OperatingMap(speed_rpm=edges[1], torque_Nm=edges[0], power_W=mean, efficiency=efficiency)


def above_one(record: Record, efficiency: np.ndarray) -> tuple[Finding, ...]:
    """Return a finding on efficiencies [1] of cells or ranges that cannot be, NaN left out."""
    above = int(np.sum(efficiency > 1.0))
    if above == 0:
        return ()
    return (
        Finding(
            "efficiency_above_one",
            "warning",
            f"Expected efficiencies below 100 %; {above} of {np.sum(np.isfinite(efficiency))} "
            f"cells lie above, up to {100.0 * np.nanmax(efficiency):.0f} %.",
            f"{record.name}, torque_Nm, speed_rpm",
            "Check units and zero of torque, speed and power, and that their logs are in time.",
            record.name,
            {"num_cells": float(above)},
        ),
    )
