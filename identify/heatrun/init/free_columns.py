"""Columns that no channel claims: how their values run, and which channels they may be."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from ..errors import InputError
from ..io.quantities import printable
from ..readers.clock import parse_time_format, read_stated
from ..readers.labels import named_unit, speaks_of
from ..readers.likely_names import LIKELY, NOT_THE_SHAFTS, read_name
from ..readers.mapping import statements, unit_of
from ..record.channels import CHANNEL
from ..record.record import ColumnReading, UnitSource
from ..record.table import Column
from ..record.units import find_unit, refusal, to_canonical
from .relations import COLDEST, HOTTEST, LEAST_RISE_K, SPIKES

CLOCK_FORMATS = ("hh:mm:ss:ff", "d:hh:mm:ss", "d.hh:mm:ss", "d hh:mm:ss", "hh:mm:ss",
                 "hh.mm.ss", "hh-mm-ss")  # fmt: skip
"""What a text that looks like a clock may be written in."""


def flat(text: str) -> str:
    """Return a text on one line."""
    return " ".join(text.split())


@dataclass(frozen=True)
class Proposal:
    """A channel that a column may be.

    Attributes:
        channel: Canonical name.
        line: Right-hand side of `[columns]` that reads the column so.
        unit_from: How its unit is known; `"assumed"` if the line itself states it.
        score: How surely the name speaks for it, as `likely_names`; 0 for the unit alone.
        unit: Unit that it is read in.
    """

    channel: str
    line: str
    unit_from: UnitSource
    score: int
    unit: str = ""

    @property
    def is_likely(self) -> bool:
        """The name speaks for it, not the unit alone."""
        return self.score >= LIKELY


@dataclass(frozen=True)
class Evidence:
    """What the values of a column say of it as a channel.

    Attributes:
        speaks: For the channel, or against it.
        words: Why.
        is_alone: For this channel and no other.
        cold: Resistance [ohm] that a winding began with and the room's temperature then [degC];
            None where it is no winding's voltage, or something was not as cold as the room.
    """

    speaks: bool
    words: str
    is_alone: bool = False
    cold: tuple[float, float] | None = None


@dataclass(frozen=True)
class Course:
    """The course of one column, in the unit of the file.

    Attributes:
        low: Value that 99 % of the samples exceed.
        high: Value that 1 % of the samples exceed.
        mean: Mean of the samples.
        is_growing: No sample is smaller than the one before it, and the last exceeds the first.
    """

    low: float
    high: float
    mean: float
    is_growing: bool = False

    @property
    def may_be_a_temperature(self) -> bool:
        """It runs as one in °C does that answers to a load."""
        is_inside = COLDEST <= self.low <= self.high <= HOTTEST
        return is_inside and self.high - self.low >= LEAST_RISE_K and not self.is_growing

    def converted(self, factor: float, offset: float) -> Course:
        """Return the course in another unit: `factor * value + offset`, with a positive factor."""
        low, high, mean = (factor * value + offset for value in (self.low, self.high, self.mean))
        return Course(low, high, mean, self.is_growing)

    def read_as(self, one: Proposal) -> Course:
        """Return the course in the unit of a channel that its column may be."""
        unit = find_unit(one.unit, CHANNEL[one.channel].quantity)
        return self if unit is None else self.converted(unit.factor, unit.offset)


def course_of(values: np.ndarray) -> Course | None:
    """Return the course of finite values, shape (time,), in their unit; None without a value."""
    if values.size == 0:
        return None
    low, high = np.quantile(values, (SPIKES, 1.0 - SPIKES))
    is_growing = bool(values[-1] > values[0] and np.all(np.diff(values) >= 0.0))
    return Course(float(low), float(high), float(np.mean(values)), is_growing)


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
        course: How its values run, in the file's unit; None where they were not looked at.
        remark: Why it is no channel although it looks like one, or empty.
        evidence: Channel to what the other columns of the file say of it as that.
    """

    name: str
    unit: str | None
    low: float | None = None
    high: float | None = None
    num_values: int | None = None
    text: str = ""
    proposals: tuple[Proposal, ...] = ()
    course: Course | None = None
    remark: str = ""
    evidence: Mapping[str, Evidence] = field(default_factory=dict)

    @property
    def is_unknown(self) -> bool:
        """Nothing but its course says what it is."""
        # "log 1", the first column of a matrix, is no share
        is_named = any(one.score or one.unit != "1" for one in self.proposals)
        return not (is_named or self.unit or self.remark) and self.course is not None

    @property
    def is_silent(self) -> bool:
        """It holds zeros alone, or no value: nothing was recorded, or nothing happened."""
        is_zero = self.low == self.high == 0.0 and self.num_values != 1
        return is_zero or (self.num_values == 0 and not self.text)

    def read_as(self, channel: str) -> Proposal | None:
        """Return how it may be a channel, None if it is none of it."""
        return next((one for one in self.proposals if one.channel == channel), None)

    def shown(self) -> str:
        """Return what stands in the column, in words."""
        return f"{self._held()}; {self.remark}" if self.remark else self._held()

    def _held(self) -> str:
        if self.text:
            return f"text: {printable(flat(self.text))[:60]}"
        unit = f" {printable(flat(self.unit))}" if self.unit else ", no unit given"
        if self.low is None or self.high is None:
            return f"{'no values' if self.num_values == 0 else 'values not looked at'}{unit}"
        if self.is_silent:
            unit = unit if self.unit else ""
            return f"0{unit} throughout: not recorded, or 0 during the whole test"
        if self.low == self.high:
            many = "1 value" if self.num_values == 1 else "throughout"
            return f"{self.low:.6g}{unit} ({many})"
        return f"{self.low:.4g} … {self.high:.4g}{unit}"


