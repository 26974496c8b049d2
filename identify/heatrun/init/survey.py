"""What a bench file holds before any motor file says so: columns recognised, and all the others.

A test that cannot be read yet is mapped as far as it goes: a channel about which there is a
question is left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..checks.presence import missing_channel
from ..errors import InputError
from ..io.open_file import open_input
from ..io.own_files import refuse_own_file
from ..io.quantities import printable
from ..io.toml_text import table_header
from ..readers.channel_map import MappedColumns, map_columns
from ..readers.joined import files_of, has_rate
from ..readers.measurement import Measurement, header_of
from ..readers.multirate import read_all
from ..readers.read import name_of_test, opened, read_whole
from ..readers.text.reader import Hints, hints_of
from ..record.by_resistance import tells_winding
from ..record.channels import CHANNEL, NOT_RECORDED, REQUIRED, Columns
from ..record.derive import derive, formulas
from ..record.motor import Motor
from ..record.record import ColumnReading, Finding, Record
from ..record.table import Table, preamble_of
from .evidence import of_one_machine, without_misnamed
from .free_columns import Evidence, FreeColumn, falls, flat, free_column, text_column
from .phase_means import PhaseMean, phase_means

MOST_SAMPLED = 200
"""Channels of a measurement file of which values are looked at; each is read whole."""

NEEDED = frozenset(REQUIRED) - {"time_s"}
"""Channels that a calibration cannot do without; zeros alone in one of them are told."""


@dataclass(frozen=True)
class SilentColumn:
    """A column that is recognised and holds zeros alone, or no value."""

    channel: str  # Canonical name.
    column: str  # As it stands in the file.
    is_empty: bool  # It holds no value at all.

    @property
    def held(self) -> str:
        """What it holds, in words."""
        return "no values" if self.is_empty else "0 throughout"


@dataclass(frozen=True)
class Survey:
    """What one file holds."""

    path: str  # The file.
    reader: str  # Format.
    # How each column became a channel, without any motor file.
    recognised: tuple[ColumnReading, ...]
    derived: Mapping[str, str]  # Formula of each channel that follows from others.
    free: tuple[FreeColumn, ...]  # Columns that no channel claims.
    # What the file leaves open about columns that would be recognised: problem and remedy.
    questions: tuple[str, ...] = ()
    constants: Mapping[str, float] | None = None  # Scalars of the file by name.
    preamble: tuple[str, ...] = ()  # Lines above the table.
    # Columns that are recognised and hold nothing, for channels that a calibration needs.
    silent: tuple[SilentColumn, ...] = ()
    means: tuple[PhaseMean, ...] = ()  # Columns of three phases that a channel may be the mean of.
    findings: tuple[Finding, ...] = ()  # What the reader left out or doubts.
    test: str = ""  # The test that it is a file of, as the command line names it.
    machines: str = ""  # What is to be said of columns of a second machine, or empty.
    # The winding that is recognised falls from the first sample to the last.
    only_cools: bool = False

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
    """Look at a bench file; of a workbook, at the sheet with the channels or the one that is named.

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
    """Return what is known of the columns of numbers of a table, beside what is recognised.

    The columns of a measurement file are placeholders; `values` is what they hold, shape (time,),
    by identity, where it was looked at.
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
    free, machines = of_one_machine(free)
    misnamed = {one.channel: one.column for one in mapped.readings if one not in readings}
    derived = {
        channel: formula
        for channel, formula in found.derived.items()
        if not any(name in formula for name in misnamed)
    }
    silent = tuple(
        SilentColumn(one.channel, one.column, not np.isfinite(numbers).any())
        for one in readings
        if one.channel in NEEDED and (numbers := read.get(one.column)) is not None
        if not np.nan_to_num(numbers).any()
    )
    unheard = {one.channel for one in silent}
    heard = tuple(one for one in readings if one.channel not in unheard)
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
        (*([machines] if machines else ()), *(str(fault) for fault in found.faults), *said),
        silent=silent,
        means=phase_means(table, free, values, known, found.lines, where),
        machines=machines,
        only_cools=any(
            falls(read[one.column])
            for one in heard
            if one.channel == "winding_degC" and one.column in read
        ),
    )


CHANNEL_NAME = re.compile("|".join(sorted(map(re.escape, CHANNEL), key=len, reverse=True)))


@dataclass(frozen=True)
class PartialMapping:
    """What became of the columns of a table."""

    # The channels that could be read.
    mapped: MappedColumns = field(default_factory=lambda: MappedColumns(""))
    # Formula of each channel that follows from others.
    derived: Mapping[str, str] = field(default_factory=dict)
    faults: tuple[InputError, ...] = ()  # Why others could not.
    # `[columns]` as they were used: those given, and what leaves out the others.
    lines: Columns = field(default_factory=dict)

    @property
    def channels(self) -> frozenset[str]:
        """Canonical names of all of them."""
        return frozenset((*(one.channel for one in self.mapped.readings), *self.derived))


def map_as_far(table: Table, columns: Columns | None = None, *, where: str) -> PartialMapping:
    """Return the channels of a table, and why a column that claims to be one is none.

    A column that `[columns]` names and the table does not have is passed over.
    """
    lines = dict(columns or {})
    faults: list[InputError] = []
    while True:
        try:
            mapped = map_columns(table, lines, where=where, is_part=True)
        except InputError as error:
            faults.append(error)
            named = [name for name in _channels_in(error) if lines.get(name) != NOT_RECORDED]
            if not named:
                names = (*(column.name for column in table.columns), *table.text_columns)
                return PartialMapping(MappedColumns(where, unused=names), {}, tuple(faults))
            lines[named[0]] = NOT_RECORDED
            continue
        channels, _ = derive(mapped.channels)
        read = {one.channel for one in mapped.readings}
        return PartialMapping(mapped, formulas(channels, read), tuple(faults), lines)


def _channels_in(error: InputError) -> Iterator[str]:
    """Return the channels that an error is about: where it says, then what it says."""
    for text in (error.where.rpartition(" as ")[2], error.problem, error.remedy):
        yield from CHANNEL_NAME.findall(text)


@dataclass(frozen=True)
class UnreadTest:
    """What is known of a test that cannot be read."""

    name: str  # Name of the test.
    # Why it cannot be read, then each further channel that a fit lacks.
    findings: tuple[Finding, ...]
    mapping: tuple[ColumnReading, ...]  # How columns became channels as far as they do.
    unused: tuple[str, ...]  # Columns that no channel claims.


def unread_test(path: Path | str, motor: Motor, error: InputError) -> UnreadTest | None:
    """Return what a test holds whose reading ended in an error; path as `read_test`.

    None if a file of it is none that can be looked at a second time, or no table: the error then
    says all there is to say.
    """
    files = files_of(path)
    if not all(_is_regular(file) for file, _ in files):
        return None  # what came through a pipe is gone
    try:
        found = [_mapping_of(file, sheet, motor) for file, sheet in files]
    except InputError:
        return None
    name = name_of_test(*files[0])
    faults = {str(one): one for one in (error, *(fault for each in found for fault in each.faults))}
    reasons = [
        Finding("not_read", "error", one.problem, one.where or str(path), one.remedy)
        for one in faults.values()
    ]
    channels = {channel for each in found for channel in each.channels}
    if has_rate(path) or any(each.mapped.rate_Hz is not None for each in found):
        channels.add("time_s")
    told = {one.where.rpartition(" as ")[2] for one in faults.values()}
    named = {channel for one in faults.values() for channel in [*_channels_in(one)][:1]}
    absent = [one for one in motor.columns_of(name) if one not in channels | told | named]
    if absent and named & motor.columns_of(name).keys():
        own = f"{table_header('tests', name)[:-1]}.columns]"
        reasons[0] = replace(
            reasons[0],
            message=f"{reasons[0].message} Nor has it what [columns] names for "
            f"{', '.join(absent)}.",
            remedy=f"If it is of another logger, name its columns under {own}; heatrun init {path} "
            f"--out draft.toml proposes them. {reasons[0].remedy}",
        )
        channels |= {*absent, *named}
    held = {channel: np.ones(1) for channel in CHANNEL if channel in channels}
    held, _ = derive(held, phases=motor.phases, losses=motor.losses, constants=motor.constants)
    if tells_winding(held):
        held.setdefault("winding_degC", np.ones(1))
    lacking = (
        finding
        for finding in missing_channel(Record(name, held), motor)
        if finding.where.rpartition(", ")[2] not in told
    )
    return UnreadTest(
        name,
        tuple(replace(finding, test=name) for finding in (*reasons, *lacking)),
        tuple(reading for each in found for reading in each.mapped.readings),
        tuple(dict.fromkeys(column for each in found for column in each.mapped.unused)),
    )


def _mapping_of(path: Path, sheet: str | None, motor: Motor) -> PartialMapping:
    """Return what becomes of the columns of a file by the motor file."""
    where = str(path)
    columns = motor.columns_of(name_of_test(path, sheet))
    refuse_own_file(path, for_fit=False)
    with open_input(path) as stream, opened(stream, where, columns) as measurement:
        if measurement is not None:
            table = header_of(measurement, columns).table(1)
        else:
            hints = hints_of(columns, motor.decimal, where=where, sheet=sheet)
            table = read_whole(stream, where, hints)
    return map_as_far(table, columns, where=where)


def _is_regular(file: Path) -> bool:
    try:
        return file.is_file()
    except (OSError, ValueError):
        return False
