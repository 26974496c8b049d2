"""Columns on their way to channels: unit found, values converted, and how that is known."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError
from ..io.quantities import aligned, as_printed
from ..record.by_resistance import by_resistance
from ..record.channels import CHANNEL, Channel
from ..record.derive import constants_of, formulas
from ..record.header import read_heading
from ..record.record import ColumnReading, Finding, Record, UnitSource
from ..record.several import combine, known_by, sensors_differ
from ..record.table import Column, Stated
from ..record.units import (
    AMPERE,
    KILOAMPERE,
    MILLIAMPERE,
    ROOT_2,
    Unit,
    find_unit,
    quantities_of,
    require_unit,
    to_canonical,
)
from ..results.model import DescribedTest
from .labels import named_unit, rival_unit

PLAIN_AMPERES = frozenset((*AMPERE, *MILLIAMPERE, *KILOAMPERE))


def line_of(channel: Channel, column: Column, unit: str | None = None) -> str:
    """Return the line of a motor file that reads a column as a channel, by default in its unit."""
    text = json.dumps(f"{column.name} [{unit or channel.unit}]", ensure_ascii=False)
    return f"[columns] {channel.name} = {text}"


def statements(column: Column) -> tuple[Stated, ...]:
    """Return what the file says about the unit of a column, of this one alone, in its order."""
    if column.is_seconds:
        return (Stated("s", "the column"),)
    marked = tuple(
        Stated(unit, "the name") for unit in read_heading(column.heading or column.name).units
    )
    beside = tuple(one for one in column.beside if one.scope == "column")
    known = [one.text for one in (*marked, *beside)]
    if column.unit is None or column.unit in known:
        return marked + beside
    return (*marked, *beside, Stated(column.unit, "the file"))


def unit_of(column: Column, channel: Channel, where: str) -> tuple[str | None, UnitSource]:
    """Return the unit text of a column that becomes a channel, and how it is known; None if nobody
    says.

    Statements are the marked units of the name, the row of units, comment lines and what the file
    keeps beside the name. All of them must be units of the channel's quantity and mean the same;
    what does not is a question for `[columns]` and never decided here. Without a statement, a unit
    that is part of the name counts (`heatrun.readers.labels`).

    Raises:
        InputError: If a statement is no unit of the channel's quantity, two of them contradict
            each other, or what is part of the name may be read in two ways.
    """
    if column.is_seconds:
        return "s", column.unit_from
    quantity = channel.quantity
    stated = statements(column)
    for one in stated:
        require_unit(one.text, quantity, where=where, remedy=unit_wanted(channel, column))
    binding = _binding(column, quantity)
    said = (*binding, *stated)
    rival = rival_unit(column.label, quantity) if stated and not binding else None
    against = (Stated(rival, "the name"), *said) if rival else said
    may_refine = bool(rival or binding) and column.label not in CHANNEL
    for one in against[1:]:
        if not _agrees(against[0], one, quantity, may_refine=may_refine):
            raise _conflict(against[0], one, channel, column, where)
    if stated:
        return stated[0].text, "stated"
    if binding:
        return binding[0].text, "name"
    named = named_unit(column.label, quantity)
    if named is not None:
        if named.doubt:
            raise _doubt(f"{named.doubt}.", named.unit, channel, column, where)
        require_unit(named.unit, quantity, where=where, remedy=unit_wanted(channel, column))
        return named.unit, "name"
    return _by_general(column, channel, where)


def _binding(column: Column, quantity: str) -> tuple[Stated, ...]:
    """Return the unit in the name that binds as much as one that is marked.

    It does if it can be nothing else than a unit, or if the name is that of a channel.
    """
    canonical = CHANNEL.get(column.label)
    if canonical is not None and canonical.unit != "1" and find_unit(canonical.unit, quantity):
        return (Stated(canonical.unit, "the name"),)
    named = named_unit(column.label, quantity)
    if named is None or not named.is_sure or named.doubt or not find_unit(named.unit, quantity):
        return ()
    return (Stated(named.unit, "the name"),)


def _agrees(first: Stated, second: Stated, quantity: str, *, may_refine: bool) -> bool:
    """Return whether two statements mean the same unit.

    Where the first is a part of the name, a plain A in it says nothing of rms or peak, so that a
    unit that does is no contradiction.
    """
    one, other = find_unit(first.text, quantity), find_unit(second.text, quantity)
    if one == other:
        return True
    if not (may_refine and first.text in PLAIN_AMPERES and one and other):
        return False
    return any(math.isclose(other.factor, one.factor * kind) for kind in (1 / ROOT_2, 1.0, ROOT_2))


def _by_general(column: Column, channel: Channel, where: str) -> tuple[str | None, UnitSource]:
    """Return the unit that lines of the file give for more than this column."""
    general = [
        one
        for one in column.beside
        if one.scope != "column" and find_unit(one.text, channel.quantity)
    ]
    clear = [one for one in general if one.scope == "quantity"]
    for one in clear[1:]:
        if find_unit(one.text, channel.quantity) != find_unit(clear[0].text, channel.quantity):
            raise _conflict(clear[0], one, channel, column, where)
    if clear:
        return clear[0].text, "stated"
    for one in general:
        if find_unit(one.text, channel.quantity) != find_unit(channel.unit, channel.quantity):
            problem = (
                f"{one.at_start} mentions {one.text}; nothing states whether it is the unit of "
            )
            raise _doubt(f"{problem}this column.", one.text, channel, column, where)
    return None, "assumed"


def overridden(column: Column, channel: Channel, decided: str) -> Stated | None:
    """Return the first statement of a file that a unit in `[columns]` decides against, if any."""
    quantity = channel.quantity
    unit = find_unit(decided, quantity)
    rival = rival_unit(column.label, quantity)
    in_name = _binding(column, quantity) or ((Stated(rival, "the name"),) if rival else ())
    for one in (*statements(column), *in_name):
        if find_unit(one.text, quantity) != unit:
            return one
    return None


def unit_wanted(channel: Channel, column: Column) -> str:
    """Return the remedy where a unit is not understood; none is offered, it may be any of them."""
    return f"Say it in the motor file, with the unit for UNIT: {line_of(channel, column, 'UNIT')}."


def _conflict(
    first: Stated, second: Stated, channel: Channel, column: Column, where: str
) -> InputError:
    source = "the unit behind it" if first.source == second.source else second.source
    return InputError(
        f"{first.at_start} says {first.text}, {source} {second.text}.",
        where=where,
        remedy=f"Decide in the motor file: {line_of(channel, column, first.text)} or "
        f"{line_of(channel, column, second.text)}.",
    )


def _doubt(problem: str, unit: str, channel: Channel, column: Column, where: str) -> InputError:
    known = [unit] if channel.quantity in quantities_of(unit) else []
    lines = " or ".join(line_of(channel, column, unit) for unit in (None, *known))
    return InputError(problem, where=where, remedy=f"Say it in the motor file: {lines}.")


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
class MappedColumns:
    """The canonical channels of one file; filled during one call of `map_columns` and then left."""

    where: str  # The file, for messages.
    taken: dict[str, Column] = field(default_factory=dict)  # Canonical name to its column.
    # Canonical name to float64 in the canonical unit, shape (time,).
    channels: dict[str, np.ndarray] = field(default_factory=dict)
    excluded: set[str] = field(default_factory=set)  # Canonical names that no column may become.
    # What was mapped from where, and with which unit.
    notes: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)  # Doubts about the mapping.
    # How each column became its channel.
    readings: list[ColumnReading] = field(default_factory=list)
    # Canonical name to the columns that it combines, where it does.
    parts: dict[str, list[Column]] = field(default_factory=dict)
    # Canonical name to the readings of those, by column, in the canonical unit.
    read_of: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    # Name of a column to the reason why it is no channel, whatever it looks like.
    refused: dict[str, str] = field(default_factory=dict)
    decided: set[str] = field(default_factory=set)  # Channels whose unit `[columns]` itself gives.
    # Identities of columns whose zeros stand for what was not recorded.
    absent: set[int] = field(default_factory=set)
    unused: tuple[str, ...] = ()  # Columns that became no channel.
    # Sampling rate that `[columns]` gives in place of a time column [Hz], or None.
    rate_Hz: float | None = None

    @property
    def start(self) -> str:
        """When the times begin, as `Column.start`."""
        return self.taken["time_s"].start if "time_s" in self.taken else ""

    def names(self, channel: str) -> tuple[str, ...]:
        """Return the names of the columns that a channel is made of."""
        return tuple(one.name for one in self.parts.get(channel, [self.taken[channel]]))

    @property
    def used(self) -> set[int]:
        """The identities of the columns that became a channel, or a part of one."""
        combined = [part for parts in self.parts.values() for part in parts]
        return {id(column) for column in (*self.taken.values(), *combined)}

    def wants(self, channel: str) -> bool:
        """Return whether a channel is still to be looked for."""
        return channel not in self.channels and channel not in self.excluded

    def _place(self, column: Column, channel: Channel) -> str:
        return f"{self.where}, column '{column.name}' as {channel.name}"

    def require_unit(self, unit: str, channel: Channel, column: Column) -> Unit:
        """Return a unit that is said of a column; as `heatrun.record.units.require_unit`."""
        where, remedy = self._place(column, channel), unit_wanted(channel, column)
        return require_unit(unit, channel.quantity, where=where, remedy=remedy)

    def take(
        self, channel: Channel, column: Column, source: str, otherwise: str | None = None
    ) -> None:
        """Take a column in the unit that the file gives, or in another where it gives none.

        Raises:
            InputError: As `unit_of` and `add`.
        """
        unit, unit_from = unit_of(column, channel, self._place(column, channel))
        self.add(channel, column, unit or otherwise, source, unit_from)

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
        """Take a column for a channel and convert it from its unit, None for the canonical one.

        `source` says who says so; where `is_decided` `[columns]` itself gives the unit, whatever
        the file says.

        Raises:
            InputError: If the unit is not one of the channel's quantity, or the file leaves
                open how the column is to be read.
        """
        where = self._place(column, channel)
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
        known = self.require_unit(unit or channel.unit, channel, column)
        said = f"in {known.symbol}" if unit else f"no unit given, taken as {known.symbol}"
        read = f", {column.note}" if column.note else ""
        self.notes.append(f"{channel.name} from column '{column.name}' ({source}; {said}{read}).")
        self.readings.append(
            ColumnReading(channel.name, column.name, known.symbol, unit_from, source, self.where)
        )
        if is_decided:
            self.decided.add(channel.name)
        self.taken[channel.name] = column
        self.channels[channel.name] = to_canonical(column.values, known)
        if source != "[columns]" or not KIND.search(unit or ""):
            self.findings += _doubt_of_kind(channel, column, known.symbol, where)
        if unit_from == "stated" and not is_decided:
            self.findings += _other_letter(channel, column, known, where)

    def add_combined(
        self,
        name: str,
        text: str,
        how: str,
        columns: Sequence[Column],
        each: Sequence[MappedColumns],
    ) -> None:
        """Take several columns for the channel `name`, each of them taken alone before.

        `text` is what `[columns]` says, `how` as `heatrun.record.several.combine`.
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
        self.read_of[name] = {
            column.name: part for column, part in zip(columns, values, strict=True)
        }

    def sensors_differ(self, time_s: np.ndarray) -> tuple[Finding, ...]:
        """Return the findings on columns of one channel that differ; times [s] of all rows."""
        each = (sensors_differ(*one, time_s, self.where) for one in self.read_of.items())
        return tuple(finding for finding in each if finding is not None)

    def used_twice(self) -> Iterator[Finding]:
        """Yield a finding for each column that stands for more than one channel.

        An error where it is the winding too, whose rise above the other would be nil, or is read in
        several quantities; else a warning: one sensor may be coolant and ambient.
        """
        users: dict[int, list[str]] = {}
        for name, column in self.taken.items():
            users.setdefault(id(column), []).append(name)
        for names in users.values():
            if len(names) > 1:
                is_unlike = len({CHANNEL[one].quantity for one in names}) > 1
                yield Finding(
                    "column_used_twice",
                    "error" if "winding_degC" in names or is_unlike else "warning",
                    f"One column is read as {' and as '.join(names)}.",
                    f"{self.where}, column '{self.taken[names[0]].name}'",
                    "Give each its own column in [columns], or remove the line of the one that "
                    "the file does not have.",
                )


