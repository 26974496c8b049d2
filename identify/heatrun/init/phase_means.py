"""Sensors of the three phases, and their mean or sum as a line of `[columns]` for `init` to offer.

The names are alike but for one sign, U, V and W, or 1, 2 and 3. T_U, T_V and T_W may also be room,
inlet and winding, and T1 to T3 anything, so the values decide: sensors of one winding stay within a
few kelvin of each other while they warm by much more, and currents of a balanced machine within a
tenth of their value, as the powers of three wattmeters beside them.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from ..errors import InputError
from ..readers.channel_map import map_columns
from ..record.channels import CHANNEL, Columns
from ..record.several import APART_K, APART_SHARE
from ..record.table import Column, Table
from .free_columns import NUM_SAMPLES, FreeColumn, Proposal, in_its_unit, samples_of

PHASES = ("UVW", "uvw", "123", "ABC", "abc")
SIGN = re.compile(f"[{''.join(first[0] for first in PHASES)}]")

LEAST_RISE_K = 10.0
"""Below it, sensors anywhere in a machine read the same [K]."""

CLOSE_SHARE = 0.1
"""Sensors whose names say nothing agree to this share of their rise, currents of theirs [1]."""


@dataclass(frozen=True)
class Sensor:
    """A column that may be the sensor of one phase."""

    column: Column  # The column.
    as_read: Proposal  # How it is the channel.
    values: np.ndarray  # In the channel's unit, shape (time,).


def _phases(sensors: Iterable[Sensor], quantity: str) -> Iterator[list[Sensor]]:
    """Yield three sensors of one winding, in the order of the phases."""
    by_label = {sensor.column.label: sensor for sensor in sensors}
    for label in by_label:
        for sign in SIGN.finditer(label):
            place = sign.start()
            letters = next(letters for letters in PHASES if letters[0] == sign[0])
            alike = [f"{label[:place]}{letter}{label[place + 1 :]}" for letter in letters]
            if not all(one in by_label for one in alike):
                continue
            three = [by_label[one] for one in alike]
            if _is_one_winding(three, quantity):
                yield three


def _is_one_winding(three: Sequence[Sensor], quantity: str) -> bool:
    stacked = np.stack([samples_of(sensor.values, NUM_SAMPLES) for sensor in three])
    stacked = stacked[:, np.all(np.isfinite(stacked), axis=0)]
    if stacked.shape[1] < 2:
        return False
    middle = np.median(stacked, axis=0)
    apart = float(np.max(np.quantile(np.abs(stacked - middle), 0.95, axis=1)))
    low, high = np.quantile(middle, (0.01, 0.99))
    if quantity in ("phase current", "power"):
        return high > 0.0 and apart <= CLOSE_SHARE * high
    rise = float(high - low)
    if all(sensor.as_read.is_likely for sensor in three):
        return apart <= max(APART_K, APART_SHARE * rise)
    return rise >= LEAST_RISE_K and apart <= min(APART_K, CLOSE_SHARE * rise)


MADE_OF_PHASES = {"winding_degC": "mean", "phase_current_A": "mean", "electrical_power_W": "sum"}
"""Channels that three columns make, and how; a power last, beside three currents alone."""

MOST_MEANS = 20
"""Of one file; each is read back, which takes a while in files of thousands of columns."""


@dataclass(frozen=True)
class PhaseMean:
    """Three columns of which one channel may be the mean, or the sum."""

    channel: str  # Canonical name.
    line: str  # Right-hand side of `[columns]` that reads it so.
    columns: tuple[str, ...]  # Their names, in the order of the phases.


def phase_means(
    table: Table,
    free: Sequence[FreeColumn],
    values: Mapping[int, np.ndarray],
    known: Collection[str],
    left_out: Columns,
    where: str,
) -> tuple[PhaseMean, ...]:
    """Return the means that channels may be, each of them read back once.

    `free` are the columns of the table that no channel claims, `values` what columns hold, shape
    (time,), by identity, where it was looked at, `known` the channels that are recognised already,
    `left_out` the lines of `[columns]` that leave out what the file asks about.
    """
    many = Counter(column.name for column in table.columns)
    columns = {
        column.name: column
        for column in table.columns
        if many[column.name] == 1 and id(column) in values
    }
    found: list[PhaseMean] = []
    for channel, how in MADE_OF_PHASES.items():
        has_currents = any(one.channel == "phase_current_A" for one in found)
        if channel in known or (how == "sum" and not has_currents):
            continue
        sensors = []
        for one in free:
            column, as_read = columns.get(one.name), one.read_as(channel)
            is_others = any(other.is_likely for other in one.proposals)
            is_others |= channel in one.evidence and not one.evidence[channel].speaks
            if column and as_read and not one.is_silent and (as_read.is_likely or not is_others):
                sensors.append(Sensor(column, as_read, in_its_unit(values[id(column)], as_read)))
        for three in islice(_phases(sensors, CHANNEL[channel].quantity), MOST_MEANS):
            names = tuple(one.column.name for one in three)
            if any({*names} & {*other.columns} for other in found):
                continue
            for line in _lines(how, three, table):
                if _reads_back(table, channel, line, names, left_out, where):
                    found.append(PhaseMean(channel, line, names))
                    break
    return tuple(found)


def _lines(how: str, three: Sequence[Sensor], table: Table) -> Iterator[str]:
    """Yield the lines that may read three columns, the one that is easiest to read first."""
    many = Counter(name for column in table.columns for name in {column.label, column.name})
    labels, proposals = zip(*((one.column.label, one.as_read) for one in three), strict=True)
    if {one.unit_from for one in proposals} == {"stated"} and all(
        many[label] == 1 for label in labels
    ):
        yield f"{how}({', '.join(labels)})"
    yield f"{how}({', '.join(one.line for one in proposals)})"


def _reads_back(
    table: Table, channel: str, line: str, names: tuple[str, ...], left_out: Columns, where: str
) -> bool:
    try:
        mapped = map_columns(table, {**left_out, channel: line}, where=where, is_part=True)
    except InputError:
        return False
    return channel in mapped.taken and mapped.names(channel) == names
