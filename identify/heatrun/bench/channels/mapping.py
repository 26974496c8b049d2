"""Columns on their way to channels: taken, converted, noted."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...errors import InputError
from ..readers.table import Column
from ..record import ColumnReading, Finding, UnitSource
from .column_unit import line_of, unit_wanted
from .combined import combine, known_by, sensors_differ
from .schema import CHANNEL, Channel
from .unit_table import Unit
from .units import find_unit, require_unit, to_canonical

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

FACTOR = re.compile(
    r"(?:(?<![A-Za-z0-9])[x×*]\s?|/\s?)(?:10\^[+-]?[0-9]+|1[eE][+-]?[0-9]+|0?\.[0-9]+|10+)(?![\w.^/])"
)
"""A factor in a name, as in "P x0.1 [W]": whether the values hold it already, nobody says."""

LETTER = re.compile(r"_(?P<unit>[A-Za-z])$")
"""A letter at the end of a label that may be a unit: "P_loss_W"."""

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
        parts: Canonical name to the columns that it combines, where it does.
        refused: Name of a column to the reason why it is no channel, whatever it looks like.
        decided: Channels whose unit `[columns]` itself gives.
        absent: Identities of columns whose zeros stand for what was not recorded.
    """

    where: str
    taken: dict[str, Column] = field(default_factory=dict)
    channels: dict[str, np.ndarray] = field(default_factory=dict)
    excluded: set[str] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    readings: list[ColumnReading] = field(default_factory=list)
    parts: dict[str, list[Column]] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    decided: set[str] = field(default_factory=set)
    absent: set[int] = field(default_factory=set)

    @property
    def used(self) -> set[int]:
        """The identities of the columns that became a channel, or a part of one."""
        combined = [part for parts in self.parts.values() for part in parts]
        return {id(column) for column in (*self.taken.values(), *combined)}

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
        *,
        is_decided: bool = False,
    ) -> None:
        """Take a column for a channel and convert it.

        Args:
            channel: What it becomes.
            column: The column.
            unit: Its unit text, None for the canonical unit.
            source: Who says so, for the note.
            unit_from: How the unit is known.
            is_decided: `[columns]` itself gives the unit, whatever the file says.

        Raises:
            InputError: If the unit is not one of the channel's quantity, or the file leaves
                open how the column is to be read.
        """
        where = f"{self.where}, column '{column.name}' as {channel.name}"
        if column.question is not None:
            raise column.question.asked(channel.name, where)
        if not is_decided and (factor := FACTOR.search(column.label)):
            raise InputError(
                f"The name contains the factor '{factor[0].strip()}'; whether the values must be "
                "multiplied by it is not stated.",
                where=where,
                remedy=f"State their unit in the motor file: {line_of(channel, column)}, or "
                "another; if none fits, export the values without the factor.",
            )
        remedy = unit_wanted(channel, column)
        known = require_unit(unit or channel.unit, channel.quantity, where=where, remedy=remedy)
        values = to_canonical(column.values, known)
        said = f"in {known.symbol}" if unit else f"no unit given, taken as {known.symbol}"
        read = f", {column.note}" if column.note else ""
        self.notes.append(f"{channel.name} from column '{column.name}' ({source}; {said}{read}).")
        self.readings.append(
            ColumnReading(channel.name, column.name, known.symbol, unit_from, source, self.where)
        )
        if is_decided:
            self.decided.add(channel.name)
        self.taken[channel.name] = column
        self.channels[channel.name] = values
        is_kind_known = source == "[columns]" and bool(KIND.search(unit or ""))
        doubt = None if is_kind_known else doubt_of_kind(channel, column, known.symbol, where)
        self.findings += [doubt] if doubt else []
        if unit_from == "stated" and not is_decided:
            letter = _other_letter(channel, column, known, where)
            self.findings += [letter] if letter else []

    def add_combined(
        self, name: str, text: str, how: str, columns: Sequence[Column], each: Sequence[Assignment]
    ) -> None:
        """Take several columns for a channel.

        Args:
            name: What they become.
            text: What `[columns]` says.
            how: As `heatrun.bench.channels.combined.combine`.
            columns: The columns.
            each: Each of them, taken for the channel alone.
        """
        readings = [reading for one in each for reading in one.readings]
        values = [one.channels[name] for one in each]
        whole = replace(columns[0], name=text, label=text, values=combine(name, how, values))
        self.taken[name], self.parts[name] = whole, list(columns)
        self.channels[name] = whole.values
        symbols = dict.fromkeys(reading.unit for reading in readings)
        unit_from = known_by([reading.unit_from for reading in readings])
        if all(name in one.decided for one in each):
            self.decided.add(name)
        unit = ", ".join(symbols)
        self.readings.append(ColumnReading(name, text, unit, unit_from, "[columns]", self.where))
        self.notes += [note for one in each for note in one.notes]
        self.findings += [finding for one in each for finding in one.findings]
        parts = {column.name: part for column, part in zip(columns, values, strict=True)}
        apart = sensors_differ(name, parts, self.where)
        self.findings += [apart] if apart else []

    def used_twice(self) -> list[Finding]:
        """Return a finding for each column that stands for more than one channel.

        An error where it is the winding too, whose rise above the other would be nil, or is read in
        several quantities; else a warning: one sensor may be coolant and ambient.
        """
        users: dict[int, list[str]] = {}
        for name, column in self.taken.items():
            users.setdefault(id(column), []).append(name)
        return [
            Finding(
                id="column_used_twice",
                severity="error" if _excludes(names) else "warning",
                message=f"One column is read as {' and as '.join(names)}.",
                where=f"{self.where}, column '{self.taken[names[0]].name}'",
                remedy="Give each its own column in [columns], or remove the line of the one that "
                "the file does not have.",
            )
            for names in users.values()
            if len(names) > 1
        ]


def _excludes(channels: Sequence[str]) -> bool:
    """Return whether one column cannot be all of these channels."""
    return "winding_degC" in channels or len({CHANNEL[one].quantity for one in channels}) > 1


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
        message = f"{source[:1].upper()}{source[1:]} mentions an amplitude, the unit is read as "
        remedy = (
            f"Write '{column.label} [{prefix}_peak]' in [columns] if it is an amplitude, "
            f"'{column.label} [{prefix}_rms]' if not."
        )
    elif channel.quantity == "dq current" and not symbol.endswith("_rms"):
        if not EFFECTIVE.search(column.label):
            return None
        message = "The name mentions rms values (amplitude / √2), the unit is read as amplitude, "
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


def _other_letter(channel: Channel, column: Column, known: Unit, where: str) -> Finding | None:
    """Return a finding if a name ends in a letter that is another unit than the stated one.

    A letter may be anything, the W of a winding or the A of a phase; so it is no conflict.
    """
    letter = LETTER.search(column.label)
    named = find_unit(letter["unit"], channel.quantity) if letter else None
    if named is None or letter is None or letter["unit"] != named.symbol or named == known:
        return None
    if channel.quantity != "power":  # "I_A" is the current of a phase, "T_K" that of the coolant
        return None
    return Finding(
        id="unit_beside_name",
        severity="warning",
        message=f"The name ends in {letter['unit']}, the unit that is stated is {known.symbol}, "
        "which is used.",
        where=where,
        remedy=f"Confirm it in the motor file: {line_of(channel, column, known.symbol)}.",
    )
