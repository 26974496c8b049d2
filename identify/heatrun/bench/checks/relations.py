"""Relations between channels that no machine breaks, whatever its size.

A relation compares what belongs to one machine: a time with a size, a power with another, a speed
with a speed. Machines from 1 W to 1 MW differ by a million in watts and by thirty in time, so no
limit here is one of watts or amperes. Where a relation is broken, a unit has been misread as a
rule; `heatrun.bench.checks.suspicion` then tries which.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...motor import Motor
from ..derive import dq_power, shaft_power
from ..record import Record
from .crude_fit import crude_fit
from .losses import COPPER_TOLERANCE, copper_shares
from .one_node import one_node
from .samples import block_means, samples

SHORTEST_S = {"ambient": 25.0, "coolant": 1.5}
"""Time constants [s] at 1 W/K below which no machine lies. In air a motor of 100 g has 50 s in the
wash of its propeller; a coolant may run in the slots themselves."""

LEAST_SHORTEST_S = 5.0
"""And below which none lies at all."""

LARGER, SMALLER = 0.5, 0.25
"""Powers of the conductance in W/K that this goes with, above and below 1 W/K. Heat leaves through
a surface (L²) and is stored in a volume (L³): at one kind of cooling the time constant goes with L,
that is with the root of the conductance. Fan-cooled 1 MW (700 W/K) has 1000 s and more, a
water-cooled traction motor (30 W/K) 100 s, a winding with oil in its slots (100 W/K) 20 s. Small
bodies lose heat better than that: a motor of 3 g (0.01 W/K) has 60 s in still air, and 10 s if the
test shows its winding alone."""

SETTLES = 4.0
"""Time constants [1] that a test must last to call a machine too fast: a shorter one may have shown
its winding alone."""

LONGEST_BY_SIZE_S = 18e3
"""Machines in still air have 600 to 2000 s times the root of the conductance in W/K, from 3 g
(0.01 W/K, 60 s) over 10 kg (3 W/K, 2000 s) to 1 MW (700 W/K, 5 h); nine times as slow is none, even
wrapped up."""

USUAL_BY_SIZE_S = {"ambient": 200.0, "coolant": 40.0}
"""Middle of what machines have [s], again over the root of the conductance in W/K: from fan-cooled
(20) to still air (2000), from oil in the slots (2) to a jacket (800)."""

FROM_USUAL = 20.0
"""Factor [1] within which of it a reading that is to repair a clock must lie."""

LONGEST_S = 360e3
"""100 h; the largest hydro generators take about ten."""

LEAST_PER_TORQUE = 2.0
"""Capacity over the largest torque [J/(K Nm)]: the lightest axial-flux traction motors have 0.05
kg/Nm at peak torque, times 430 J/(kg K) 20, of which the winding alone, all that a short test
shows, is a tenth; servo motors have 450, standard motors 700."""

LEAST_COPPER = 0.005
"""Copper loss over total [1] below which a machine runs without load, if the units are right."""

USUAL_COPPER = 0.1
"""And what a reading that is to repair it must reach."""

LOW_EFFICIENCY = 0.12
"""Best efficiency [1] at which an error of 2 pi/60 in the shaft's power may hide: 1.15/9.55."""

USUAL_EFFICIENCY = 0.5
LOSSES_AGREE = 3.0
"""Factor [1] between losses and the difference of powers; what bearings, the inverter or a
factory calibration leave out is less."""

LEAST_DIFFERENCE = 0.03
"""Below this share of the power [1] the difference of two powers is one of their errors."""

FAST_OVER_RATED = 4.0
"""Speed over rated speed [1]; field weakening ends at three to four."""

KINEMATIC = 0.5
"""Relative difference [1] between the shaft's speed and the wheel's times the gear; a slipping
wheel or a worn tyre makes less."""


@dataclass(frozen=True)
class Conflict:
    """A relation that a record breaks.

    Attributes:
        id: Short name.
        sentence: What was expected and what came.
        channels: The channels between which it holds.
        is_odd: It may be so in a rare machine or test; it counts only where one reading repairs it.
        is_mild: Another kind of cooling than the motor file names would explain it too.
        values: Figures behind it by name with unit suffix.
    """

    id: str
    sentence: str
    channels: tuple[str, ...]
    is_odd: bool
    values: Mapping[str, float]
    is_mild: bool = False


def conflicts(record: Record, motor: Motor, *, is_strict: bool = False) -> tuple[Conflict, ...]:
    """Return the relations that a record breaks.

    Args:
        record: Any record.
        motor: The machine.
        is_strict: Ask for what is usual, not only for what is possible: for a reading that is to
            repair another.
    """
    return (
        *_time_scale(record, motor, is_strict),
        *_copper(record, motor, is_strict),
        *_powers(record, motor, is_strict),
        *_speed(record, motor),
    )


