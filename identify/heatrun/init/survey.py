"""What a bench file holds before any motor file says so: columns recognised, and all the others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..io.open_file import open_input
from ..io.own_files import refuse_own_file
from ..io.quantities import printable
from ..readers.hints import Hints
from ..readers.measurement import Measurement, header_of
from ..readers.multirate import read_all
from ..readers.read import opened, read_whole
from ..record.channels import REQUIRED
from ..record.record import ColumnReading, Finding
from ..record.table import Table, preamble_of
from .evidence import without_misnamed
from .free_columns import Evidence, FreeColumn, flat, free_column, text_column
from .phase_means import PhaseMean, phase_means
from .unread import PartialMapping, map_as_far

MOST_SAMPLED = 200
"""Channels of a measurement file of which values are looked at; each is read whole."""

NEEDED = frozenset(REQUIRED) - {"time_s"}
"""Channels that a calibration cannot do without; zeros alone in one of them are told."""


@dataclass(frozen=True)
class SilentColumn:
    """A column that is recognised and holds zeros alone, or no value.

    Attributes:
        channel: Canonical name.
        column: As it stands in the file.
        is_empty: It holds no value at all.
    """

    channel: str
    column: str
    is_empty: bool

    @property
    def held(self) -> str:
        """What it holds, in words."""
        return "no values" if self.is_empty else "0 throughout"


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
        silent: Columns that are recognised and hold nothing, for channels that a calibration
            needs.
        means: Columns of three phases that a channel may be the mean of.
        findings: What the reader left out or doubts.
        test: The test that it is a file of, as the command line names it.
    """

    path: str
    reader: str
    recognised: tuple[ColumnReading, ...]
    derived: Mapping[str, str]
    free: tuple[FreeColumn, ...]
    questions: tuple[str, ...] = ()
    constants: Mapping[str, float] | None = None
    preamble: tuple[str, ...] = ()
    silent: tuple[SilentColumn, ...] = ()
    means: tuple[PhaseMean, ...] = ()
    findings: tuple[Finding, ...] = ()
    test: str = ""

    @property
    def channels(self) -> frozenset[str]:
        """Channels that a record of this file has, and that hold something."""
        return frozenset((*(one.channel for one in self.recognised), *self.derived))

    @property
    def file(self) -> str:
        """The name of the file on one line."""
        return printable(flat(Path(self.path).name))

    @property
    def under_direct_current(self) -> list[tuple[FreeColumn, Evidence]]:
        """Columns that are the voltage of a winding under direct current, and what says so."""
        said = ((one, one.evidence.get("winding_voltage_V")) for one in self.free)
        return [(one, evidence) for one, evidence in said if evidence and evidence.speaks]


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
        return _of_table(read_whole(stream, where, Hints(sheet=sheet)), where)


def _of_table(table: Table, where: str) -> Survey:
    # two columns of a worksheet may have one name
    values = {id(column): column.values for column in table.columns}
    found = _surveyed(table, values, map_as_far(table, where=where), where)
    texts = [text_column(name, text) for name, text in table.text_columns.items()]
    return replace(
        found,
        free=(*found.free, *texts),
        constants=table.constants,
        preamble=preamble_of(table.notes),
        findings=table.findings,
    )


def _of_measurement(measurement: Measurement, where: str) -> Survey:
    header = header_of(measurement, {})
    if not header.channels:
        read_all(measurement, where=where)  # it says what is wrong
    table = replace(header.table(1), reader=measurement.reader)
    mapped = map_as_far(table, where=where)
    readings = mapped.mapped.readings
    needed = {one.column for one in readings if one.channel in NEEDED}
    others = header.channels.keys() - {one.column for one in readings}
    readable = [name for name, stored in header.channels.items() if stored.refusal is None]
    looked_at = {name for name in readable if name in needed}
    looked_at |= {*[name for name in readable if name in others][:MOST_SAMPLED]}
    values = {
        id(column): measurement.read([header.channels[column.name]])[0].values
        for column in table.columns
        if column.name in looked_at
    }
    found = _surveyed(table, values, mapped, where)
    free = [one for one in found.free if one.name in header.channels]
    texts = [text_column(name, text) for name, text in header.texts.items()]
    return replace(found, free=(*free, *texts), findings=measurement.findings)


def _surveyed(
    table: Table, values: Mapping[int, np.ndarray], found: PartialMapping, where: str
) -> Survey:
    """Return what is known of the columns of numbers.

    Args:
        table: With the columns; of a measurement file with placeholders in them.
        values: Identity of a column to what it holds, shape (time,), where it was looked at.
        found: What is recognised.
        where: The file.
    """
    mapped = found.mapped
    used = {one.column for one in mapped.readings}
    free = tuple(
        free_column(column, where, values.get(id(column)), mapped.refused)
        for column in table.columns
        if column.name not in used
    )
    read = {one.name: values[id(one)] for one in table.columns if id(one) in values}

    def as_free(one: ColumnReading) -> FreeColumn:
        column = next(each for each in table.columns if each.name == one.column)
        return free_column(column, where, read.get(one.column), {})

    readings, free = without_misnamed(free, mapped.readings, read, as_free)
    misnamed = {one.channel: one.column for one in mapped.readings if one not in readings}
    derived = {
        channel: formula
        for channel, formula in found.derived.items()
        if not any(name in formula for name in misnamed)
    }
    silent = {}
    for one in readings:
        numbers = read.get(one.column)
        if one.channel in NEEDED and numbers is not None and not np.nan_to_num(numbers).any():
            is_empty = not np.isfinite(numbers).any()
            silent[one.channel] = SilentColumn(one.channel, one.column, is_empty)
    heard = tuple(one for one in readings if one.channel not in silent)
    known = {*(one.channel for one in heard), *derived}
    said = (
        f"'{one.name}' is called losses and {one.evidence['losses_W'].words}."
        for one in free
        if one.name == misnamed.get("losses_W")
    )
    return Survey(
        where,
        table.reader,
        heard,
        derived,
        free,
        (*(str(fault) for fault in found.faults), *said),
        silent=tuple(silent.values()),
        means=phase_means(table, free, values, known, found.lines, where),
    )
