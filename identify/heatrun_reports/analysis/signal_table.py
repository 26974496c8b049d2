"""Every recorded signal in one line: start, end, extremes, mean, and how much is missing."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from heatrun.bench.checks.samples import is_measured, samples
from heatrun.bench.record import Record
from heatrun.bench.rounding import rounding_step

from ..figures.plot import unit, wording
from ..report import Column, Line, Table
from .drive import has
from .integrate import bridged_steps

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
