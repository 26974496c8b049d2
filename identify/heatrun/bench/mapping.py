"""Columns on their way to channels: taken, converted, noted."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from .column_unit import unit_wanted
from .record import ColumnReading, Finding, UnitSource
from .schema import Channel
from .table import Column
from .units import require_unit, to_canonical

AMPLITUDE = re.compile(
    r"peak|ampl|scheitel|spitze|crest|crête"
    r"|(?:^|[^a-z])(?:pk|max|amp|pp|p-p)(?![a-z])"
    r"|(?:^|[^a-z])(?:i[a-zA-Z0-9]{0,3}|current|strom)?[_ .\-]?(?:hat|dach)(?![a-z])"
    r"|[îÎ]|i\u0302|\u02c6|\^(?![0-9+-])",
    re.IGNORECASE,
)
"""Names of amplitudes; the hat also as a sign of its own or one that combines with the i."""

KIND = re.compile(r"rms|eff|peak|pk|ampl", re.IGNORECASE)
"""In a unit, the words by which `[columns]` decides."""

EFFECTIVE = re.compile(r"rms|(?:^|[^a-z])eff(?![a-z])|effekt", re.IGNORECASE)


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
        remedy = unit_wanted(channel, column)
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
        is_decided = source == "[columns]" and bool(KIND.search(unit or ""))
        doubt = None if is_decided else doubt_of_kind(channel, column, known.symbol, where)
        self.findings += [doubt] if doubt else []

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


def doubt_of_kind(channel: Channel, column: Column, symbol: str, where: str) -> Finding | None:
    """Return the finding about a current that is read as rms and called an amplitude, or the other
    way round; None where nothing speaks against the reading.

    Args:
        channel: What the column becomes.
        column: The column.
        symbol: Its unit; of a d or q current the plain one is an amplitude.
        where: File and column.
    """
    prefix = symbol.partition("_")[0]
    said = next((one for one in column.beside if one.scope == "kind"), None)
    if channel.quantity == "phase current" and not symbol.endswith("_peak"):
        if said is None and not AMPLITUDE.search(column.label):
            return None
        source = said.source if said else "the name"
        message = f"{source[:1].upper()}{source[1:]} speaks of an amplitude, the unit is read as "
        remedy = (
            f"Write '{column.label} [{prefix}_peak]' in [columns] if it is an amplitude, "
            f"'{column.label} [{prefix}_rms]' if not."
        )
    elif channel.quantity == "dq current" and not symbol.endswith("_rms"):
        if not EFFECTIVE.search(column.label):
            return None
        message = "The name speaks of rms values (amplitude / √2), the unit is read as amplitude, "
        remedy = (
            f"Write '{column.label} [{prefix}_rms]' in [columns] if it is rms, "
            f"'{column.label} [{prefix}_peak]' if not."
        )
    else:
        return None
    return Finding(
        id="current_maybe_amplitude"
        if channel.quantity == "phase current"
        else "current_maybe_rms",
        severity="warning",
        message=f"{message}{symbol}.",
        where=where,
        remedy=remedy,
    )