def _time_scale(record: Record, motor: Motor, is_strict: bool) -> list[Conflict]:
    """Time constant and capacity against the size of the machine."""
    seen = one_node(record, motor)
    if seen is None:
        return []
    found = []
    tau, C, G = seen.tau_s, seen.capacity_J_per_K, seen.conductance_W_per_K
    shortest, longest = _shortest(G, motor.sink), LONGEST_S
    if math.isfinite(G):
        root = math.sqrt(G)
        longest = min(longest, LONGEST_BY_SIZE_S * root)
        if is_strict:
            usual = USUAL_BY_SIZE_S[motor.sink] * root
            shortest = max(shortest, usual / FROM_USUAL)
            longest = min(longest, usual * FROM_USUAL)
    values = {"tau_s": tau, "capacity_J_per_K": C, "conductance_W_per_K": G}
    values = {name: value for name, value in values.items() if math.isfinite(value)}
    size = f" at {G:.3g} W/K" if math.isfinite(G) else ""
    came = f"the winding follows with {tau:.3g} s"
    channels = ("time_s", "winding_degC", "losses_W")
    has_settled = seen.duration_s > SETTLES * tau
    if tau < shortest and (is_strict or (has_settled and _stays_short(record, motor, shortest))):
        sentence = f"Expected a time constant above {shortest:.2g} s{size}; {came}."
        is_mild = tau > _shortest(G, "coolant")
        found.append(Conflict("too_fast", sentence, channels, False, values, is_mild))
    if tau > longest:
        sentence = f"Expected a time constant below {longest:.2g} s{size}; {came}."
        found.append(Conflict("too_slow", sentence, channels, False, values))
    torque = samples(record, "torque_Nm")[1]
    peak = float(np.quantile(np.abs(torque), 0.99)) if torque.size else 0.0
    is_light = math.isfinite(C) and LEAST_PER_TORQUE * peak > C
    if is_light and (is_strict or has_settled):
        sentence = (
            f"Expected a heat capacity above {LEAST_PER_TORQUE:.0f} J/K for each Nm of torque; "
            f"{C:.3g} J/K go with {peak:.3g} Nm."
        )
        values = values | {"torque_Nm": peak}
        found.append(Conflict("too_light", sentence, (*channels, "torque_Nm"), False, values))
    return found


def _shortest(conductance_W_per_K: float, sink: str) -> float:
    """Shortest time constant [s] of any machine of a size; without a size that of the smallest."""
    if not math.isfinite(conductance_W_per_K):
        return LEAST_SHORTEST_S
    power = LARGER if conductance_W_per_K > 1.0 else SMALLER
    return max(LEAST_SHORTEST_S, SHORTEST_S[sink] * conductance_W_per_K**power)


def _stays_short(record: Record, motor: Motor, shortest_s: float) -> bool:
    """Whether two masses say the same: one mass takes a short test's winding for the machine."""
    fit = crude_fit(record, motor)
    return fit is None or fit.tau_s < 1.5 * shortest_s


def _copper(record: Record, motor: Motor, is_strict: bool) -> list[Conflict]:
    """Copper loss of the current against the measured total."""
    _, share = copper_shares(record, motor)
    if share.size < 3:
        return []
    typical = float(np.median(share))
    channels = ("phase_current_A", "losses_W")
    values = {"copper_share": typical}
    if float(np.mean(share > 1.0 + COPPER_TOLERANCE)) > 0.5:
        sentence = f"Expected losses above the copper loss; they are {1.0 / typical:.2g} of it."
        return [Conflict("losses_below_copper", sentence, channels, False, values)]
    if typical < (USUAL_COPPER if is_strict else LEAST_COPPER):
        sentence = f"The copper loss is {typical:.2g} of the losses, as without load."
        return [Conflict("little_copper", sentence, channels, True, values)]
    return []


def _electrical(record: Record, motor: Motor) -> str | None:
    """Name of the electrical power that the record has, nearest to the machine first."""
    for name, needs in (
        ("electrical_power_W", ("electrical_power_W",)),
        ("dq", ("u_d_V", "u_q_V", "i_d_A", "i_q_A")),
        ("dc_power_W", ("dc_power_W",)),
        ("dc", ("dc_voltage_V", "dc_current_A")),
    ):
        if all(need in record for need in needs):
            return name
    return None


def _power(record: Record, name: str, phases: int) -> np.ndarray:
    if name == "dq":
        return dq_power(record.channels, phases)
    if name == "dc":
        return record["dc_voltage_V"] * record["dc_current_A"]
    return np.asarray(record[name], dtype=float)


