"""Columns that no channel claims: how their values run, and which channels they may be.

What is torque·omega is the power at the shaft, what is a little more is the input and no loss. What
is a voltage times a current is electrical. What warms slowly while a load stands and cools when it
falls is a winding or a body beside it. What is over a current a resistance that rises as that of
copper does is the voltage of a winding.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, product

import numpy as np
import pandas as pd

from ..errors import InputError
from ..io.quantities import printable
from ..readers.clock import parse_time_format, read_stated
from ..readers.labels import named_unit, speaks_of
from ..readers.likely_names import LIKELY, NOT_THE_SHAFTS, WEAK, read_name
from ..readers.mapping import statements, unit_of
from ..record.by_resistance import quotient
from ..record.channels import CHANNEL, Channel
from ..record.derive import shaft_power
from ..record.motor import COEFFICIENTS_degC
from ..record.record import ColumnReading, UnitSource
from ..record.table import Column
from ..record.units import find_unit, refusal, to_canonical

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
    low: float | None
    high: float | None
    num_values: int | None
    text: str = ""
    proposals: tuple[Proposal, ...] = ()
    course: Course | None = None
    remark: str = ""
    evidence: Mapping[str, Evidence] = field(default_factory=dict)

    @property
    def is_silent(self) -> bool:
        """It holds zeros alone, or no value: nothing was recorded, or nothing happened."""
        is_zero = self.low == self.high == 0.0 and self.num_values != 1
        return is_zero or (self.num_values == 0 and not self.text)

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
    if values is None:
        return FreeColumn(
            column.name, unit, None, None, None, proposals=tuple(proposals), remark=reason
        )
    numbers = values[np.isfinite(values)]
    return FreeColumn(
        column.name,
        unit,
        float(numbers.min()) if numbers.size else None,
        float(numbers.max()) if numbers.size else None,
        int(numbers.size),
        proposals=() if _is_remark(values) else tuple(proposals),
        course=course_of(numbers),
        remark=reason,
    )


def text_column(name: str, text: str) -> FreeColumn:
    """Look at a column without a number: one that holds clock times in some format may be the time.

    Args:
        name: As it stands in the file.
        text: What stands in its first cell.
    """
    cell = pd.Series([text])
    lines = [
        Proposal("time_s", f"{name} [{form}]", "assumed", LIKELY)
        for form in CLOCK_FORMATS
        if (stated := parse_time_format(form)) and np.isfinite(read_stated(cell, stated).numbers[0])
    ]
    return FreeColumn(name, None, None, None, 0, text or "nothing", tuple(lines))


def _is_remark(values: np.ndarray) -> bool:
    """Return whether a column is a remark in a cell, no course."""
    return bool(np.isfinite(values).sum() == 1 < values.size)


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
        text = None
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
            # "MW" in a name is also the German mean: what is marked goes before it
            text = stated[0].text if stated else text
        if unit_from == "assumed" and not score:
            continue
        line = f"{column.name} [{text or channel.unit}]" if unit_from == "assumed" else column.name
        found.append(Proposal(channel.name, line, unit_from, score, _symbol(text, channel)))
    return sorted(found, key=lambda one: -one.score)


def _symbol(text: str | None, channel: Channel) -> str:
    unit = find_unit(text, channel.quantity) if text else None
    return unit.symbol if unit else channel.unit


SPIKES = 0.01
"""Share of the samples at either end that a course is told without: a loose contact is none."""


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

    def converted(self, factor: float, offset: float) -> Course:
        """Return the course in another unit: `factor * value + offset`.

        Args:
            factor: New units per old unit, positive.
            offset: In the new unit.
        """
        low, high, mean = (factor * value + offset for value in (self.low, self.high, self.mean))
        return Course(low, high, mean, self.is_growing)


def course_of(values: np.ndarray) -> Course | None:
    """Return the course of a column, None without a value.

    Args:
        values: Finite, in the unit of the file, shape (time,).
    """
    if values.size == 0:
        return None
    low, high = np.quantile(values, (SPIKES, 1.0 - SPIKES))
    is_growing = bool(values[-1] > values[0] and np.all(np.diff(values) >= 0.0))
    return Course(float(low), float(high), float(np.mean(values)), is_growing)


NUM_SAMPLES = 400
"""So many samples over the whole of a column are looked at."""

LOADED_SHARE = 0.2
"""Of the largest power [1]: below it, offsets of the transducers count."""

SAME_SHARE = 0.02
"""Two measurements of one power agree to it [1]."""

LEAST_EFFICIENCY = 0.4
"""Of a machine whose input a column may be [1]; below it, losses exceed the output as well."""

LEAST_FIT = 0.5
"""Share of the changes of a temperature that its load and its own level explain [1]."""

MOST_JUMP = 0.3
"""Of the range of a temperature [1]: what moves by more from sample to sample jumps."""

TURNING = ("speed_rpm", "mechanical_power_W")
"""Channels by which a shaft turns: a voltage over its current is then no resistance."""

LEAST_RISE_K, COLDEST, HOTTEST = 5.0, -40.0, 300.0
"""Of a column that nothing but its course calls a temperature [K, °C]."""

MOST_PRODUCTS, MOST_LOADS = 24, 3
"""So many are held against each column: files have thousands."""

UNEVEN = 0.05
"""Of the median step of a time [1]: nine steps of ten differ by no more."""

COLDEST_ROOM, NEAR_THE_ROOM_K, STAYING_ROOM_K = 5.0, 15.0, 1.0
"""Of a column that nothing but its course calls a room [°C], and how far from it a winding that was
not quite cold may begin [K], from a column that stays at one number as well."""

MOST_OF_COPPER = 0.6
"""Spread of losses over the square of a current [1]: copper that warms by 150 K."""

LOADS = ("phase_current_A", "losses_W", "electrical_power_W", "dc_current_A", "torque_Nm", "i_q_A")


def with_evidence(
    free: Sequence[FreeColumn],
    readings: Sequence[ColumnReading],
    values: Mapping[str, np.ndarray],
) -> tuple[FreeColumn, ...]:
    """Return columns with what the values of the file say of them.

    Args:
        free: Columns that no channel claims.
        readings: How the others are read.
        values: Name of a column to what it holds, shape (time,), where it was looked at.
    """
    read = {
        one.channel: _converted(values[one.column], one.channel, one.unit)
        for one in readings
        if one.column in values
    }
    free = [_guessed(one, values, read, free) for one in free]
    by_channel: dict[str, dict[str, np.ndarray]] = {
        one.channel: {one.column: read[one.channel]} for one in readings if one.channel in read
    }
    for column in free:
        # a name goes before a unit alone
        best = max((one.score for one in column.proposals), default=0)
        for one in column.proposals:
            if one.score == best and one.channel not in read and column.name in values:
                numbers = _converted(values[column.name], one.channel, one.unit)
                by_channel.setdefault(one.channel, {})[column.name] = numbers
    known = {name: next(iter(each.values())) for name, each in by_channel.items()
             if len(each) == 1}  # fmt: skip
    currents = [one for name in ("dc_current_A", "phase_current_A")
                for one in by_channel.get(name, {}).items()]  # fmt: skip
    pairs = product(by_channel.get("dc_voltage_V", {}).items(), dict(currents).items())
    pairs = [pair for pair in islice(pairs, MOST_PRODUCTS) if pair[0][1].shape == pair[1][1].shape]
    products = {f"'{u}' times '{i}'": volts * amperes for (u, volts), (i, amperes) in pairs}
    ohms = {f"'{u}' over '{i}'": quotient(volts, amperes) for (u, volts), (i, amperes) in pairs}
    loads = [one for name in LOADS for one in by_channel.get(name, {}).items()]
    is_turning = any(np.nan_to_num(known[name]).any() for name in TURNING if name in known)
    room_degC = _room_at_first(known)
    found = [
        _looked_at(
            _resistance(one, values.get(one.name), ohms),
            values.get(one.name),
            known,
            products,
            loads[:MOST_LOADS],
            [] if is_turning else currents[:MOST_LOADS],
            room_degC,
        )
        for one in free
    ]
    coldest = _coldest(found, values, read)
    found = [_beside_a_winding(one, *coldest) for one in found] if coldest else found
    has_phases = len(by_channel.get("phase_current_A", {})) >= 3
    return tuple(map(_of_analyser, found) if has_phases else found)


def _of_analyser(column: FreeColumn) -> FreeColumn:
    """Return a column whose plain power is no losses: beside each phase stands what goes in."""
    plain = {one.channel for one in column.proposals if not one.is_likely}
    words = "is a plain power beside the currents of three phases: the input, not the losses"
    goes_in = Evidence(True, words, is_alone=True)
    said = {"losses_W": Evidence(False, words), "electrical_power_W": goes_in}
    if column.evidence or not said.keys() <= plain:
        return column
    return replace(column, evidence=said)


def _as(column: FreeColumn, channel: str, unit: str, words: str) -> FreeColumn:
    """Return a column without name and unit as what its values make it."""
    guess = Proposal(channel, f"{column.name} [{unit}]", "assumed", WEAK, unit)
    return replace(column, proposals=(guess,), evidence={channel: Evidence(True, words)})


def _is_unknown(column: FreeColumn) -> bool:
    # "log 1", the first column of a matrix, is no share
    is_named = any(one.score or one.unit != "1" for one in column.proposals)
    return not (is_named or column.unit or column.remark) and column.course is not None


def _guessed(
    column: FreeColumn,
    values: Mapping[str, np.ndarray],
    read: Iterable[str],
    free: Iterable[FreeColumn],
) -> FreeColumn:
    """Return a column without name and unit as time or load, where it runs so and no other is.

    Time rises evenly. Of two columns that jump together one goes with the square of the other:
    losses and current.
    """
    told = {*read, *(one.channel for each in free for one in each.proposals)}
    if not _is_unknown(column) or column.name not in values:
        return column
    steps = np.diff(values[column.name])
    if steps.size > 20 and np.all(steps > 0.0):
        is_even = np.ptp(np.quantile(steps, (0.05, 0.95))) <= UNEVEN * np.median(steps)
        is_time = is_even and "time_s" not in told
        return _as(column, "time_s", "s", "rises evenly") if is_time else column
    if told.isdisjoint(LOADS) and _jumps(column, values):
        for other in free:
            if other.name != column.name and _is_unknown(other) and _jumps(other, values):
                one, two = (values[each.name] for each in (column, other))
                if _ratio(one, two**2, MOST_OF_COPPER) and _unsteadiness(one) > _unsteadiness(two):
                    return _as(column, "losses_W", "W", f"goes with the square of '{other.name}'")
                if _ratio(two, one**2, MOST_OF_COPPER) and _unsteadiness(two) > _unsteadiness(one):
                    words = f"'{other.name}' goes with its square"
                    return _as(column, "phase_current_A", "A", words)
    return column


def _jumps(column: FreeColumn, values: Mapping[str, np.ndarray]) -> bool:
    """Return whether a column changes at once, as a load does, and never to below 0."""
    if column.name not in values or column.course is None or column.course.low < 0.0:
        return False
    known = values[column.name][np.isfinite(values[column.name])]
    return known.size > 20 and np.max(np.abs(np.diff(known))) > MOST_JUMP * np.ptp(known) > 0.0


def _unsteadiness(load: np.ndarray) -> float:
    """Return the spread of a load where it is on [1]."""
    known = load[load > LOADED_SHARE * np.nanmax(load)]
    return float(np.std(known) / np.mean(known))


def _resistance(
    column: FreeColumn, values: np.ndarray | None, ohms: Mapping[str, np.ndarray]
) -> FreeColumn:
    """Return a column without unit as the resistance that a voltage over a current is."""
    if values is None or not _is_unknown(column):
        return column
    for words, ohm in ohms.items():
        for unit, factor in (("ohm", 1.0), ("mohm", 1e3)):
            ratio = _ratio(values, factor * ohm)
            if ratio is not None and abs(ratio - 1.0) <= SAME_SHARE:
                found = _as(column, "winding_resistance_ohm", unit, f"is {words}")
                return replace(found, evidence={"winding_degC": Evidence(True, f"is {words}")})
    return column


def _coldest(
    free: Iterable[FreeColumn], values: Mapping[str, np.ndarray], read: Mapping[str, np.ndarray]
) -> tuple[float, str] | None:
    """Return the least temperature of what is likely the winding [°C], and its name, if any."""
    found = [(read["winding_degC"], "the winding")] if "winding_degC" in read else []
    for column in free:
        for one in column.proposals:
            speaks = one.is_likely or "winding_degC" in column.evidence
            if one.channel == "winding_degC" and speaks and column.name in values:
                winding = _converted(values[column.name], one.channel, one.unit)
                found.append((winding, f"'{column.name}'"))
    lows = [(float(np.nanmin(each)), name) for each, name in found if np.isfinite(each).any()]
    return min(lows, default=None)


def _beside_a_winding(column: FreeColumn, coldest: float, winding: str) -> FreeColumn:
    """Return a column as the room, where it stays within some kelvin and is no warmer than the
    winding ever was; what is warmer is none, unless its name says so.
    """
    course = column.course
    if course is None:
        return column
    if _is_unknown(column) and course.high - course.low < LEAST_RISE_K:
        near_K = NEAR_THE_ROOM_K if course.high > course.low else STAYING_ROOM_K
        is_room = course.low >= COLDEST_ROOM and abs(course.mean - coldest) < near_K
        words = f"stays near the coldest of {winding}"
        return _as(column, "ambient_degC", "degC", words) if is_room else column
    for one in column.proposals:
        unit = find_unit(one.unit, "temperature") if one.channel == "ambient_degC" else None
        low = None if unit is None else unit.factor * course.low + unit.offset
        is_other = f"'{column.name}'" != winding and not one.is_likely
        if low is not None and is_other and low > coldest + LEAST_RISE_K:
            words = f"{low - coldest:.0f} K warmer than {winding} at its coldest"
            return replace(
                column, evidence={**column.evidence, one.channel: Evidence(False, words)}
            )
    return column


def _converted(values: np.ndarray, channel: str, symbol: str) -> np.ndarray:
    unit = find_unit(symbol, CHANNEL[channel].quantity)
    return values if unit is None else to_canonical(values, unit)


def _looked_at(
    column: FreeColumn,
    values: np.ndarray | None,
    known: Mapping[str, np.ndarray],
    products: Mapping[str, np.ndarray],
    loads: Sequence[tuple[str, np.ndarray]],
    currents: Sequence[tuple[str, np.ndarray]],
    room_degC: float | None,
) -> FreeColumn:
    if values is None or column.course is None:
        return column
    for one in column.proposals:
        if CHANNEL[one.channel].quantity == "power":
            power_W = _converted(values, one.channel, one.unit)
            found = power_evidence(power_W, known, products)
            return replace(column, evidence={**column.evidence, **found})
        if one.channel == "winding_voltage_V":
            volts = _converted(values, one.channel, one.unit)
            return replace(column, evidence=_voltage_evidence(volts, currents, room_degC))
    is_unknown = _is_unknown(column)
    may_warm = is_unknown and _may_be_a_temperature(column.course)
    if not may_warm and not any(one.channel == "winding_degC" for one in column.proposals):
        return column
    for name, load in loads:
        if name != column.name and warms_with(values, load):
            proposals = column.proposals
            if is_unknown:
                line = f"{column.name} [degC]"
                proposals = (Proposal("winding_degC", line, "assumed", WEAK, "degC"),)
            warms = Evidence(True, f"warms with '{name}' and cools when it falls")
            return replace(column, proposals=proposals, evidence={"winding_degC": warms})
    return column


FIRST = 10
"""Readings that tell the start."""

AS_COLD_K = 2.0
"""How far what is as cold as the room may read from it [K]."""


def _room_at_first(known: Mapping[str, np.ndarray]) -> float | None:
    """Return the room's temperature at the start [degC], None where another one differs from it.

    Args:
        known: Channels and what they hold, in their units, shape (time,).
    """
    first = {
        name: float(np.nanmedian(values[:FIRST]))
        for name, values in known.items()
        if CHANNEL[name].quantity == "temperature" and np.isfinite(values[:FIRST]).any()
    }
    room = first.pop("ambient_degC", None)
    is_cold = room is not None and all(abs(one - room) < AS_COLD_K for one in first.values())
    return room if is_cold else None


def _at_first(ohm: np.ndarray) -> float | None:
    """Return the resistance [ohm] with which a winding began that warms from then on."""
    flows = np.flatnonzero(np.isfinite(ohm))[:FIRST]
    if flows.size < FIRST or flows[-1] > flows[0] + 2 * FIRST:
        return None
    return float(np.polyfit(flows - flows[0], ohm[flows], 1)[1])


def _voltage_evidence(
    volts: np.ndarray, currents: Sequence[tuple[str, np.ndarray]], room_degC: float | None
) -> dict[str, Evidence]:
    """Return what a voltage [V] says of itself as that of a winding under direct current."""
    for name, amperes in currents:
        ohm = warm_resistance(volts, amperes)
        if ohm is not None:
            words = f"over '{name}' it is {ohm[0]:.4g} … {ohm[1]:.4g} ohm, as copper that warms"
            first = _at_first(quotient(volts, amperes))
            cold = None if room_degC is None or first is None else (first, room_degC)
            return {"winding_voltage_V": Evidence(True, words, is_alone=True, cold=cold)}
    return {"winding_voltage_V": Evidence(False, "over no current a resistance that warms")}


def warm_resistance(volts: np.ndarray, amperes: np.ndarray) -> tuple[float, float] | None:
    """Return the least and the largest resistance of a winding [ohm], None if there is none.

    What a source holds over what a drive draws jumps with the load, and spreads by more than copper
    does from frost to the limit of any insulation.

    Args:
        volts: Voltage [V], shape (time,).
        amperes: Current [A], shape (time,).
    """
    if volts.shape != amperes.shape or volts.size < 20:
        return None
    current = _samples(amperes)
    ohm = quotient(_samples(volts), current)
    flows = np.isfinite(ohm)
    if np.count_nonzero(flows) < 20:
        return None
    low, high = np.quantile(ohm[flows], (SPIKES, 1.0 - SPIKES))
    rise_K = (COEFFICIENTS_degC["copper"] + COLDEST) * (high / low - 1.0)
    change = np.abs(np.diff(ohm))
    if not LEAST_RISE_K <= rise_K <= HOTTEST - COLDEST or np.nanmax(change) > MOST_JUMP * (
        high - low
    ):
        return None
    is_cold_first = ohm[flows][0] < low + MOST_JUMP * (high - low)
    return (float(low), float(high)) if is_cold_first or warms_with(ohm, current) else None


def of_a_winding(
    volts: FreeColumn,
    current: FreeColumn,
    values: Mapping[str, np.ndarray],
    readings: Sequence[ColumnReading],
) -> tuple[FreeColumn, FreeColumn] | None:
    """Return voltage and direct current of a winding as such, None where they are none.

    What is called the DC link's is a winding's where the one over the other is copper that warms.

    Args:
        volts: Column of the voltage.
        current: Column of the current.
        values: Name of a column to what it holds, shape (time,), where it was looked at.
        readings: How the other columns are read.
    """
    found = []
    for column, channel in ((volts, "winding_voltage_V"), (current, "phase_current_A")):
        as_read = next((one for one in column.proposals if one.channel == channel), None)
        if as_read is None or column.name not in values:
            return None
        found.append((as_read, _converted(values[column.name], channel, as_read.unit)))
    (u, held_V), (i, amperes) = found
    known = {each.channel: _converted(values[each.column], each.channel, each.unit)
             for each in readings if each.column in values}  # fmt: skip
    said = _voltage_evidence(held_V, [(current.name, amperes)], _room_at_first(known))
    if not said["winding_voltage_V"].speaks:
        return None
    under = Evidence(True, f"under '{volts.name}' it flows through copper that warms", True)
    return (
        replace(volts, proposals=(u,), evidence=said),
        replace(current, proposals=(i,), evidence={"phase_current_A": under}),
    )


def _may_be_a_temperature(course: Course) -> bool:
    is_inside = COLDEST <= course.low <= course.high <= HOTTEST
    return is_inside and course.high - course.low >= LEAST_RISE_K and not course.is_growing


def power_evidence(
    power_W: np.ndarray, channels: Mapping[str, np.ndarray], products: Mapping[str, np.ndarray]
) -> dict[str, Evidence]:
    """Return what a power says of itself by the channel that it may be.

    Args:
        power_W: The column [W], shape (time,).
        channels: With `torque_Nm` and `speed_rpm` where they are known, shape (time,) each.
        products: Voltage times current of the file [W] by the names of both, shape (time,) each.
    """
    found: dict[str, Evidence] = {}
    if {"torque_Nm", "speed_rpm"} <= channels.keys():
        ratio = _ratio(power_W, shaft_power(channels))
        if ratio is not None and abs(ratio - 1.0) <= SAME_SHARE:
            return {
                "mechanical_power_W": Evidence(True, "is torque·omega", is_alone=True),
                "losses_W": Evidence(False, "is torque·omega, the power at the shaft"),
                "electrical_power_W": Evidence(False, "is torque·omega, the power at the shaft"),
            }
        if ratio is not None and 1.0 < ratio <= 1.0 / LEAST_EFFICIENCY:
            words = f"is {ratio:.3g} times torque·omega: the input, not the losses"
            found["electrical_power_W"] = Evidence(True, words, is_alone=True)
            found["losses_W"] = found["mechanical_power_W"] = Evidence(False, words)
    for names, voltage_times_current in products.items():
        ratio = _ratio(power_W, voltage_times_current)
        if ratio is not None and abs(ratio - 1.0) <= SAME_SHARE:
            found.setdefault("electrical_power_W", Evidence(True, f"is {names}", is_alone=True))
    return found


def _ratio(power_W: np.ndarray, other_W: np.ndarray, spread: float = 0.3) -> float | None:
    """Return how many times another power a power is, None where it is no multiple of it, to a
    spread in parts of that.
    """
    if power_W.shape != other_W.shape:
        return None
    power, other = _samples(power_W), _samples(other_W)
    loaded = np.abs(other) > LOADED_SHARE * np.nanmax(np.abs(other), initial=0.0)
    loaded &= np.isfinite(power) & np.isfinite(other)
    if np.count_nonzero(loaded) < 3:
        return None
    ratios = power[loaded] / other[loaded]
    low, middle, high = np.quantile(ratios, (0.1, 0.5, 0.9))
    # the efficiency changes with the load, but by less than the load does
    return float(middle) if low > 0.0 and high - low <= spread * middle else None


def warms_with(temperature: np.ndarray, load: np.ndarray) -> bool:
    """Return whether a column changes as a body heated by a load does.

    The changes of a body of one node are `a·load² - b·temperature + c` with a and b above 0; a
    column that follows the load at once, or something else, is none.

    Args:
        temperature: The column, in any unit, shape (time,).
        load: Current, power or torque, shape (time,).
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


def _samples(values: np.ndarray) -> np.ndarray:
    if values.size <= NUM_SAMPLES:
        return values
    return values[np.linspace(0, values.size - 1, NUM_SAMPLES).astype(int)]