def free_column(
    column: Column, where: str, values: np.ndarray | None, refused: Mapping[str, str]
) -> FreeColumn:
    """Look at a column.

    Args:
        column: The column.
        where: The file, for messages.
        values: What it holds, shape (time,), None if it was not read.
        refused: Name of a column to the reason why it is none, as a built-in map has it.
    """
    stated = statements(column)
    unit = stated[0].text if stated else column.unit
    reason = refused.get(column.name, "")
    proposals = [] if reason else _proposals(column, where)
    is_speed = not unit or any(one.channel == "speed_rpm" for one in proposals)
    if is_speed and read_name(column.label).is_electrical_speed:
        proposals, reason = [], NOT_THE_SHAFTS
    if not reason and not proposals and unit:
        reason = _refusal(unit, speaks_of(column.label))
    unseen = FreeColumn(column.name, unit, proposals=tuple(proposals), remark=reason)
    if values is None:
        return unseen
    numbers = values[np.isfinite(values)]
    is_remark = numbers.size == 1 < values.size  # in a cell: no course
    return replace(
        unseen,
        low=float(numbers.min()) if numbers.size else None,
        high=float(numbers.max()) if numbers.size else None,
        num_values=int(numbers.size),
        proposals=() if is_remark else unseen.proposals,
        course=course_of(numbers),
    )


def text_column(name: str, text: str) -> FreeColumn:
    """Look at a column without a number: one whose first cell is a clock time may be the time."""
    cell = pd.Series([text])
    lines = [
        Proposal("time_s", f"{name} [{form}]", "assumed", LIKELY)
        for form in CLOCK_FORMATS
        if (stated := parse_time_format(form)) and np.isfinite(read_stated(cell, stated).numbers[0])
    ]
    return FreeColumn(name, None, None, None, 0, text or "nothing", tuple(lines))


def _refusal(unit: str, likely: Iterable[str]) -> str:
    """Return why a unit does not determine the channel that a name speaks of, or an empty text."""
    for name in likely:
        if reason := refusal(unit, CHANNEL[name].quantity):
            return f"{name} is not read in {printable(flat(unit))}: {reason}"
    return ""


def _proposals(column: Column, where: str) -> list[Proposal]:
    """Return the channels whose quantity the column's unit is of, and those its name speaks of."""
    found = []
    stated = statements(column)
    for channel in CHANNEL.values():
        score = speaks_of(column.label, channel.quantity, stated[0].text if stated else None).get(
            channel.name, 0
        )
        try:
            text, unit_from = unit_of(column, channel, where)
        except InputError:
            # of another quantity; or the file leaves it open, and the line would decide it
            known = {find_unit(one.text, channel.quantity) for one in stated}
            if not score or None in known or len(known) > 1:
                continue
            unit_from = "assumed"
            named = named_unit(column.label, channel.quantity)
            text = named.unit if named and find_unit(named.unit, channel.quantity) else None
            if stated:  # "MW" in a name is also the German mean: what is marked goes before it
                text = stated[0].text
        if unit_from == "assumed" and not score:
            continue
        line = f"{column.name} [{text or channel.unit}]" if unit_from == "assumed" else column.name
        unit = find_unit(text, channel.quantity) if text else None
        symbol = unit.symbol if unit else channel.unit
        found.append(Proposal(channel.name, line, unit_from, score, symbol))
    return sorted(found, key=lambda one: -one.score)


def in_its_unit(values: np.ndarray, one: Proposal | ColumnReading) -> np.ndarray:
    """Return the values of a column in the unit of its channel, shape (time,)."""
    unit = find_unit(one.unit, CHANNEL[one.channel].quantity)
    return values if unit is None else to_canonical(values, unit)
