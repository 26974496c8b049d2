"""Columns that no channel claims: how their values run, and which channels they may be.

Courses of columns go together as powers, as a body that warms, as copper that warms. All arrays
have shape (time,); NaN is a sample that is missing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from ..errors import InputError
from ..io.quantities import printable
from ..readers.clock import parse_time_format, read_stated, rises, unwrapped
from ..readers.labels import named_unit, speaks_of
from ..readers.likely_names import LIKELY, NOT_THE_SHAFTS, QUANTITY, read_name
from ..readers.mapping import statements, unit_of
from ..record.by_resistance import quotient
from ..record.channels import CHANNEL
from ..record.motor import COEFFICIENTS_degC
from ..record.record import ColumnReading, UnitSource
from ..record.table import Column
from ..record.units import find_unit, refusal, to_canonical

SPIKES = 0.01
"""Share of the samples at either end that a course is told without: a loose contact is none."""

NUM_SAMPLES = 400
"""So many samples over the whole of a column are looked at."""

LOADED_SHARE = 0.2
"""Of the largest power [1]: below it, offsets of the transducers count."""

SAME_SHARE = 0.02
"""Two measurements of one power agree to it [1]."""

LEAST_FIT = 0.5
"""Share of the changes of a temperature that its load and its own level explain [1]."""

MOST_JUMP = 0.3
"""Of the range of a temperature [1]: what moves by more from sample to sample jumps."""

LEAST_RISE_K, COLDEST, HOTTEST = 5.0, -40.0, 300.0
"""Of a column that nothing but its course calls a temperature [K, °C]."""

MOST_OF_COPPER = 0.6
"""Spread of losses over the square of a current [1]: copper that warms by 150 K."""

FIRST = 10
"""Readings that tell the start."""

AS_COLD_K = 2.0
"""How far what is as cold as the room may read from it [K]."""


def samples_of(values: np.ndarray, num: int) -> np.ndarray:
    """Return so many samples over the whole of a column, shape (num,); NaN of an empty one."""
    if values.size == 0:
        return np.full(num, np.nan)
    return values[np.linspace(0, values.size - 1, num).astype(int)]


def _samples(values: np.ndarray) -> np.ndarray:
    return samples_of(values, min(values.size, NUM_SAMPLES))


def times_as_much(one: np.ndarray, other: np.ndarray, spread: float = 0.3) -> float | None:
    """Return how many times another a column is under load; None beyond a spread in parts of it."""
    if one.shape != other.shape:
        return None
    one, other = _samples(one), _samples(other)
    loaded = np.abs(other) > LOADED_SHARE * np.nanmax(np.abs(other), initial=0.0)
    loaded &= np.isfinite(one) & np.isfinite(other)
    if np.count_nonzero(loaded) < 3:
        return None
    low, middle, high = np.quantile(one[loaded] / other[loaded], (0.1, 0.5, 0.9))
    # the efficiency changes with the load, but by less than the load does
    return float(middle) if low > 0.0 and high - low <= spread * middle else None


def is_same(ratio: float | None) -> bool:
    """Return whether columns that are `times_as_much` measure one quantity."""
    return ratio is not None and abs(ratio - 1.0) <= SAME_SHARE


def is_square_of(losses: np.ndarray, current: np.ndarray) -> bool:
    """Return whether one load goes with the square of another, as copper losses do."""
    is_multiple = times_as_much(losses, current**2, MOST_OF_COPPER) is not None
    return is_multiple and _unsteadiness(losses) > _unsteadiness(current)


def _unsteadiness(load: np.ndarray) -> float:
    """Return the spread of a load where it is on [1]."""
    known = load[load > LOADED_SHARE * np.nanmax(load)]
    return float(np.std(known) / np.mean(known))


def jumps(values: np.ndarray) -> bool:
    """Return whether a column changes at once, as a load does."""
    known = values[np.isfinite(values)]
    return known.size > 20 and np.max(np.abs(np.diff(known))) > MOST_JUMP * np.ptp(known) > 0.0


UPWARD = 0.05
"""Of its fall [1]: by less a column rises on the way that falls throughout."""


def warms_with(temperature: np.ndarray, load: np.ndarray) -> bool:
    """Return whether a column changes as a body heated by a load does.

    The changes of a body of one node are `a·load² - b·temperature + c` with a and b above 0; a
    column that follows the load at once, or something else, is none.
    """
    if temperature.shape != load.shape or temperature.size < 20:
        return False
    level, heat = _samples(temperature), _samples(load) ** 2
    known = np.isfinite(level) & np.isfinite(heat)
    level, heat = level[known], heat[known]
    if level.size < 20 or np.ptp(level) == 0.0 or np.ptp(heat) == 0.0:
        return False
    change = np.diff(level)
    if np.max(np.abs(change)) > MOST_JUMP * np.ptp(level):
        return False
    columns = np.column_stack((heat[1:] / np.ptp(heat), level[:-1], np.ones(change.size)))
    a, b, c = np.linalg.lstsq(columns, change, rcond=None)[0]
    left = change - columns @ np.array((a, b, c))
    return bool(a > 0.0 > b and np.var(left) <= (1.0 - LEAST_FIT) * np.var(change))


def falls(temperature: np.ndarray) -> bool:
    """Return whether a column falls throughout, as a winding without load does."""
    level = temperature[np.isfinite(temperature)]
    if level.size < 20:
        return False
    means = np.array([np.median(part) for part in np.array_split(level, 20)])
    rise = float(np.max(means - np.minimum.accumulate(means)))
    return bool(means[0] - means[-1] > LEAST_RISE_K and rise < UPWARD * (means[0] - means[-1]))


def warm_resistance(volts: np.ndarray, amperes: np.ndarray) -> tuple[float, float] | None:
    """Return the least and the largest resistance of a winding [ohm], None if there is none.

    What a source holds [V] over what a drive draws [A] jumps with the load, and spreads by more
    than copper does from frost to the limit of any insulation.
    """
    if volts.shape != amperes.shape or volts.size < 20:
        return None
    current = _samples(amperes)
    ohm = quotient(_samples(volts), current)
    flows = np.isfinite(ohm)
    if np.count_nonzero(flows) < 20:
        return None
    low, high = np.quantile(ohm[flows], (SPIKES, 1.0 - SPIKES))
    jump = MOST_JUMP * (high - low)
    rise_K = (COEFFICIENTS_degC["copper"] + COLDEST) * (high / low - 1.0)
    is_copper = LEAST_RISE_K <= rise_K <= HOTTEST - COLDEST
    if not is_copper or np.nanmax(np.abs(np.diff(ohm))) > jump:
        return None
    is_cold_first = ohm[flows][0] < low + jump
    return (float(low), float(high)) if is_cold_first or warms_with(ohm, current) else None


def resistance_at_first(ohm: np.ndarray) -> float | None:
    """Return the resistance [ohm] with which a winding began that warms from then on."""
    flows = np.flatnonzero(np.isfinite(ohm))[:FIRST]
    if flows.size < FIRST or flows[-1] > flows[0] + 2 * FIRST:
        return None
    return float(np.polyfit(flows - flows[0], ohm[flows], 1)[1])


def room_at_first(channels: Mapping[str, np.ndarray]) -> float | None:
    """Return the room's temperature at the start [degC], None where another one differs from it."""
    first = {
        name: float(np.nanmedian(values[:FIRST]))
        for name, values in channels.items()
        if CHANNEL[name].quantity == "temperature" and np.isfinite(values[:FIRST]).any()
    }
    room = first.pop("ambient_degC", None)
    is_cold = room is not None and all(abs(one - room) < AS_COLD_K for one in first.values())
    return room if is_cold else None


