"""How the courses of columns go together: powers, a body that warms, copper that warms.

All arrays have shape (time,); NaN is a sample that is missing.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..record.by_resistance import quotient
from ..record.channels import CHANNEL
from ..record.motor import COEFFICIENTS_degC

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


def _samples(values: np.ndarray) -> np.ndarray:
    if values.size <= NUM_SAMPLES:
        return values
    return values[np.linspace(0, values.size - 1, NUM_SAMPLES).astype(int)]


def times_as_much(one: np.ndarray, other: np.ndarray, spread: float = 0.3) -> float | None:
    """Return how many times another column a column is under load, None where it is no multiple of
    it, to a spread in parts of that.
    """
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
