"""What the columns of a file say of each other: which channels their values speak for or against.

What is torque·omega is the power at the shaft, what is a little more is the input and no loss. What
is a voltage times a current is electrical. What warms slowly while a load stands and cools when it
falls is a winding or a body beside it. What is over a current a resistance that rises as that of
copper does is the voltage of a winding.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np

from ..readers.likely_names import WEAK
from ..record.by_resistance import quotient
from ..record.channels import CHANNEL
from ..record.derive import shaft_power
from ..record.record import ColumnReading
from .free_columns import (
    LEAST_RISE_K,
    Evidence,
    FreeColumn,
    Proposal,
    as_assumed,
    in_its_unit,
    is_same,
    is_square_of,
    jumps,
    resistance_at_first,
    room_at_first,
    times_as_much,
    warm_resistance,
    warms_with,
)

LEAST_EFFICIENCY = 0.4
"""Of a machine whose input a column may be [1]; below it, losses exceed the output as well."""

TURNING = ("speed_rpm", "mechanical_power_W")
"""Channels by which a shaft turns: a voltage over its current is then no resistance."""

MOST_PRODUCTS, MOST_LOADS = 24, 3
"""So many are held against each column: files have thousands."""

COLDEST_ROOM, NEAR_THE_ROOM_K, STAYING_ROOM_K = 5.0, 15.0, 1.0
"""Of a column that nothing but its course calls a room [°C], and how far from it a winding that was
not quite cold may begin [K], from a column that stays at one number as well."""

UNEVEN = 0.05
"""Of the median step of a time [1]: nine steps of ten differ by no more."""

NUMBERS_THE_LINES = 'it numbers the lines: with one each second, time_s = "rate 1 Hz"'
"""Why a column that counts by ones from the first line on is no time."""

LOADS = ("phase_current_A", "losses_W", "electrical_power_W", "dc_current_A", "torque_Nm", "i_q_A")

BY_NAME = "canonical name"
"""How a column is found that is called `losses_W` itself: whoever writes that means it."""

Values = Mapping[str, np.ndarray]
"""What columns or channels hold, shape (time,) each, by their names."""


@dataclass(frozen=True)
class _Others:
    """What a column is held against, in the units of channels."""

    channels: Values  # What one column alone is, or may be.
    products: Values  # Voltage times current [W], by the names of both.
    ohms: Values  # Voltage over current [ohm], by the names of both.
    loads: Sequence[tuple[str, np.ndarray]]  # What may heat, by its column.
    # What may be a winding's current [A], by its column; none where a shaft turns.
    currents: Sequence[tuple[str, np.ndarray]]


def with_evidence(
    free: Sequence[FreeColumn], readings: Sequence[ColumnReading], values: Values
) -> tuple[FreeColumn, ...]:
    """Return columns that no channel claims with what the values of the file say of them.

    The others are read as `readings`; `values` is what columns hold, where it was looked at.
    """
    read = _read(readings, values)
    free = [_guessed(one, values, read, free) for one in free]
    by_channel = {one.channel: {one.column: read[one.channel]} for one in readings
                  if one.channel in read}  # fmt: skip
    for column in (one for one in free if one.name in values):
        for one in column.proposals:
            # a name goes before a unit alone
            if one.score == column.proposals[0].score and one.channel not in read:
                numbers = in_its_unit(values[column.name], one)
                by_channel.setdefault(one.channel, {})[column.name] = numbers
    others = _others(by_channel)
    found = [_looked_at(one, values[one.name], others) if one.name in values else one
             for one in free]  # fmt: skip
    coldest = _coldest(found, values, read)
    found = [_beside_a_winding(one, *coldest) for one in found] if coldest else found
    has_phases = len(by_channel.get("phase_current_A", {})) >= 3
    return tuple(map(_of_analyser, found) if has_phases else found)


def _read(readings: Iterable[ColumnReading], values: Values) -> dict[str, np.ndarray]:
    """Return the channels that are read, in their units."""
    return {one.channel: in_its_unit(values[one.column], one) for one in readings
            if one.column in values}  # fmt: skip


def _others(by_channel: Mapping[str, Values]) -> _Others:
    """Return what columns are held against, by the columns that may be each channel."""
    channels = {name: next(iter(each.values())) for name, each in by_channel.items()
                if len(each) == 1}  # fmt: skip
    currents, loads = (
        [pair for name in names for pair in by_channel.get(name, {}).items()]
        for names in (("dc_current_A", "phase_current_A"), LOADS)
    )
    pairs = product(by_channel.get("dc_voltage_V", {}).items(), dict(currents).items())
    pairs = [pair for pair in islice(pairs, MOST_PRODUCTS) if pair[0][1].shape == pair[1][1].shape]
    is_turning = any(np.nan_to_num(channels[name]).any() for name in TURNING if name in channels)
    return _Others(
        channels,
        {f"'{u}' times '{i}'": volts * amperes for (u, volts), (i, amperes) in pairs},
        {f"'{u}' over '{i}'": quotient(volts, amperes) for (u, volts), (i, amperes) in pairs},
        loads[:MOST_LOADS],
        [] if is_turning else currents[:MOST_LOADS],
    )


def _guessed(
    column: FreeColumn, values: Values, read: Iterable[str], free: Iterable[FreeColumn]
) -> FreeColumn:
    """Return a column without name and unit as time or load, where it runs so and no other is.

    Time rises evenly. Of two columns that jump together one goes with the square of the other:
    losses and current.
    """
    if not column.is_unknown or column.name not in values:
        return column
    told = {*read, *(one.channel for each in free for one in each.proposals)}
    own = values[column.name]
    steps = np.diff(own)
    if steps.size > 20 and np.all(steps > 0.0):
        is_even = np.ptp(np.quantile(steps, (0.05, 0.95))) <= UNEVEN * np.median(steps)
        if not is_even or "time_s" in told:
            return column
        if own[0] in (0.0, 1.0) and np.all(steps == 1.0):
            return replace(column, remark=NUMBERS_THE_LINES)
        return _as(column, "time_s", "s", "rises evenly")
    if not told.isdisjoint(LOADS) or not _is_load(column, values):
        return column
    for other in free:
        if other.name != column.name and other.is_unknown and _is_load(other, values):
            if is_square_of(own, values[other.name]):
                return _as(column, "losses_W", "W", f"goes with the square of '{other.name}'")
            if is_square_of(values[other.name], own):
                return _as(column, "phase_current_A", "A", f"'{other.name}' goes with its square")
    return column


def _as(column: FreeColumn, channel: str, unit: str, words: str, judged: str = "") -> FreeColumn:
    """Return a column without name and unit as the channel that its values make it.

    The words speak for that channel, or for the one that is judged by it.
    """
    guess = Proposal(channel, as_assumed(column.name, channel, unit), "assumed", WEAK, unit)
    return replace(column, proposals=(guess,), evidence={judged or channel: Evidence(True, words)})


def _is_load(column: FreeColumn, values: Values) -> bool:
    """Return whether a column changes at once, and never to below 0."""
    is_positive = column.course is not None and column.course.low >= 0.0
    return column.name in values and is_positive and jumps(values[column.name])


def _looked_at(column: FreeColumn, values: np.ndarray, others: _Others) -> FreeColumn:
    """Return a column with what its values, shape (time,), say of it beside the others."""
    course, is_unknown = column.course, column.is_unknown
    if course is None:
        return column
    for words, ohm in others.ohms.items() if is_unknown else ():
        for unit, factor in (("ohm", 1.0), ("mohm", 1e3)):
            if is_same(times_as_much(values, factor * ohm)):
                words = f"is {words}"
                return _as(column, "winding_resistance_ohm", unit, words, "winding_degC")
    for one in column.proposals:
        numbers = in_its_unit(values, one)
        if CHANNEL[one.channel].quantity == "power":
            found = _power_evidence(numbers, others.channels, others.products)
            return replace(column, evidence={**column.evidence, **found})
        if one.channel == "winding_voltage_V":
            found = _voltage_evidence(numbers, others.currents, room_at_first(others.channels))
            return replace(column, evidence=found)
    may_warm = course.may_be_a_temperature if is_unknown else column.read_as("winding_degC")
    for name, load in others.loads if may_warm else ():
        if name != column.name and warms_with(values, load):
            words = f"warms with '{name}' and cools when it falls"
            if is_unknown:
                return _as(column, "winding_degC", "degC", words)
            return replace(column, evidence={"winding_degC": Evidence(True, words)})
    return column


def _power_evidence(power_W: np.ndarray, channels: Values, products: Values) -> dict[str, Evidence]:
    """Return what a power says of itself by the channel that it may be."""
    found: dict[str, Evidence] = {}
    if {"torque_Nm", "speed_rpm"} <= channels.keys():
        ratio = times_as_much(power_W, shaft_power(channels))
        if is_same(ratio):
            found["mechanical_power_W"] = Evidence(True, "is torque·omega", is_alone=True)
            no_other = Evidence(False, "is torque·omega, the power at the shaft")
            return found | dict.fromkeys(("losses_W", "electrical_power_W"), no_other)
        if ratio is not None and 1.0 < ratio <= 1.0 / LEAST_EFFICIENCY:
            words = f"is {ratio:.3g} times torque·omega: the input, not the losses"
            found["electrical_power_W"] = Evidence(True, words, is_alone=True)
            found["losses_W"] = found["mechanical_power_W"] = Evidence(False, words)
    for names, voltage_times_current in products.items():
        if is_same(times_as_much(power_W, voltage_times_current)):
            found.setdefault("electrical_power_W", Evidence(True, f"is {names}", is_alone=True))
    return found


def _voltage_evidence(
    volts: np.ndarray, currents: Iterable[tuple[str, np.ndarray]], room_degC: float | None
) -> dict[str, Evidence]:
    """Return what a voltage [V] says of itself as that of a winding under direct current."""
    for name, amperes in currents:
        ohm = warm_resistance(volts, amperes)
        if ohm is not None:
            words = f"over '{name}' it is {ohm[0]:.4g} … {ohm[1]:.4g} ohm, as copper that warms"
            first = resistance_at_first(quotient(volts, amperes))
            cold = None if room_degC is None or first is None else (first, room_degC)
            return {"winding_voltage_V": Evidence(True, words, is_alone=True, cold=cold)}
    return {"winding_voltage_V": Evidence(False, "over no current a resistance that warms")}


def _coldest(free: Iterable[FreeColumn], values: Values, read: Values) -> tuple[float, str] | None:
    """Return the least temperature of what is likely the winding [°C], and its name, if any."""
    found = [(read["winding_degC"], "the winding")] if "winding_degC" in read else []
    for column in free:
        for one in column.proposals:
            speaks = one.is_likely or "winding_degC" in column.evidence
            if one.channel == "winding_degC" and speaks and column.name in values:
                found.append((in_its_unit(values[column.name], one), f"'{column.name}'"))
    lows = [(float(np.nanmin(each)), name) for each, name in found if np.isfinite(each).any()]
    return min(lows, default=None)


def _beside_a_winding(column: FreeColumn, coldest: float, winding: str) -> FreeColumn:
    """Return a column as the room, where it stays within some kelvin and is no warmer than the
    winding ever was; what is warmer is none, unless its name says so.
    """
    course = column.course
    if course is None:
        return column
    if column.is_unknown and course.high - course.low < LEAST_RISE_K:
        near_K = NEAR_THE_ROOM_K if course.high > course.low else STAYING_ROOM_K
        is_room = course.low >= COLDEST_ROOM and abs(course.mean - coldest) < near_K
        words = f"stays near the coldest of {winding}"
        return _as(column, "ambient_degC", "degC", words) if is_room else column
    one = column.read_as("ambient_degC")
    low = course.low if one is None else course.read_as(one).low
    is_other = f"'{column.name}'" != winding and one is not None and not one.is_likely
    if not is_other or low <= coldest + LEAST_RISE_K:
        return column
    said = Evidence(False, f"{low - coldest:.0f} K warmer than {winding} at its coldest")
    return replace(column, evidence={**column.evidence, "ambient_degC": said})


MACHINE = re.compile(r"(?<![^\W_])[^\W_]*?[1A](?![^\W_])")
"""The word by which a column is of the first machine of several: M1, EM1, A."""


def of_one_machine(free: Sequence[FreeColumn]) -> tuple[tuple[FreeColumn, ...], str]:
    """Return columns with what speaks against those of a second machine, and a sentence on it.

    Two machines are in a file that has both a temperature and a load of each, under names that
    differ in one word. Where a third is alike they are phases.
    """
    by_name = {column.name: column for column in free}
    pairs: dict[tuple[str, str], dict[str, str]] = {}
    for name in by_name:
        for found in MACHINE.finditer(name):
            first = found[0] if len(found[0]) > 1 else name[: found.end()]
            signs = "23" if first[-1] == "1" else "BC"
            other, third = (
                f"{name[: found.end() - 1]}{sign}{name[found.end() :]}" for sign in signs
            )
            if other in by_name and third not in by_name:
                pairs.setdefault((first, first[:-1] + signs[0]), {})[name] = other
    for (first, second), names in pairs.items():
        quantities = {CHANNEL[one.channel].quantity for name in names
                      for one in by_name[name].proposals}  # fmt: skip
        if "temperature" not in quantities or quantities.isdisjoint(("phase current", "power")):
            continue
        against = Evidence(False, f"is of another machine than '{first}'")
        others = {*names.values()}
        said = (
            f"Columns of two machines, '{first}' and '{second}': those of '{first}' are proposed; "
            "the other one takes a motor file of its own."
        )
        return tuple(
            replace(one, evidence=dict.fromkeys((p.channel for p in one.proposals), against))
            if one.name in others
            else one
            for one in free
        ), said
    return tuple(free), ""


def _of_analyser(column: FreeColumn) -> FreeColumn:
    """Return a column whose plain power is no losses: beside each phase stands what goes in."""
    plain = {one.channel for one in column.proposals if not one.is_likely}
    words = "is a plain power beside the currents of three phases: the input, not the losses"
    goes_in = Evidence(True, words, is_alone=True)
    said = {"losses_W": Evidence(False, words), "electrical_power_W": goes_in}
    is_plain = len(plain) == len(column.proposals) and said.keys() <= plain and not column.evidence
    return replace(column, evidence=said) if is_plain else column


def without_misnamed(
    free: Sequence[FreeColumn],
    readings: Sequence[ColumnReading],
    values: Values,
    look: Callable[[ColumnReading], FreeColumn],
) -> tuple[Sequence[ColumnReading], tuple[FreeColumn, ...]]:
    """Return the readings that hold, and all other columns with the evidence on them.

    Columns of `MISNAMED` channels are judged as if no channel claimed them, and go to those that
    none does where their values say so. Arguments as `with_evidence`; `look` returns a column that
    is read as one that no channel claims.
    """
    judged: tuple[FreeColumn, ...] = ()
    for channels, unless, as_judged in MISNAMED:
        named = [one for name in channels for one in readings if one.channel == name]
        others = [one for one in readings if one not in named]
        is_meant = any(one.found_by == BY_NAME for one in named)
        if is_meant or len(named) < len(channels) or any(one.channel in unless for one in others):
            continue
        seen = (*free, *map(look, named))
        every = with_evidence(seen, others, values)
        rest, doubted = every[: len(free)], every[len(free) :]
        found = as_judged(doubted, rest, values, _read(others, values))
        if found:
            readings, free, judged = others, seen, (*rest, *found)
    return readings, judged or with_evidence(free, readings, values)


Judged = Sequence[FreeColumn]


def _no_losses(losses: Judged, rest: Judged, values: Values, read: Values) -> Judged:
    """Return a column of losses where another power shows that it is the input, or the output."""
    return [one for one in losses if "losses_W" in one.evidence]


def _of_a_winding(link: Judged, rest: Judged, values: Values, read: Values) -> Judged:
    """Return voltage and current of a DC link as a winding's, where the one over the other is
    copper that warms and nothing else warms with a load.
    """
    volts, current = link
    u, i = volts.read_as("winding_voltage_V"), current.read_as("phase_current_A")
    is_known = {volts.name, current.name} <= values.keys()
    if not (u and i and is_known) or any("winding_degC" in one.evidence for one in rest):
        return ()
    flowing = (current.name, in_its_unit(values[current.name], i))
    said = _voltage_evidence(in_its_unit(values[volts.name], u), [flowing], room_at_first(read))
    if not said["winding_voltage_V"].speaks:
        return ()
    under = Evidence(True, f"under '{volts.name}' it flows through copper that warms", True)
    return (
        replace(volts, proposals=(u,), evidence=said),
        replace(current, proposals=(i,), evidence={"phase_current_A": under}),
    )


MISNAMED = (
    (("losses_W",), (), _no_losses),
    (("dc_voltage_V", "dc_current_A"), (*TURNING, "phase_current_A"), _of_a_winding),
)
"""Channels as which columns are recognised together, beside which others they are that for sure,
and what returns the columns as what their values say."""