CLOCK_FORMATS = ("hh:mm:ss:ff", "d:hh:mm:ss", "d.hh:mm:ss", "d hh:mm:ss", "hh:mm:ss",
                 "hh.mm.ss", "hh-mm-ss")  # fmt: skip
"""What a text that looks like a clock may be written in."""


def flat(text: str) -> str:
    """Return a text on one line."""
    return " ".join(text.split())


@dataclass(frozen=True)
class Proposal:
    """A channel that a column may be."""

    channel: str  # Canonical name.
    line: str  # Right-hand side of `[columns]` that reads the column so.
    unit_from: UnitSource  # How its unit is known; `"assumed"` also if the line itself states it.
    score: int  # How surely the name speaks for it, as `likely_names`; 0 for the unit alone.
    unit: str = ""  # Unit that it is read in.

    @property
    def is_likely(self) -> bool:
        """The name speaks for it, not the unit alone."""
        return self.score >= LIKELY


@dataclass(frozen=True)
class Evidence:
    """What the values of a column say of it as a channel."""

    speaks: bool  # For the channel, or against it.
    words: str  # Why.
    is_alone: bool = False  # For this channel and no other.
    # Resistance [ohm] that a winding began with and the room's temperature then [degC]; None where
    # it is no winding's voltage, or something was not as cold as the room.
    cold: tuple[float, float] | None = None


