"""Energy and efficiency of a machine by ranges of its shaft power, and each signal in one line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.samples import is_measured, rounding_step, samples

from .analysis.drive import bridged_steps, electrical_power, has, integrate, with_powers
from .plot import unit, wording
from .report import Column, Line, Table

NO_LOAD = 0.02
"""Share of the largest shaft power below which the machine delivers nothing [1]: the zero of a
torque transducer."""

SHARES = (NO_LOAD, 0.25, 0.5, 0.75, 1.0)
"""Ends of the ranges over the largest shaft power [1]; quarters, as the load points of IEC
60034-2-1."""


@dataclass(frozen=True)
class OperatingRange:
    """What a machine did while its shaft power lay in a range.

    Attributes:
        name: Of the range.
        duration_s: How long [s].
        drawn_W: Mean electrical power [W], negative where it was fed back.
        peak_W: The electrical power of the largest magnitude [W].
        shaft_W: Mean shaft power [W].
        efficiency: Output over input energy [1]; None without load.
    """

    name: str
    duration_s: float
    drawn_W: float
    peak_W: float
    shaft_W: float
    efficiency: float | None


@dataclass(frozen=True)
class ShaftEnergy:
    """Energy at the shaft, and what became of it.

    Attributes:
        largest_W: Largest magnitude of the shaft power, which ranges are shares of [W].
        out_J: Delivered as a motor [J].
        in_J: Taken as a generator [J].
        efficiency_motor: Of the time as a motor [1]; None if there was none.
        efficiency_generator: Of the time as a generator [1]; None likewise.
        ranges: From generator to the largest shaft power; those that were never met left out.
    """

    largest_W: float
    out_J: float
    in_J: float
    efficiency_motor: float | None
    efficiency_generator: float | None
    ranges: tuple[OperatingRange, ...]


def shaft_energy(record: Record, motor: Motor) -> ShaftEnergy | None:
    """Return energies and efficiencies at the shaft; None where its power was not measured.

    Energies are summed over a range before they are divided, by trapezoids over the record's own
    time axis, gaps left out.

    Args:
        record: With electrical power.
        motor: Gives the number of phases.

    Raises:
        InputError: If no electrical power was recorded.
    """
    full = with_powers(record, motor)
    power = electrical_power(record, motor)
    if not has(full, "mechanical_power_W"):
        return None
    made = Record(record.name, {**full.channels, "power": power.values})
    time_s, drawn, shaft = samples(made, "power", "mechanical_power_W")
    if time_s.size < 2:
        return None
    steps = bridged_steps(time_s)
    weight = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    whole, largest = integrate(time_s, shaft), float(np.max(np.abs(shaft)))
    share = shaft / largest if largest > 0.0 else shaft
    spans = [("as a generator", share < -NO_LOAD), ("no load", np.abs(share) <= NO_LOAD)]
    spans += [
        (f"{100 * low:.0f} … {100 * high:.0f} %", (share > low) & (share <= high))
        for low, high in pairwise(SHARES)
    ]

    def of_range(name: str, inside: np.ndarray) -> OperatingRange:
        part = weight * inside
        efficiency = _ratio(drawn, shaft, part) if name == "as a generator" else None
        if name not in ("as a generator", "no load"):
            efficiency = _ratio(shaft, drawn, part)
        return OperatingRange(
            name,
            float(np.sum(part)),
            float(part @ drawn / np.sum(part)),
            float(drawn[inside][np.argmax(np.abs(drawn[inside]))]),
            float(part @ shaft / np.sum(part)),
            efficiency,
        )

    return ShaftEnergy(
        largest,
        whole.positive,
        -whole.negative,
        _ratio(shaft, drawn, weight * ((drawn > 0.0) & (shaft > 0.0))),
        _ratio(drawn, shaft, weight * ((drawn < 0.0) & (shaft < 0.0))),
        tuple(of_range(name, span) for name, span in spans if np.sum(weight * span) > 0.0),
    )


def _ratio(output: np.ndarray, given: np.ndarray, weight: np.ndarray) -> float | None:
    """Return an energy over another that was given for it [1]; None where they differ in sign."""
    out_J, given_J = float(np.sum(output * weight)), float(np.sum(given * weight))
    return out_J / given_J if out_J * given_J > 0.0 else None


FINEST, COARSEST = 1e-2, 10.0
"""Steps of readings that are printed as they were logged; of others four digits say enough."""

COLUMNS = (
    Column("start"),
    Column("end"),
    Column("lowest"),
    Column("mean"),
    Column("highest"),
    Column("missing", "%"),
)


def signal_table(record: Record, channels: tuple[str, ...], title: str = "Signals") -> Table:
    """Return a line for each channel; means are weighted by time, gaps left out.

    Args:
        record: Any record.
        channels: Canonical names; those without a measured sample are left out.
        title: Heading of the table.
    """
    lines = tuple(_line(record, channel) for channel in channels)
    return Table(title, COLUMNS, tuple(line for line in lines if line is not None))


def recorded(record: Record) -> tuple[str, ...]:
    """Return the canonical channels that hold a measured sample, without the time."""
    return tuple(c for c in record.channels if c != "time_s" and has(record, c))


def rise_lines(record: Record, channels: Sequence[str], sink: str) -> tuple[Line, ...]:
    """Return the lines of temperatures' rises over a sink, where both were measured.

    Args:
        record: Any record.
        channels: Temperatures, canonical names.
        sink: Likewise.
    """
    lines = []
    for channel in channels:
        time_s, values, below = samples(record, channel, sink)
        if time_s.size:
            name = f"{wording(channel)} over {wording(sink)}"
            lines.append(
                _line_of(name, "K", time_s, values - below, _missing(record, channel, sink))
            )
    return tuple(lines)


def _line(record: Record, channel: str) -> Line | None:
    time_s, values = samples(record, channel)
    if time_s.size == 0:
        return None
    missing = _missing(record, channel)
    return _line_of(wording(channel), unit(channel), time_s, values, missing)


def _missing(record: Record, *channels: str) -> float:
    """Return how much of a record misses one of some channels [%]."""
    return 100.0 * (
        1.0 - float(np.mean(np.all([is_measured(record[c]) for c in channels], axis=0)))
    )


def _line_of(
    name: str, symbol: str, time_s: np.ndarray, values: np.ndarray, missing: float
) -> Line:
    steps = bridged_steps(time_s)
    weight = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    mean = float(weight @ values / np.sum(weight)) if np.sum(weight) > 0.0 else float(values.mean())
    first, last, low, high = (float(v) for v in (values[0], values[-1], values.min(), values.max()))
    places = places_of_readings(values)
    further = None if places is None else places + 1
    return Line(
        name, symbol, (first, last, low, mean, high, missing),
        places=(places, places, places, further, places, None),
    )  # fmt: skip


def places_of_readings(values: np.ndarray) -> int | None:
    """Return the decimal places of readings that lie on a decimal grid, None for others.

    Args:
        values: Measured values without NaN, shape (time,).

    Example:
        >>> places_of_readings(np.round(np.sin(np.arange(50.0)), 2))
        2
    """
    step = rounding_step(values)
    if step is None or not FINEST <= step <= COARSEST:
        return None
    return max(0, -math.floor(math.log10(step) + 1e-6))
