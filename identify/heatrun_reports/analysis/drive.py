"""What the drive of a record did: electrical power and road speed, from whatever was recorded.

Integrals over a record's own time axis, by sign, with gaps left out and counted.

The stretches of a test over which load and cooling are held.

The losses of a record split into those of the winding and all others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from heatrun.checks.time_axis import GAP_STEPS
from heatrun.errors import InputError
from heatrun.record.derive import dq_power, shaft_power
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.samples import block_means, median_step, runs, samples

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


@dataclass(frozen=True)
class Integral:
    """An integral over time, its parts above and below zero apart.

    Attributes:
        positive: Integral of the part above zero [unit of the values times s].
        negative: Integral of the part below zero, not above 0 [the same].
        covered_s: Time that was integrated over [s].
        left_out_s: Time in gaps, which was not [s].
        num_gaps: Number of gaps.
    """

    positive: float
    negative: float
    covered_s: float
    left_out_s: float
    num_gaps: int

    @property
    def net(self) -> float:
        """The integral itself."""
        return self.positive + self.negative

    @property
    def absolute(self) -> float:
        """The integral of the magnitude."""
        return self.positive - self.negative


def bridged_steps(time_s: Float[np.ndarray, " time"]) -> Float[np.ndarray, " step"]:
    """Return the steps of a time axis [s], those across a gap as 0.

    Args:
        time_s: Increasing times [s].
    """
    steps = np.diff(time_s)
    return np.where(steps <= GAP_STEPS * median_step(time_s), steps, 0.0)


def integrate(time_s: Float[np.ndarray, " time"], values: Float[np.ndarray, " time"]) -> Integral:
    r"""Return the trapezoidal integral of samples over their own time axis, by sign.

    $$ \int x\,dt = \sum_i \tfrac12 (x_i + x_{i+1})(t_{i+1} - t_i) $$

    Between two samples of different sign the straight line's zero is one more point, so that the
    part above zero is not counted too high. A step above three usual ones is a gap: nothing is
    known of the values in it, so it adds nothing, and its length is returned.

    Args:
        time_s: Increasing times [s].
        values: In any unit.
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


BLOCK_S = 60.0
"""Means that are compared [s]: a duty that repeats within a minute counts as a constant load."""

SIDE = 3
"""Means on each side of a moment whose medians are compared [1]: one outlier moves neither."""

STEP_SHARE = 0.05
"""A change of the load by this share of its largest magnitude ends a stretch [1]: above what the
warming of copper or a controller changes within minutes, below every step of a test plan."""

GAP_BLOCKS = 3.0
"""Minutes without a sample that end a stretch [1]."""

LOADS = (
    ("torque_Nm", "phase_current_A"),
    ("losses_W",),
    ("mechanical_power_W", "electrical_power_W", "dc_power_W"),
    ("i_d_A", "i_q_A"),
)
"""What tells the load, the most direct first: the first group that was recorded counts."""

BESIDE = ("speed_rpm", "coolant_flow_L_per_min", "fan")
"""What changes losses or cooling beside it."""


@dataclass(frozen=True)
class Stretch:
    """A stretch of constant load.

    Attributes:
        from_s: Its beginning, on the record's clock [s].
        to_s: Its end [s].
    """

    from_s: float
    to_s: float

    @property
    def length_s(self) -> float:
        """How long it is [s]."""
        return self.to_s - self.from_s


def load_channels(record: Record) -> tuple[str, ...]:
    """Return the channels that tell whether the load was held; empty where none was recorded."""
    for group in LOADS:
        found = [channel for channel in group if has(record, channel)]
        if found:
            return (*found, *(channel for channel in BESIDE if has(record, channel)))
    return tuple(channel for channel in BESIDE if has(record, channel))


def stretches(record: Record, shortest_s: float) -> tuple[Stretch, ...]:
    """Return the stretches of constant load, in their order.

    The minutes on both sides of a step belong to no stretch.

    Args:
        record: With one of the `load_channels`.
        shortest_s: Shorter ones are left out [s].
    """
    channels = load_channels(record)
    time_s, *loads = samples(record, *channels)
    if time_s.size == 0:
        return ()
    middle_s, *means = block_means(time_s, BLOCK_S, *loads)
    is_held = np.ones(middle_s.size, dtype=bool)
    for values in means:
        is_held &= ~_changes(values)
    width_s = max(BLOCK_S, float(np.median(np.diff(middle_s)))) if middle_s.size > 1 else BLOCK_S
    is_cut = np.append(False, np.diff(middle_s) > GAP_BLOCKS * width_s)
    found = []
    for first, end in zip(*runs(is_held), strict=True):
        cuts = [first, *(k for k in np.flatnonzero(is_cut) if first < k < end), end]
        for low, high in pairwise(cuts):
            from_s = float(middle_s[low]) - 0.5 * BLOCK_S
            to_s = float(middle_s[high - 1]) + 0.5 * BLOCK_S
            stretch = Stretch(max(from_s, float(time_s[0])), min(to_s, float(time_s[-1])))
            if stretch.length_s >= shortest_s:
                found.append(stretch)
    return tuple(found)


def _changes(values: np.ndarray) -> np.ndarray:
    """Whether the load changes on either side of a block."""
    limit = STEP_SHARE * float(np.max(np.abs(values)))
    jump = np.zeros(values.size + 1, dtype=bool)
    for k in range(1, values.size):
        before = np.median(values[max(0, k - SIDE) : k])
        after = np.median(values[k : k + SIDE])
        # the medians also change beside a step; the step itself is where the neighbours differ
        jump[k] = abs(after - before) > limit and abs(values[k] - values[k - 1]) > 0.5 * limit
    return jump[:-1] | jump[1:]


@dataclass(frozen=True)
class LossSplit:
    """Losses over the time of a record.

    Attributes:
        joule_W: P_Js of the winding [W], shape (time,).
        other_W: P_ol, iron, magnets, friction [W], shape (time,).
        formula: For the report.
    """

    joule_W: Float[np.ndarray, " time"]
    other_W: Float[np.ndarray, " time"]
    formula: str


def split_losses(record: Record, motor: Motor) -> LossSplit:
    r"""Split the losses by the measured winding temperature.

    $$ P_{Js} = m I_s^2 R_{s0} \frac{B + T_w}{B + T_{ref}}, \quad P_{ol} = P_d - P_{Js} $$

    Where the motor file calls the losses a map, they are P_ol already.

    Args:
        record: With `phase_current_A`, `losses_W` and `winding_degC`.
        motor: Gives the phase resistance and what the losses are.

    Raises:
        InputError: If a channel or the phase resistance is missing.
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