def _powers(record: Record, motor: Motor, is_strict: bool) -> list[Conflict]:
    """Electrical power against the shaft's, and losses against their difference."""
    name = _electrical(record, motor)
    has_shaft = "torque_Nm" in record and "speed_rpm" in record
    if name is None or not (has_shaft or "mechanical_power_W" in record):
        return []
    shaft = (
        np.asarray(record["mechanical_power_W"], dtype=float)
        if "mechanical_power_W" in record
        else shaft_power(record.channels)
    )
    both = {
        "time_s": record.time_s,
        "electrical": _power(record, name, motor.phases),
        "shaft": shaft,
    }
    time_s, electrical, shaft = samples(Record("", both), "electrical", "shaft")
    if time_s.size < 3:
        return []
    width_s = max(10.0, float(np.ptp(time_s)) / 200.0)
    _, electrical, shaft = block_means(time_s, width_s, electrical, shaft)
    found = []
    inputs = {"dq": ("i_q_A", "u_q_V"), "dc": ("dc_current_A", "dc_voltage_V")}.get(name, (name,))
    rods = ("mechanical_power_W",) if "mechanical_power_W" in record else ("torque_Nm", "speed_rpm")
    channels = (*inputs, *rods)
    # As a generator the roles are exchanged.
    given = np.where(electrical + shaft > 0.0, electrical, -shaft)
    taken = np.where(electrical + shaft > 0.0, shaft, -electrical)
    loaded = given > 0.3 * float(np.max(given, initial=0.0))
    if loaded.any():
        typical = float(np.median((taken / np.maximum(given, 1e-300))[loaded]))
        best = float(np.quantile((taken / np.maximum(given, 1e-300))[loaded], 0.9))
        values = {"efficiency": best}
        if typical > 1.0 + COPPER_TOLERANCE:
            sentence = f"Expected an efficiency below 1; it is {typical:.3g}."
            found.append(Conflict("power_from_nothing", sentence, channels, False, values))
        elif 1e-6 < best < (USUAL_EFFICIENCY if is_strict else LOW_EFFICIENCY) and _is_idle(
            record, motor
        ):
            sentence = f"The best efficiency is {best:.2g}."
            found.append(Conflict("little_efficiency", sentence, channels, True, values))
    found += _difference(record, motor, width_s, name, both, channels)
    return found


def _is_idle(record: Record, motor: Motor) -> bool:
    """Whether a low efficiency is left unexplained by copper loss, as far as that is known."""
    _, share = copper_shares(record, motor)
    return share.size < 3 or float(np.median(share)) < 0.3


def _difference(
    record: Record,
    motor: Motor,
    width_s: float,
    name: str,
    powers: Mapping[str, np.ndarray],
    channels: tuple[str, ...],
) -> list[Conflict]:
    """Losses that were recorded against the difference of recorded powers."""
    if motor.losses != "balance" or "losses_W" not in record:
        return []
    whole = Record("", {**powers, "losses_W": record["losses_W"]})
    columns = block_means(*_with_width(samples(whole, "electrical", "shaft", "losses_W"), width_s))
    if columns[0].size < 3:
        return []
    _, electrical, shaft, losses = columns
    difference = electrical - shaft
    larger = np.maximum(np.abs(electrical), np.abs(shaft))
    is_known = (losses > 0.0) & (difference > LEAST_DIFFERENCE * larger)
    is_known &= larger > 0.3 * float(np.max(larger, initial=0.0))
    if np.sum(is_known) < 3:
        return []
    ratio = float(np.median(losses[is_known] / difference[is_known]))
    # Behind an inverter the difference also holds the inverter's losses: it may be the larger one.
    least = 0.0 if name.startswith("dc") else 1.0 / LOSSES_AGREE
    if least <= ratio <= LOSSES_AGREE:
        return []
    sentence = f"Expected losses_W as electrical power less shaft power; it is {ratio:.3g} of that."
    values = {"losses_over_difference": ratio}
    return [Conflict("losses_disagree", sentence, ("losses_W", *channels), False, values)]


def _with_width(columns: tuple[np.ndarray, ...], width_s: float) -> tuple:
    return (columns[0], width_s, *columns[1:])


def _speed(record: Record, motor: Motor) -> list[Conflict]:
    """Speed against the rated speed and against the vehicle's."""
    found = []
    speed = samples(record, "speed_rpm")[1]
    if speed.size and motor.rated_speed_rpm:
        ratio = float(np.quantile(np.abs(speed), 0.99)) / motor.rated_speed_rpm
        if ratio > FAST_OVER_RATED:
            sentence = f"The speed reaches {ratio:.3g} times rated_speed_rpm."
            values = {"speed_over_rated": ratio}
            found.append(Conflict("too_quick", sentence, ("speed_rpm",), True, values))
    if motor.gear_ratio and motor.wheel_radius_m:
        _, speed, vehicle = samples(record, "speed_rpm", "vehicle_speed_km_per_h")
        wheel = vehicle / 3.6 / motor.wheel_radius_m * 30.0 / math.pi * motor.gear_ratio
        moving = np.abs(wheel) > 0.3 * float(np.max(np.abs(wheel), initial=0.0))
        if moving.any():
            ratio = float(np.median(np.abs(speed[moving] / wheel[moving])))
            if not 1.0 - KINEMATIC <= ratio <= 1.0 + KINEMATIC:
                sentence = f"Expected the wheel's speed times the gear; the shaft has {ratio:.3g}."
                values = {"speed_over_wheel": ratio}
                channels = ("speed_rpm", "vehicle_speed_km_per_h")
                found.append(Conflict("wheel_disagrees", sentence, channels, False, values))
    return found
