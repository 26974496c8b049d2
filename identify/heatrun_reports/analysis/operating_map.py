"""Power and efficiency over the torque-speed plane, as time-weighted means of cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from heatrun.errors import InputError
from heatrun.record.derive import RAD_PER_S_PER_RPM
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import samples

from .drive import bridged_steps, electrical_power, has

NUM_CELLS = 16
"""Cells along each axis [1]: some 400 rpm wide on a traction motor, and still filled by a test."""


@dataclass(frozen=True)
class OperatingMap:
    """Means over cells of the torque-speed plane; NaN where the test never was.

    Attributes:
        speed_rpm: Edges of the cells [rpm], shape (cell + 1,).
        torque_Nm: Edges of the cells [N m], shape (cell + 1,).
        power_W: Mean electrical power [W], shape (torque cell, speed cell).
        efficiency: Output over input energy [1], shape as `power_W`; as a motor mechanical over
            electrical, as a generator electrical over mechanical, NaN where the signs differ.
    """

    speed_rpm: Float[np.ndarray, " edge"]
    torque_Nm: Float[np.ndarray, " edge"]
    power_W: Float[np.ndarray, "torque speed"]
    efficiency: Float[np.ndarray, "torque speed"]


def operating_map(record: Record, motor: Motor) -> OperatingMap | None:
    """Return power and efficiency over the torque-speed plane.

    Energies are summed over each cell before they are divided, so that a cell's efficiency is that
    of its energy, not a mean of ratios.

    Args:
        record: Any record.
        motor: The machine.

    Returns:
        The map, or None without torque, speed, electrical power or any spread of them.
    """
    if not has(record, "torque_Nm", "speed_rpm"):
        return None
    try:
        power = electrical_power(record, motor)
    except InputError:
        return None
    made = Record(record.name, {**record.channels, "power": power.values})
    time_s, speed, torque, electrical = samples(made, "speed_rpm", "torque_Nm", "power")
    if time_s.size < 2 or not (np.ptp(speed) > 0.0 and np.ptp(torque) > 0.0):
        return None
    steps = bridged_steps(time_s)
    weight = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
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
