"""The mean of three sensors as a line of `[columns]`, for `heatrun init` to offer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from ..errors import InputError
from .channels.channel_map import map_columns
from .channels.claims import Columns
from .channels.schema import CHANNEL
from .channels.units import find_unit, to_canonical
from .free_columns import FreeColumn, Proposal
from .phase_sensors import Sensor, phases
from .readers.table import Column, Table

MADE_OF_PHASES = ("winding_degC", "phase_current_A")
MOST_MEANS = 20
"""Of one file; each is read back, which takes a while in files of thousands of columns."""


@dataclass(frozen=True)
class PhaseMean:
    """Three columns of which one channel may be the mean.

    Attributes:
        channel: Canonical name.
        line: Right-hand side of `[columns]` that reads it so.
        columns: Their names, in the order of the phases.
    """

    channel: str
    line: str
    columns: tuple[str, ...]


def phase_means(
    table: Table,
    free: Sequence[FreeColumn],
    values: Mapping[int, np.ndarray],
    known: Collection[str],
    left_out: Columns,
    where: str,
) -> tuple[PhaseMean, ...]:
    """Return the means that channels may be, each of them read back once.

    Args:
        table: With the columns of the file.
        free: Those that no channel claims.
        values: Identity of a column to what it holds, shape (time,), where it was looked at.
        known: Channels that are recognised already.
        left_out: `[columns]` that leave out what the file asks about.
        where: The file.
    """
    many = Counter(column.name for column in table.columns)
    columns = {
        column.name: column
        for column in table.columns
        if many[column.name] == 1 and id(column) in values
    }
    found: list[PhaseMean] = []
    for channel in MADE_OF_PHASES:
        if channel in known:
            continue
        held = {
            one.name: proposal
            for one in free
            if one.name in columns and not one.is_silent
            for proposal in one.proposals
            if proposal.channel == channel
            and (proposal.is_likely or not any(other.is_likely for other in one.proposals))
        }
        sensors = {
            name: _sensor(columns[name], values[id(columns[name])], proposal)
            for name, proposal in held.items()
        }
        for names in islice(phases(sensors, CHANNEL[channel].quantity), MOST_MEANS):
            if any({*names} & {*other.columns} for other in found):
                continue
            three = [columns[name] for name in names]
            for line in _lines(three, [held[name] for name in names], table):
                if _reads_back(table, channel, line, names, left_out, where):
                    found.append(PhaseMean(channel, line, names))
                    break
    return tuple(found)


def _sensor(column: Column, values: np.ndarray, proposal: Proposal) -> Sensor:
    unit = find_unit(proposal.unit, CHANNEL[proposal.channel].quantity)
    known = values if unit is None else to_canonical(values, unit)
    return Sensor(column.label, known, proposal.is_likely)


def _lines(three: Sequence[Column], proposals: Sequence[Proposal], table: Table) -> Iterator[str]:
    """Yield the lines that may read a mean, the one that is easiest to read first."""
    many = Counter(name for column in table.columns for name in {column.label, column.name})
    if all(one.unit_from == "stated" for one in proposals) and all(
        many[column.label] == 1 for column in three
    ):
        yield f"mean({', '.join(column.label for column in three)})"
    if all(one.unit_from == "assumed" for one in proposals):
        yield f"mean({', '.join(column.name for column in three)}) [{proposals[0].unit}]"
    yield f"mean({', '.join(one.line for one in proposals)})"


def _reads_back(
    table: Table,
    channel: str,
    line: str,
    names: tuple[str, ...],
    left_out: Columns,
    where: str,
) -> bool:
    try:
        mapped = map_columns(table, {**left_out, channel: line}, where=where, is_part=True)
    except InputError:
        return False
    return channel in mapped.columns and mapped.names(channel) == names
