"""A record as it would be if one column were in another unit than it was read in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....motor import Motor
from ...channels.derive import constants_of, derive, formulas
from ...channels.schema import CHANNEL
from ...channels.unit_table import QUANTITIES, Unit
from ...channels.units import find_unit, to_canonical
from ...record import ColumnReading, Record
from ..samples import is_measured

LEAST_FACTOR = 1.4
"""Units closer than this [1], such as foot-pounds and newton metres, are no matter of relations
that hold within a factor."""

RESISTANCES = (
    (1e-3, "phase_resistance_ohm is in milliohm"),
    (0.5, "phase_resistance_ohm was measured between two terminals in star"),
)
"""What is mistaken with the resistance, with the factor to the right one [1]."""


@dataclass(frozen=True)
class OtherReading:
    """One way in which the inputs may have been misread.

    Attributes:
        channels: Channels whose columns would be in another unit; none for the motor file.
        units: Symbol of that unit for each channel; none for the motor file.
        factor: New value over present one [1].
        record: The record as it would be.
        motor: The motor as it would be.
        readings: How the columns were read; empty where that is not known.
        sentence: What is supposed, for the message.
    """

    channels: tuple[str, ...]
    units: tuple[str, ...]
    factor: float
    record: Record
    motor: Motor
    readings: tuple[ColumnReading, ...]
    sentence: str

    @property
    def unit(self) -> str:
        """The units in one word or more, empty for the motor file."""
        return " and ".join(dict.fromkeys(self.units))

    @property
    def is_decided(self) -> bool:
        """Whether the motor file itself gives what it denies."""
        return self.record.decided.issuperset(self.channels)

    @property
    def is_assumed(self) -> bool:
        """Whether nothing at all said the unit that it denies."""
        return any(one.unit_from == "assumed" for one in self.readings)


def other_readings(record: Record, motor: Motor) -> Iterator[OtherReading]:
    """Yield the record with each column, and each group of like columns, in each other unit.

    Args:
        record: Any record; where it does not tell how it was read, every channel counts as read.
        motor: The machine.
    """
    read = {one.channel: one for one in record.mapping}
    names = [name for name in record.channels if name in CHANNEL and _is_read(name, read)]
    for group in _groups(names):
        quantity = CHANNEL[group[0]].quantity
        present = {_unit_of(name, read) for name in group}
        if len(present) > 1:
            continue
        (as_read,) = present
        if quantity == "temperature":
            continue  # told by value, see `heatrun.bench.checks.units`
        alike = {(as_read.factor, as_read.offset)}  # Nmm says no more than mNm
        for unit in QUANTITIES[quantity]:
            factor = unit.factor / as_read.factor
            is_near = abs(math.log(factor)) < math.log(LEAST_FACTOR)
            is_same = (unit.factor, unit.offset) in alike
            if is_same or (is_near and unit.offset == as_read.offset):
                continue
            alike.add((unit.factor, unit.offset))
            other = _reread(record, motor, group, as_read, unit, read)
            if any(_num_measured(other, name) < _num_measured(record, name) for name in group):
                continue  # beyond all measure, where no relation has a say
            yield OtherReading(
                tuple(group),
                (unit.symbol,) * len(group),
                factor,
                other,
                motor,
                tuple(read[name] for name in group if name in read),
                f"{' and '.join(group)} {'are' if len(group) > 1 else 'is'} in {unit.symbol}",
            )
    if motor.phase_resistance_ohm is not None:
        for factor, sentence in RESISTANCES:
            other = replace(motor, phase_resistance_ohm=factor * motor.phase_resistance_ohm)
            yield OtherReading((), (), factor, record, other, (), sentence)


def scaled_readings(record: Record, motor: Motor) -> Iterator[OtherReading]:
    """Yield the record with powers and phase current both in thousands, or in thousandths.

    Args:
        record: Any record.
        motor: The machine.
    """
    read = {one.channel: one for one in record.mapping}
    names = [name for name in record.channels if name in CHANNEL and _is_read(name, read)]
    powers = [name for name in names if CHANNEL[name].quantity == "power"]
    currents = [name for name in names if CHANNEL[name].quantity == "phase current"]
    if not powers or not currents:
        return
    for prefix, factor in (("k", 1e3), ("m", 1e-3)):
        other, units = record, []
        for name in (*powers, *currents):
            as_read = _unit_of(name, read)
            unit = find_unit(prefix + as_read.symbol, CHANNEL[name].quantity)
            if unit is None:
                break
            other = _reread(other, motor, [name], as_read, unit, read)
            units.append(unit.symbol)
        if len(units) < len(powers) + len(currents):
            continue
        channels = (*powers, *currents)
        yield OtherReading(
            channels,
            tuple(units),
            factor,
            other,
            motor,
            tuple(read[name] for name in channels if name in read),
            " and ".join(f"{n} is in {u}" for n, u in zip(channels, units, strict=True)),
        )


def _is_read(name: str, read: dict[str, ColumnReading]) -> bool:
    """Whether a channel came from a file; a time from a sampling rate counts as read too."""
    return not read or name in read or name == "time_s"


def _groups(names: Sequence[str]) -> list[list[str]]:
    """Each channel alone, then all channels of one quantity: a bench writes all powers in kW."""
    like: dict[str, list[str]] = {}
    for name in names:
        like.setdefault(CHANNEL[name].quantity, []).append(name)
    return [[name] for name in names] + [group for group in like.values() if len(group) > 1]


def _unit_of(name: str, read: dict[str, ColumnReading]) -> Unit:
    quantity = CHANNEL[name].quantity
    found = find_unit(read[name].unit, quantity) if name in read else None
    return found or QUANTITIES[quantity][0]


def _reread(
    record: Record,
    motor: Motor,
    names: Sequence[str],
    as_read: Unit,
    unit: Unit,
    read: dict[str, ColumnReading],
) -> Record:
    """Return a record with columns in another unit, and what was derived from them anew."""
    channels = dict(record.channels)
    for name in names:
        raw = (np.asarray(channels[name], dtype=float) - as_read.offset) / as_read.factor
        channels[name] = to_canonical(raw, unit)
    if read:
        given = read.keys() | constants_of(record.notes)
        for name in formulas(channels, given):
            del channels[name]
        channels, _ = derive(channels, phases=motor.phases, losses=motor.losses)
    return replace(record, channels=channels, findings=())


def _num_measured(record: Record, name: str) -> int:
    return int(np.sum(is_measured(np.asarray(record[name], dtype=float))))
