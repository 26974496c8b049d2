"""How the further rows of a growing test become channels: as its first ones did."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..motor import Motor
from .channels.combined import COMBINED, combine, split_parts
from .channels.derive import derive
from .channels.schema import CHANNEL
from .channels.unit_table import Unit
from .channels.units import find_unit, to_canonical
from .readers.text.reader import ColumnHead
from .readers.text.rows import Rows
from .record import ColumnReading, Record

SAME_CLOCK_S = 1e-3
"""Rounding of a 32-bit clock after hours [s]; a larger shift is a clock that was wrapped."""

LONGEST_STEP_S = 43_200.0
"""A longer step between rows, or one back, says that a clock was not understood [s]."""


@dataclass(frozen=True)
class Origin:
    """What a channel is read from.

    Attributes:
        columns: One column, or those that are combined.
        unit: Their unit.
        how: As `heatrun.bench.channels.combined.combine`; empty for one column.
    """

    columns: tuple[str, ...]
    unit: Unit
    how: str = ""


@dataclass(frozen=True)
class Conversion:
    """What turns columns of a file into the channels of a record.

    Attributes:
        origins: Canonical name to what it is read from.
        constants: Channels that do not change, in their canonical unit.
        step_s: Step of a time that is made from a rate [s], None for a file with its own.
        phases: Number of phases.
        losses: Meaning of `losses_W`, as in `heatrun.motor.Motor`.
    """

    origins: Mapping[str, Origin]
    constants: Mapping[str, float]
    step_s: float | None
    phases: int
    losses: str

    @classmethod
    def of(cls, record: Record, motor: Motor | None, heads: Sequence[ColumnHead]) -> Conversion:
        """Take how a record came about.

        Args:
            record: Read from the beginning of the file.
            motor: The machine that it was read for, or None.
            heads: What stands over the columns of the file.
        """
        origins = {
            one.channel: origin
            for one in record.mapping
            if (origin := _origin(one, heads)) is not None
        }
        has_rate = "time_s" not in origins and record.time_s.size > 1
        return cls(
            origins,
            motor.constants if motor else {},
            record.duration_s / (record.time_s.size - 1) if has_rate else None,
            motor.phases if motor else 3,
            motor.losses if motor else "balance",
        )

    @property
    def columns(self) -> frozenset[str]:
        """The columns of the file that are channels."""
        return frozenset(name for origin in self.origins.values() for name in origin.columns)

    def channels(
        self, rows: Rows, last_s: float, shift_s: float
    ) -> tuple[dict[str, np.ndarray], float]:
        """Return the channels of rows, and what their times are shifted by.

        Args:
            rows: The first of them is the last one that is known already.
            last_s: Time of that one [s]; NaN if it has none.
            shift_s: What was added to the times of the file so far [s].

        Returns:
            Canonical name to values, shape (row,), the first included, and the shift [s].
        """
        found = {
            name: _values(name, origin, rows)
            for name, origin in self.origins.items()
            if all(column in rows.values for column in origin.columns)
        }
        if self.step_s is not None:
            found["time_s"] = last_s + self.step_s * np.arange(rows.num_rows)
        elif "time_s" in found:
            here_s = float(found["time_s"][0])
            if not abs(here_s + shift_s - last_s) < SAME_CLOCK_S and np.isfinite(here_s + last_s):
                shift_s = last_s - here_s
            found["time_s"] = found["time_s"] + shift_s
        losses = "map" if self.losses == "map" else "balance"
        found, _ = derive(found, phases=self.phases, losses=losses, constants=self.constants)
        return found, shift_s


def _origin(reading: ColumnReading, heads: Sequence[ColumnHead]) -> Origin | None:
    """Return what a channel is read from; None where that cannot be told from its reading."""
    unit = find_unit(reading.unit, CHANNEL[reading.channel].quantity)
    several = COMBINED.fullmatch(reading.column)
    if unit is None or several is None:
        return None if unit is None else Origin((reading.column,), unit)
    parts = [part.partition("[")[0].strip() for part in split_parts(several["parts"])]
    names = [
        next((head.name for head in heads if part in (head.name, head.label)), "") for part in parts
    ]
    return Origin(tuple(names), unit, several["how"]) if all(names) else None


def _values(channel: str, origin: Origin, rows: Rows) -> np.ndarray:
    parts = [to_canonical(rows.values[column], origin.unit) for column in origin.columns]
    return combine(channel, origin.how, parts) if origin.how else parts[0]


def agrees(found: Mapping[str, np.ndarray], record: Record, num_rows: int) -> bool:
    """Return whether further rows are what the record holds at its end.

    Args:
        found: From `Conversion.channels`, shape (row,).
        record: Read from the whole file.
        num_rows: So many rows from the end are held against each other.
    """
    return all(
        name in found
        and np.allclose(
            found[name][-num_rows:], values[-num_rows:], rtol=1e-9, equal_nan=True,
            atol=SAME_CLOCK_S if name == "time_s" else 1e-12,
        )
        for name, values in record.channels.items()
    )  # fmt: skip


def is_steady(time_s: np.ndarray) -> bool:
    """Return whether times go on as a clock does.

    Args:
        time_s: Times [s], shape (row,), the last known one in front.
    """
    steps = np.diff(time_s[np.isfinite(time_s)])
    return bool(np.all((steps >= 0.0) & (steps <= LONGEST_STEP_S)))
