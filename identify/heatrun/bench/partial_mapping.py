"""Columns mapped as far as it goes: a channel about which there is a question is left out."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from ..errors import InputError
from .channels.channel_map import MappedColumns, map_columns
from .channels.claims import NOT_RECORDED, Columns
from .channels.derive import derive, formulas
from .channels.schema import CHANNEL
from .readers.table import Table

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

    mapped: MappedColumns = field(default_factory=lambda: MappedColumns({}))
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
                return PartialMapping(MappedColumns({}, unused=names), {}, tuple(faults))
            lines[named[0]] = NOT_RECORDED
            continue
        channels, _ = derive(mapped.channels)
        read = {one.channel for one in mapped.readings}
        return PartialMapping(mapped, formulas(channels, read), tuple(faults), lines)


def _channels_in(error: InputError) -> Iterator[str]:
    """Return the channels that an error is about: where it says, then what it says."""
    for text in (error.where.rpartition(" as ")[2], error.problem, error.remedy):
        yield from CHANNEL_NAME.findall(text)
