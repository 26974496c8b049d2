"""How the further rows of a growing test become channels: as its first ones did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..motor import Motor
from .channels.derive import derive
from .channels.schema import CHANNEL
from .channels.unit_table import Unit
from .channels.units import find_unit, to_canonical
from .readers.text.rows import Rows
from .record import Record

SAME_CLOCK_S = 1e-3
"""Rounding of a 32-bit clock after hours [s]; a larger shift is a clock that was wrapped."""

LONGEST_STEP_S = 43_200.0
"""A longer step between rows, or one back, says that a clock was not understood [s]."""


@dataclass(frozen=True)
class Conversion:
    """What turns columns of a file into the channels of a record.

    Attributes:
        units: Canonical name to the column that it is read from, and its unit.
        constants: Channels that do not change, in their canonical unit.
        step_s: Step of a time that is made from a rate [s], None for a file with its own.
        phases: Number of phases.
        losses: Meaning of `losses_W`, as in `heatrun.motor.Motor`.
    """

    units: Mapping[str, tuple[str, Unit]]
    constants: Mapping[str, float]
    step_s: float | None
    phases: int
    losses: str

    @classmethod
    def of(cls, record: Record, motor: Motor | None) -> Conversion:
        """Take how a record came about.

        Args:
            record: Read from the beginning of the file.
            motor: The machine that it was read for, or None.
        """
        units = {
            one.channel: (one.column, unit)
            for one in record.mapping
            if (unit := find_unit(one.unit, CHANNEL[one.channel].quantity)) is not None
        }
        has_rate = "time_s" not in units and record.time_s.size > 1
        return cls(
            units,
            motor.constants if motor else {},
            record.duration_s / (record.time_s.size - 1) if has_rate else None,
            motor.phases if motor else 3,
            motor.losses if motor else "balance",
        )

    @property
    def columns(self) -> frozenset[str]:
        """The columns of the file that are channels."""
        return frozenset(column for column, _ in self.units.values())

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
            name: to_canonical(rows.values[column], unit)
            for name, (column, unit) in self.units.items()
            if column in rows.values
        }
        if self.step_s is not None:
            found["time_s"] = last_s + self.step_s * np.arange(rows.num_rows)
        elif "time_s" in found:
            here_s = float(found["time_s"][0])
            if not abs(here_s + shift_s - last_s) < SAME_CLOCK_S and np.isfinite(here_s + last_s):
                shift_s = last_s - here_s
            found["time_s"] = found["time_s"] + shift_s
        losses = "map" if self.losses == "map" else "balance"
        found, _ = derive(found, phases=self.phases, losses=losses)
        for name, value in self.constants.items():
            found.setdefault(name, np.full(rows.num_rows, value))
        return found, shift_s


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
