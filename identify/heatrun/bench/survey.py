"""What a bench file holds before any motor file says so: columns recognised, and all the others."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..io.printable import printable
from .channels.channel_map import map_columns
from .channels.claims import NOT_RECORDED
from .channels.column_unit import statements, unit_of
from .channels.derive import derive, formulas
from .channels.likely_names import likely_channels
from .channels.schema import CHANNEL
from .own_files import refuse_own_file
from .readers.formats import opened
from .readers.measurement import Measurement, header_of
from .readers.multirate import read_all
from .readers.open_file import open_input
from .readers.read import read_whole
from .readers.table import Column, Table
from .record import ColumnReading, UnitSource

MOST_SAMPLED = 200
"""Channels of a measurement file of which values are looked at; each is read whole."""

CHANNEL_NAME = re.compile("|".join(sorted(map(re.escape, CHANNEL), key=len, reverse=True)))


@dataclass(frozen=True)
class Proposal:
    """A channel that a column may be.

    Attributes:
        channel: Canonical name.
        line: Right-hand side of `[columns]` that reads the column so.
        unit_from: How its unit is known; `"assumed"` if the line itself states it.
        is_likely: The name speaks for it, not the unit alone.
    """

    channel: str
    line: str
    unit_from: UnitSource
    is_likely: bool


@dataclass(frozen=True)
class FreeColumn:
    """A column that no channel claims.

    Attributes:
        name: As it stands in the file.
        unit: Unit text that the file gives, or None.
        low: Smallest value, in the file's unit; None without any.
        high: Largest value.
        num_values: Number of values [1]; None where they were not looked at.
        text: What stands in it instead of numbers, or empty.
        proposals: What it may be, likely ones first.
    """

    name: str
    unit: str | None
    low: float | None
    high: float | None
    num_values: int | None
    text: str = ""
    proposals: tuple[Proposal, ...] = ()

    def shown(self) -> str:
        """Return what stands in the column, in words."""
        if self.text:
            return f"text: {printable(flat(self.text))[:60]}"
        unit = f" {printable(flat(self.unit))}" if self.unit else ", no unit given"
        if self.low is None or self.high is None:
            return f"{'no values' if self.num_values == 0 else 'values not looked at'}{unit}"
        if self.low == self.high:
            many = "1 value" if self.num_values == 1 else "throughout"
            return f"{self.low:.6g}{unit} ({many})"
        return f"{self.low:.4g} … {self.high:.4g}{unit}"


@dataclass(frozen=True)
class Survey:
    """What one file holds.

    Attributes:
        path: The file.
        reader: Format.
        recognised: How each column became a channel, without any motor file.
        derived: Formula of each channel that follows from others.
        free: Columns that no channel claims.
        questions: What the file leaves open about columns that would be recognised: problem and
            remedy.
        constants: Scalars of the file by name.
        preamble: Lines above the table.
    """

    path: str
    reader: str
    recognised: tuple[ColumnReading, ...]
    derived: Mapping[str, str]
    free: tuple[FreeColumn, ...]
    questions: tuple[str, ...] = ()
    constants: Mapping[str, float] | None = None
    preamble: tuple[str, ...] = ()

    @property
    def channels(self) -> frozenset[str]:
        """Channels that a record of this file has."""
        return frozenset((*(one.channel for one in self.recognised), *self.derived))


def flat(text: str) -> str:
    """Return a text on one line."""
    return " ".join(text.split())


def survey(path: Path, sheet: str | None = None) -> Survey:
    """Look at a file.

    Args:
        path: A bench file of any format that is read.
        sheet: Sheet of a workbook; by default the one with the channels.

    Raises:
        InputError: If it cannot be read as a table of numbers, or heatrun itself has written it.
    """
    refuse_own_file(path, for_fit=True)
    where = str(path)
    with open_input(path) as stream, opened(stream, where) as measurement:
        if measurement is not None:
            return _of_measurement(measurement, where)
        return _of_table(read_whole(stream, where, sheet), where)


def _of_table(table: Table, where: str) -> Survey:
    readings, derived, questions = _mapped(table, where)
    used = {one.column for one in readings}
    free = [_free(column, where) for column in table.columns if column.name not in used]
    free += [FreeColumn(name, None, None, None, 0, text or "nothing")
             for name, text in table.text_columns.items()]  # fmt: skip
    preamble = tuple(
        note.removeprefix("Preamble: ") for note in table.notes if note.startswith("Preamble: ")
    )
    return Survey(
        where, table.reader, readings, derived, tuple(free), questions, table.constants, preamble
    )


def _of_measurement(measurement: Measurement, where: str) -> Survey:
    header = header_of(measurement, {})
    if not header.channels:
        read_all(measurement, where=where)  # it says what is wrong
    readings, derived, questions = _mapped(header.table(1), where)
    used = {one.column for one in readings}
    free = []
    for column in header.table(1).columns:
        stored = header.channels.get(column.name)
        if stored is None or column.name in used:
            continue
        if stored.refusal is None and len(free) < MOST_SAMPLED:
            (series,) = measurement.read([stored])
            free.append(_free(column, where, series.values))
        else:
            found = _free(column, where)
            free.append(replace(found, low=None, high=None, num_values=None))
    free += [FreeColumn(name, None, None, None, 0, text) for name, text in header.texts.items()]
    return Survey(where, measurement.reader, readings, derived, tuple(free), questions)


def _mapped(
    table: Table, where: str
) -> tuple[tuple[ColumnReading, ...], dict[str, str], tuple[str, ...]]:
    """Return what is recognised; a channel about which there is a question is left out."""
    left_out: dict[str, str] = {}
    questions = []
    while True:
        try:
            mapped = map_columns(table, left_out, where=where, is_part=True)
        except InputError as error:
            questions.append(f"{error}")
            named = [name for name in _channels_in(error) if name not in left_out]
            if not named:
                return (), {}, tuple(questions)
            left_out[named[0]] = NOT_RECORDED
            continue
        channels, _ = derive(mapped.channels)
        read = {one.channel for one in mapped.readings}
        return mapped.readings, formulas(channels, read), tuple(questions)


def _channels_in(error: InputError) -> Iterator[str]:
    """Return the channels that an error is about: where it says, then what it says."""
    for text in (error.where.rpartition(" as ")[2], error.problem, error.remedy):
        yield from CHANNEL_NAME.findall(text)


def _free(column: Column, where: str, values: np.ndarray | None = None) -> FreeColumn:
    numbers = column.values if values is None else values
    numbers = numbers[np.isfinite(numbers)]
    stated = statements(column)
    return FreeColumn(
        column.name,
        stated[0].text if stated else column.unit,
        float(numbers.min()) if numbers.size else None,
        float(numbers.max()) if numbers.size else None,
        int(numbers.size),
        proposals=tuple(_proposals(column, where)),
    )


def _proposals(column: Column, where: str) -> list[Proposal]:
    """Return the channels whose quantity the column's unit is of, and those its name speaks of."""
    if np.isfinite(column.values).sum() == 1 < column.values.size:
        return []  # a remark in a cell, no course
    likely = likely_channels(column.label)
    found = []
    for channel in CHANNEL.values():
        name_speaks = channel.name in likely
        try:
            _, unit_from = unit_of(column, channel, where)
        except InputError:
            # of another quantity; or the file leaves it open, and the line would decide it
            if statements(column) or not name_speaks:
                continue
            unit_from = "assumed"
        if unit_from == "assumed" and not name_speaks:
            continue
        line = f"{column.name} [{channel.unit}]" if unit_from == "assumed" else column.name
        found.append(Proposal(channel.name, line, unit_from, name_speaks))
    order = {name: place for place, name in enumerate(likely)}
    return sorted(found, key=lambda one: order.get(one.channel, len(order)))