@dataclass(frozen=True)
class Course:
    """The course of one column, in the unit of the file."""

    low: float  # Value that 99 % of the samples exceed.
    high: float  # Value that 1 % of the samples exceed.
    mean: float  # Mean of the samples.
    # No sample is smaller than the one before it, and the last exceeds the first.
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
    counted = (unwrapped(values * per_s, "h")[0] for per_s in (1.0, 1e-3))  # s or ms of a day
    is_growing = any(one[-1] > one[0] and rises(one) for one in counted)
    return Course(float(low), float(high), float(np.mean(values)), is_growing)


@dataclass(frozen=True)
class FreeColumn:
    """A column that no channel claims."""

    name: str  # As it stands in the file.
    unit: str | None  # Unit text that the file gives, or None.
    low: float | None = None  # Smallest value, in the file's unit; None without any.
    high: float | None = None  # Largest value.
    num_values: int | None = None  # Number of values [1]; None where they were not looked at.
    text: str = ""  # What stands in it instead of numbers, or empty.
    proposals: tuple[Proposal, ...] = ()  # What it may be, likely ones first.
    # How its values run, in the file's unit; None where they were not looked at.
    course: Course | None = None
    remark: str = ""  # Why it is no channel although it looks like one, or empty.
    # Channel to what the other columns of the file say of it as that.
    evidence: Mapping[str, Evidence] = field(default_factory=dict)

    @property
    def is_unknown(self) -> bool:
        """Nothing but its course says what it is."""
        # "log 1", the first column of a matrix, is no share, nor is what no machine survives its
        # temperature
        is_beyond = self.course is not None and self.course.low > HOTTEST
        named = (one for one in self.proposals if not (is_beyond and one.unit == "degC"))
        is_named = any(one.score or one.unit != "1" for one in named)
        is_named |= bool(read_name(self.name).meanings & {"other_quantity", "bookkeeping"})
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
    """Look at a column, with what it holds, shape (time,), None if it was not read.

    `refused` are the reasons why columns are none, by name, as a built-in map has them.
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


def as_assumed(column: str, channel: str, unit: str) -> str:
    """Return a line of `[columns]` for a column without a unit: one that is guessed in it would
    count as stated, so that it only stands where the line would be read otherwise.
    """
    is_bare = unit == CHANNEL[channel].unit and channel != "winding_resistance_ohm"
    return column if is_bare else f"{column} [{unit}]"


def _proposals(column: Column, where: str) -> list[Proposal]:
    """Return the channels whose quantity the column's unit is of, and those its name speaks of."""
    found = []
    stated = statements(column)
    for channel in CHANNEL.values():
        unit = stated[0].text if stated else _unit_of_axis(column.label, channel.quantity)
        score = speaks_of(column.label, channel.quantity, unit).get(channel.name, 0)
        try:
            text, unit_from = unit_of(column, channel, where)
            line = column.name if text else as_assumed(column.name, channel.name, channel.unit)
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
            line = f"{column.name} [{text or channel.unit}]"
        is_counter = not stated and "other_quantity" in read_name(column.label).meanings
        if not score and (unit_from == "assumed" or is_counter):  # "amp_hours" are no hours
            continue
        unit = find_unit(text, channel.quantity) if text else None
        symbol = unit.symbol if unit else channel.unit
        found.append(Proposal(channel.name, line, unit_from, score, symbol))
    return sorted(found, key=lambda one: -one.score)


def _unit_of_axis(label: str, quantity: str) -> str | None:
    """Return the unit in the name of an axis and no more, as A in "q_A": it says of what."""
    named = named_unit(label, quantity)
    said = read_name(named.stem).meanings if named and named.stem else frozenset()
    return named.unit if named and said & {"d", "q"} and not said & QUANTITY.keys() else None


def in_its_unit(values: np.ndarray, one: Proposal | ColumnReading) -> np.ndarray:
    """Return the values of a column in the unit of its channel, shape (time,)."""
    unit = find_unit(one.unit, CHANNEL[one.channel].quantity)
    return values if unit is None else to_canonical(values, unit)