def _doubt_of_kind(channel: Channel, column: Column, symbol: str, where: str) -> Iterator[Finding]:
    """Yield the finding about a current that is read as rms or amplitude and called the other."""
    said = next((one.at_start for one in column.beside if one.scope == "kind"), "")
    if channel.quantity == "phase current" and not symbol.endswith("_peak"):
        id, kind, other = "current_maybe_amplitude", "peak", "rms"
        source = said or ("The name" if AMPLITUDE.search(column.label) else "")
        words, meant = "an amplitude, the unit is read as ", "an amplitude"
    elif channel.quantity == "dq current" and not symbol.endswith("_rms"):
        id, kind, other = "current_maybe_rms", "rms", "peak"
        source = "The name" if EFFECTIVE.search(column.label) else ""
        words, meant = "rms values (amplitude / √2), the unit is read as amplitude, ", "rms"
    else:
        return
    if source:
        unit = symbol.partition("_")[0]
        yield Finding(
            id,
            "warning",
            f"{source} mentions {words}{symbol}.",
            where,
            f"Write '{column.label} [{unit}_{kind}]' in [columns] if it is {meant}, "
            f"'{column.label} [{unit}_{other}]' if not.",
        )


def _other_letter(channel: Channel, column: Column, known: Unit, where: str) -> Iterator[Finding]:
    """Yield a finding if the name of a power ends in a letter that is another unit than the stated.

    A letter may be anything, the W of a winding or the A of a phase; so it is no conflict.
    """
    letter = LETTER.search(column.label) if channel.quantity == "power" else None
    named = find_unit(letter["unit"], channel.quantity) if letter else None
    if named is not None and letter is not None and letter["unit"] == named.symbol != known.symbol:
        yield Finding(
            "unit_beside_name",
            "warning",
            f"The name ends in {letter['unit']}, the unit that is stated is {known.symbol}, "
            "which is used.",
            where,
            f"Confirm it in the motor file: {line_of(channel, column, known.symbol)}.",
        )


