"""What columns say of each other, before anybody has said what they are.

What is torque·omega is the power at the shaft, what is a little more is the input and no loss. What
is a voltage times a current is electrical. What warms slowly while a load stands and cools when it
falls is a winding or a body beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice, product

import numpy as np

from .channels.derive import shaft_power
from .channels.likely_names import WEAK
from .channels.schema import CHANNEL
from .channels.units import find_unit, to_canonical
from .column_course import Course
from .free_columns import Evidence, FreeColumn, Proposal
from .record import ColumnReading

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

LEAST_RISE_K, COLDEST, HOTTEST = 5.0, -40.0, 300.0
"""Of a column that nothing but its course calls a temperature [K, °C]."""

MOST_PRODUCTS, MOST_LOADS = 24, 3
"""So many are held against each column: files have thousands."""

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
    products = {
        f"'{volts}' times '{amperes}'": voltage * current
        for (volts, voltage), (amperes, current) in islice(pairs, MOST_PRODUCTS)
        if voltage.shape == current.shape
    }
    loads = [one for name in LOADS for one in by_channel.get(name, {}).items()]
    return tuple(
        _looked_at(one, values.get(one.name), known, products, loads[:MOST_LOADS]) for one in free
    )


def _converted(values: np.ndarray, channel: str, symbol: str) -> np.ndarray:
    unit = find_unit(symbol, CHANNEL[channel].quantity)
    return values if unit is None else to_canonical(values, unit)


def _looked_at(
    column: FreeColumn,
    values: np.ndarray | None,
    known: Mapping[str, np.ndarray],
    products: Mapping[str, np.ndarray],
    loads: Sequence[tuple[str, np.ndarray]],
) -> FreeColumn:
    if values is None or column.course is None:
        return column
    for one in column.proposals:
        if CHANNEL[one.channel].quantity == "power":
            power_W = _converted(values, one.channel, one.unit)
            return replace(column, evidence=power_evidence(power_W, known, products))
    is_unknown = not column.proposals and not column.unit and not column.remark
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


def _ratio(power_W: np.ndarray, other_W: np.ndarray) -> float | None:
    """Return how many times another power a power is, None where it is no multiple of it."""
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
    return float(middle) if low > 0.0 and high - low <= 0.3 * middle else None


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
    if np.max(np.abs(change)) > 0.3 * np.ptp(level):  # it jumps
        return False
    columns = np.column_stack((heat[1:] / np.ptp(heat), level[:-1], np.ones(change.size)))
    a, b, c = np.linalg.lstsq(columns, change, rcond=None)[0]
    left = change - columns @ np.array((a, b, c))
    return bool(a > 0.0 > b and np.var(left) <= (1.0 - LEAST_FIT) * np.var(change))


def _samples(values: np.ndarray) -> np.ndarray:
    if values.size <= NUM_SAMPLES:
        return values
    return values[np.linspace(0, values.size - 1, NUM_SAMPLES).astype(int)]
