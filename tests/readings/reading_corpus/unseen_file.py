"""How the unseen files are laid down: a heat run under the names and units that a case gives it."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from .case import Case, Truth
from .machine import heat_run
from .table import Column, Layout, Sheet, number_text
from .units import FIVE

CAUSE = "unseen"
START = datetime(2024, 5, 3, 10, 12, 0)
"""When the recordings begin."""

WORTH: dict[str, tuple[float, float]] = {
    "-": (1, 0), "ms": (1e-3, 0), "us": (1e-6, 0), "ns": (1e-9, 0), "min": (60, 0), "h": (3600, 0),
    "d": (86400, 0), "10ms": (0.01, 0), "mA": (1e-3, 0), "kA": (1e3, 0), "cA": (0.01, 0),
    "peak": (1 / math.sqrt(2), 0), "pp": (1 / math.sqrt(8), 0), "kW": (1e3, 0), "dW": (0.1, 0),
    "hW": (100, 0), "BTU/h": (0.29307107017222, 0), "hp": (745.69987158227, 0),
    "K": (1, -273.15), "F": (5 / 9, -160 / 9), "R": (5 / 9, -273.15), "d°C": (0.1, 0),
    "c°C": (0.01, 0), "ohm": (1 / 0.385, -100 / 0.385), "1/s": (60, 0),
    "rad/s": (30 / math.pi, 0), "lbf ft": (1.3558179483314004, 0), "kpm": (9.80665, 0),
    "lbf in": (0.1129848290276167, 0), "kV": (1e3, 0), "l/h": (1 / 60, 0),
    "gpm": (3.785411784, 0), "m3/h": (1000 / 60, 0), "20%": (20, 0),
}  # fmt: skip
"""Unit to (factor, offset): canonical = factor * value + offset; "-" is the canonical unit."""


def made(
    number: int,
    heads: str = "",
    units: str = "",
    *,
    channels: tuple[str, ...] = FIVE,
    rows: int = 160,
    step_s: float = 5.0,
    digits: dict[str, int] | None = None,
    clock: Callable[[float], str] | None = None,
    written_s: float = 0.0,
    shift_s: float = 0.0,
) -> Sheet:
    """Return a heat run as columns.

    Args:
        number: Chooses machine and load.
        heads: Names in the file, between `|`; by default the canonical ones.
        units: Keys of `WORTH`, between blanks or, where one holds a blank, between `|`.
        channels: Which are in the file, in this order.
        rows: Samples.
        step_s: Between samples [s].
        digits: By channel: after the point; by default six that count.
        clock: Writes the time as a cell.
        written_s: What such a cell rounds the time to [s].
        shift_s: Added to all times.
    """
    run = heat_run(number, rows, step_s)
    run = {**run, "time_s": run["time_s"] + shift_s}
    names = heads.split("|") if heads else list(channels)
    keys = (units.split("|") if "|" in units else units.split()) or ["-"] * len(channels)
    columns, tolerance = [], {}
    for channel, name, key in zip(channels, names, keys, strict=True):
        factor, offset = WORTH[key]
        numbers = (run[channel] - offset) / factor
        largest = max(float(np.abs(numbers).max()), 1e-12)
        places = (digits or {}).get(channel, max(0, 6 - math.ceil(math.log10(largest))))
        tolerance[channel] = 0.5001 * 10.0**-places * factor
        cells = tuple(number_text(value, places) for value in numbers)
        if clock and channel == "time_s":
            cells, tolerance[channel] = tuple(clock(value) for value in run[channel]), written_s
        columns.append(Column(channel, name, cells, np.round(numbers, places), key))
    return Sheet(number, tuple(columns), {name: run[name] for name in channels}, tolerance)


def unseen(
    name: str, truth: Truth, sheet: Sheet, content: Any = None, *, mapped: bool = True, **more: Any
) -> Case:
    """Return a case; `mapped` puts the names of its columns into `[columns]`."""
    if mapped:
        more.setdefault("columns", {column.channel: column.header for column in sheet.columns})
    return sheet.case(CAUSE, name, truth, content, **more)


def comma(sheet: Sheet) -> Sheet:
    """Return the same with decimal commas."""
    return sheet.with_cells("*", lambda cell: cell.replace(".", ","))


def stamp(form: str) -> Callable[[float], str]:
    """Return what writes a time as a date in a form of `strftime`."""
    return lambda value: (START + timedelta(seconds=float(value))).strftime(form)


def changed(sheet: Sheet, change: Callable[[int, list[str]], list[str]]) -> Layout:
    """Return a layout whose rows are changed, given their number and cells."""
    return Layout(rows=lambda lines: [
        ",".join(change(i, line.split(","))) for i, line in enumerate(lines)
    ])  # fmt: skip


def beside(sheet: Sheet, header: str, cells: Callable[[int], str], at: int = 99) -> Sheet:
    """Return the same with a column that is none of the channels."""
    count = len(sheet.columns[0].cells)
    extra = Column("", header, tuple(cells(i) for i in range(count)), np.arange(count), "-")
    columns = list(sheet.columns)
    columns.insert(at, extra)
    return Sheet(sheet.number, tuple(columns), sheet.truth, sheet.tolerance)


def names_of(sheet: Sheet) -> dict[str, str]:
    """Return the `[columns]` of the channels alone."""
    return {column.channel: column.header for column in sheet.columns if column.channel}
