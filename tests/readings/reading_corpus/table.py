"""A heat run as columns of a file: header text, cells, and what they are worth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .case import Case, Truth
from .machine import MACHINES, heat_run
from .units import CHANNELS, FIVE, worth

STEMS = {"time_s": "time", "phase_current_A": "phase_current", "losses_W": "losses",
         "ambient_degC": "ambient", "winding_degC": "winding"}  # fmt: skip
"""Names that say nothing of units."""

THESIS = dict(zip(FIVE, ("t", "Is", "Pd", "Te", "Tw_m"), strict=True))
"""Names of the thesis."""


@dataclass(frozen=True)
class Column:
    """One column."""

    channel: str  # Canonical channel that it holds.
    header: str  # Name in the file.
    cells: tuple[str, ...]  # One text per sample.
    numbers: np.ndarray  # The same as numbers in the file's unit, for files that hold numbers.
    unit: str  # Symbol of `units.UNITS`.


@dataclass(frozen=True)
class Layout:
    """How a table is laid down as text."""

    delimiter: str = ","  # Between cells.
    encoding: str = "utf-8"  # Of the bytes.
    newline: str = "\n"  # After each line.
    before: tuple[str, ...] = ()  # Lines above the names.
    above: tuple[tuple[str, ...], ...] = ()  # Cells of rows above the names, one text per column.
    below: tuple[tuple[str, ...], ...] = ()  # The same between names and values.
    after: tuple[str, ...] = ()  # Lines at the end.
    bom: bytes = b""  # Bytes in front.
    # Turns the cells of a row into a line; by default they are joined.
    row: Callable[[list[str]], str] | None = None
    # Changes the lines of all samples: takes and returns a list of lines.
    rows: Callable[[list[str]], list[str]] | None = None
    names: bool = True


@dataclass(frozen=True)
class Sheet:
    """Columns with the truth behind them."""

    number: int
    columns: tuple[Column, ...]
    truth: dict[str, np.ndarray]
    tolerance: dict[str, float] = field(default_factory=dict)

    def text(self, layout: Layout | None = None) -> bytes:
        """Return the file."""
        layout = layout or Layout()
        join = layout.row or layout.delimiter.join
        lines = [join(list(cells)) for cells in zip(*(c.cells for c in self.columns), strict=True)]
        if layout.rows:
            lines = layout.rows(lines)
        names = [join([c.header for c in self.columns])] if layout.names else []
        head = [*layout.before, *(join(list(row)) for row in layout.above), *names,
                *(join(list(row)) for row in layout.below)]  # fmt: skip
        text = "".join(line + layout.newline for line in (*head, *lines, *layout.after))
        return layout.bom + text.encode(layout.encoding)

    def case(self, cause: str, name: str, truth: Truth, content: Any = None, **more: Any) -> Case:
        """Return the case of these columns; without content the plain text of them."""
        if content is None or isinstance(content, Layout):
            content = self.text(content)
        more.setdefault("channels", self.truth)
        # What a file states must be read without the help of the copper loss, too.
        stated = truth in (Truth.READ, Truth.CONFLICT)
        more.setdefault("has_resistance", not (stated and self.number % 2))
        return Case(
            cause, name, truth, content, tolerance=self.tolerance,
            machine=MACHINES[self.number % len(MACHINES)], **more,
        )  # fmt: skip

    def headed(self, headers: Mapping[str, str]) -> Sheet:
        """Return the same with other names."""
        return replace(self, columns=tuple(
            replace(c, header=headers.get(c.channel, c.header)) for c in self.columns
        ))  # fmt: skip

    def with_cells(self, channel: str, change: Callable[[str], str]) -> Sheet:
        """Return the same with the cells of one channel written otherwise; `*` for all."""
        return replace(self, columns=tuple(
            replace(c, cells=tuple(change(cell) for cell in c.cells))
            if channel in (c.channel, "*") else c for c in self.columns
        ))  # fmt: skip

    def with_numbers(self, channel: str, change: Callable[[np.ndarray], np.ndarray]) -> Sheet:
        """Return the same with the numbers of one channel changed, for files that hold numbers."""
        return replace(self, columns=tuple(
            replace(c, numbers=change(c.numbers)) if c.channel == channel else c
            for c in self.columns
        ))  # fmt: skip


def sheet(
    number: int,
    *,
    rows: int = 240,
    step_s: float = 2.0,
    channels: tuple[str, ...] = FIVE,
    units: Mapping[str, str] | None = None,
    headers: Mapping[str, str] | None = None,
    decimals: Mapping[str, int] | None = None,
    cells: Mapping[str, Callable[[float], str]] | None = None,
    written_s: float | None = None,
    shift_s: float = 0.0,
) -> Sheet:
    """Return a heat run of a machine and a load, which the number chooses, as columns.

    The channels stand in this order. By channel are given what its numbers are in (the canonical
    unit by default), its name in the file (the canonical one, or `stem [unit]`), digits after the
    point (six that count), and, for clocks, what writes a canonical value as a cell, which rounds
    the time to so much [s]. The shift is added to all times [s].
    """
    units, headers, decimals, cells = units or {}, headers or {}, decimals or {}, cells or {}
    run = heat_run(number, rows, step_s)
    run = {**run, "time_s": run["time_s"] + shift_s}
    columns, truth, tolerance = [], {}, {}
    for channel in channels:
        canonical = CHANNELS[channel][1]
        unit = units.get(channel, canonical)
        factor, offset = worth(channel, unit)
        numbers = (run[channel] - offset) / factor
        largest = max(float(np.abs(numbers).max()), 1e-12)
        digits = decimals.get(channel, max(0, 6 - int(np.ceil(np.log10(largest)))))
        truth[channel] = run[channel]
        tolerance[channel] = 0.5001 * 10.0**-digits * abs(factor)
        if channel in cells:
            texts = tuple(cells[channel](value) for value in run[channel])
            if written_s is not None:
                tolerance[channel] = written_s
        else:
            texts = tuple(f"{value:.{digits}f}" for value in numbers.tolist())
        stem = CHANNELS[channel][2]
        default = channel if unit == canonical else f"{stem} [{unit}]"
        # Binary formats hold the same rounded numbers as the text does.
        columns.append(
            Column(channel, headers.get(channel, default), texts, np.round(numbers, digits), unit)
        )
    return Sheet(number, tuple(columns), truth, tolerance)
