"""Columns on their way to channels: taken, converted, noted."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from .column_unit import line_of
from .record import ColumnReading, Finding, UnitSource
from .schema import Channel
from .table import Column
from .units import require_unit, to_canonical

AMPLITUDE = re.compile(r"peak|ampl|(^|[_ ])(pk|max|amp)(?![a-z])|scheitel", re.IGNORECASE)


@dataclass
class Assignment:
    """What is mapped so far; filled during one call of `map_columns` and then left.

    Attributes:
        where: The file, for messages.
        taken: Canonical name to its column.
        channels: Canonical name to values in the canonical unit, shape (time,).
        excluded: Canonical names that no column may become.
        notes: One sentence for each channel.
        findings: Doubts about columns.
        readings: How each column became its channel.
    """

    where: str
    taken: dict[str, Column] = field(default_factory=dict)
    channels: dict[str, np.ndarray] = field(default_factory=dict)
    excluded: set[str] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    readings: list[ColumnReading] = field(default_factory=list)

    def wants(self, channel: str) -> bool:
        """Return whether a channel is still to be looked for."""
        return channel not in self.channels and channel not in self.excluded

    def add(
        self,
        channel: Channel,
        column: Column,
        unit: str | None,
        source: str,
        unit_from: UnitSource,
    ) -> None:
        """Take a column for a channel and convert it.

        Args:
            channel: What it becomes.
            column: The column.
            unit: Its unit text, None for the canonical unit.
            source: Who says so, for the note.
            unit_from: How the unit is known.

        Raises:
            InputError: If the unit is not one of the channel's quantity, or the file leaves
                open how the column is to be read.
        """
        where = f"{self.where}, column '{column.name}' as {channel.name}"
        if column.question is not None:
            raise column.question.asked(channel.name, where)
        remedy = f"Say it in the motor file: {line_of(channel, column)}."
        known = require_unit(unit or channel.unit, channel.quantity, where=where, remedy=remedy)
        values = to_canonical(column.values, known)
        said = f"in {known.symbol}" if unit else f"no unit given, taken as {known.symbol}"
        read = f", {column.note}" if column.note else ""
        self.notes.append(f"{channel.name} from column '{column.name}' ({source}; {said}{read}).")
        self.readings.append(
            ColumnReading(channel.name, column.name, known.symbol, unit_from, source, self.where)
        )
        self.taken[channel.name] = column
        self.channels[channel.name] = values
        if (
            channel.quantity == "phase current"
            and AMPLITUDE.search(column.label)
            and not known.symbol.endswith("_peak")
        ):
            self.findings.append(
                Finding(
                    id="current_maybe_amplitude",
                    severity="warning",
                    message=f"The name speaks of an amplitude, the unit is read as {known.symbol}.",
                    where=where,
                    remedy=f"Write '{column.label} [A_peak]' in [columns] if it is an amplitude, "
                    f"'{column.label} [A_rms]' if not.",
                )
            )

    def used_twice(self) -> list[Finding]:
        """Return a finding for each column that stands for more than one channel."""
        users: dict[int, list[str]] = {}
        for name, column in self.taken.items():
            users.setdefault(id(column), []).append(name)
        return [
            Finding(
                id="column_used_twice",
                severity="warning",
                message=f"One column is read as {' and as '.join(names)}.",
                where=f"{self.where}, column '{self.taken[names[0]].name}'",
                remedy="Check [columns].",
            )
            for names in users.values()
            if len(names) > 1
        ]
