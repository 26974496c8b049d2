"""A test that cannot be read yet: what its files hold, and which channels they lack.

Columns are mapped as far as it goes: a channel about which there is a question is left out.
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
from ..readers.channel_map import MappedColumns, map_columns
from ..readers.hints import hints_of
from ..readers.joined import files_of, has_rate
from ..readers.measurement import header_of
from ..readers.read import name_of_test, opened, read_whole
from ..record.by_resistance import tells_winding
from ..record.channels import CHANNEL, NOT_RECORDED, Columns
from ..record.derive import derive, formulas
from ..record.motor import Motor
from ..record.record import ColumnReading, Finding, Record
from ..record.table import Table

CHANNEL_NAME = re.compile("|".join(sorted(map(re.escape, CHANNEL), key=len, reverse=True)))


@dataclass(frozen=True)
class PartialMapping:
    """What became of the columns of a table.

    Attributes:
        mapped: The channels that could be read.
        derived: Formula of each channel that follows from others.
        faults: Why others could not.
        lines: `[columns]` as they were used: those given, and what leaves out the others.
    """

    mapped: MappedColumns = field(default_factory=lambda: MappedColumns(""))
    derived: Mapping[str, str] = field(default_factory=dict)
    faults: tuple[InputError, ...] = ()
    lines: Columns = field(default_factory=dict)

    @property
    def channels(self) -> frozenset[str]:
        """Canonical names of all of them."""
        return frozenset((*(one.channel for one in self.mapped.readings), *self.derived))


def map_as_far(table: Table, columns: Columns | None = None, *, where: str) -> PartialMapping:
    """Return the channels of a table, and why a column that claims to be one is none.

    Args:
        table: What a reader returned.
        columns: `[columns]` of the motor file; a column that it names and the table does not have
            is passed over.
        where: The file, for messages.
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
    """What is known of a test that cannot be read.

    Attributes:
        name: Name of the test.
        findings: Why it cannot be read, then each further channel that a fit lacks.
        mapping: How columns became channels as far as they do.
        unused: Columns that no channel claims.
    """

    name: str
    findings: tuple[Finding, ...]
    mapping: tuple[ColumnReading, ...]
    unused: tuple[str, ...]


def unread_test(path: Path | str, motor: Motor, error: InputError) -> UnreadTest | None:
    """Return what a test holds whose reading ended in an error.

    Args:
        path: As `heatrun.readers.joined.read_test`.
        motor: The machine.
        error: Why the test cannot be read.

    Returns:
        None if a file of it is none that can be looked at a second time, or no table: the error
        then says all there is to say.
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
    held = {channel: np.ones(1) for channel in CHANNEL if channel in channels}
    held, _ = derive(held, phases=motor.phases, losses=motor.losses, constants=motor.constants)
    if tells_winding(held):
        held.setdefault("winding_degC", np.ones(1))
    told = {one.where.rpartition(" as ")[2] for one in faults.values()}
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
