"""Every recorded signal in one line: start, end, extremes, mean, and how much is missing."""

from __future__ import annotations

import numpy as np

from ....bench.checks.samples import is_measured, samples
from ....bench.record import Record
from ..figures.plot import unit, wording
from ..report import Column, Line, Table
from .drive import has
from .integrate import bridged_steps

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


def _line(record: Record, channel: str) -> Line | None:
    time_s, values = samples(record, channel)
    if time_s.size == 0:
        return None
    steps = bridged_steps(time_s)
    weight = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    mean = float(weight @ values / np.sum(weight)) if np.sum(weight) > 0.0 else float(values.mean())
    missing = 100.0 * (1.0 - float(np.mean(is_measured(record[channel]))))
    first, last, low, high = (float(v) for v in (values[0], values[-1], values.min(), values.max()))
    return Line(wording(channel), unit(channel), (first, last, low, mean, high, missing))