KNOWN_BY = {"stated": "stated", "name": "the name", "assumed": "ASSUMED", "derived": "derived"}
"""How a unit is known, in words."""

HEAD = ("channel", "column", "unit", "unit known by", "column known by")
LONGEST = 36
KEPT = 17
"""Letters of a name that a line of the terminal or the sheet has room for, and from its start."""


@dataclass(frozen=True)
class ReadColumns:
    """How the columns of a test were read."""

    name: str  # The test.
    mapping: list[ColumnReading]  # From `describe_mapping`.


def describe_mapping(record: Record) -> list[ColumnReading]:
    """Return how each channel of a record came about, derived ones too, in the order of the
    channels.

    `found_by` says who says that it is this channel, or holds the formula.
    """
    if not record.mapping:
        return []
    read = {one.channel for one in record.mapping}
    derived = formulas(record.channels, read | constants_of(record.notes))
    if by_resistance(record):
        derived = {"winding_degC": "R(T), see the notes", **derived}
    if "time_s" not in read:
        derived = {"time_s": "sampling rate", **derived}
    more = [
        ColumnReading(name, "", CHANNEL[name].unit, "derived", formula, "")
        for name, formula in derived.items()
    ]
    places = {name: place for place, name in enumerate(CHANNEL)}
    return sorted([*record.mapping, *more], key=lambda row: places.get(row.channel, len(places)))


def describe_columns(record: Record) -> ReadColumns:
    """Return how the columns of a record were read, as `mapping_text` takes it."""
    return ReadColumns(record.name, describe_mapping(record))


def mapping_rows(mapping: Sequence[ColumnReading]) -> list[list[str]]:
    """Return the rows of a table under `HEAD`; names too long for it are cut."""
    return [
        [
            row.channel,
            _cut(row.column) or "–",
            row.unit,
            KNOWN_BY[row.unit_from],
            _cut(row.found_by) if row.column else row.found_by,
        ]
        for row in mapping
    ]


def mapping_text(tests: Sequence[ReadColumns | DescribedTest]) -> str:
    """Return aligned tables of columns and channels; tests that were read alike share one."""
    blocks = []
    for names, rows in grouped(tests):
        lines = [f"Columns of {names}", *aligned((HEAD, *rows), "  ")]
        assumed = [row[0] for row in rows if row[3] == KNOWN_BY["assumed"]]
        if assumed:
            lines.append(f"  {assumption(assumed)}")
        blocks.append("\n".join(lines))
    return "\n".join(blocks)


def grouped(tests: Sequence[ReadColumns | DescribedTest]) -> list[tuple[str, list[list[str]]]]:
    """Return names of tests that were read alike, with the rows of their table, if any."""
    alike: dict[str, tuple[list[str], list[list[str]]]] = {}
    for test in tests:
        rows = mapping_rows(test.mapping)
        if rows:
            alike.setdefault(repr(rows), ([], rows))[0].append(test.name)
    return [(", ".join(names), rows) for names, rows in alike.values()]


def assumption(channels: Sequence[str]) -> str:
    """Return the sentence on units that nothing said."""
    return (
        f"Unit assumed for {', '.join(channels)}: no file and no name gives it. State it in "
        "[columns] if you know it."
    )


def _cut(text: str) -> str:
    clean = as_printed(text)
    # Names of one system begin alike and often end alike: the middle goes.
    return clean if len(clean) <= LONGEST else f"{clean[:KEPT]}…{clean[KEPT + 1 - LONGEST :]}"
