"""Heat that no machine of any bench has: a unit, not a machine."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..io.quantities import rounded
from ..record.balance_errors import BLOCK_S
from ..record.motor import Motor
from ..record.record import ColumnReading, Finding, Record
from ..record.samples import block_means, place, samples, sink_channel
from ..record.units import require_unit
from .figures import MIN_RISE_K, is_brief, one_mass

LARGEST_W, SMALLEST_W = 2e6, 1e-3
"""Losses of a generator of 100 MW, overloaded, and of a watch."""

LARGEST_W_PER_K = 5e4
"""Losses over temperature rise [W/K]: 20 µK/W; a machine of 1 MW with water jacket has some
thousands."""

OTHER_UNITS = {"W": ("kW", "mW"), "kW": ("W", "MW"), "MW": ("kW", "W"), "mW": ("W",)}
"""By the unit that losses were read in, those that they may be in."""


def losses_absurd(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report losses beyond those of any machine on a bench, with the unit that would explain them.

    An error; a warning where the motor file decides the unit, so that a giant can be measured too.
    """
    time_s, losses, winding, sink = samples(
        record, "losses_W", "winding_degC", sink_channel(motor)
    )  # fmt: skip
    if time_s.size == 0:
        return
    time_s, losses, rise = block_means(time_s, BLOCK_S, losses, winding - sink)
    largest = float(np.max(np.abs(losses)))
    top = int(np.argmax(rise))
    # the highest rise comes late in a load: then the heat flows out, unless the test is so short
    # that it is stored
    is_warm = rise[top] > MIN_RISE_K
    per_K = float(np.mean(np.abs(losses))) / float(rise[top]) if is_warm else 0.0
    is_small = 0.0 < largest < SMALLEST_W and rise[top] > 1.0
    if not (is_small or largest > LARGEST_W or per_K > LARGEST_W_PER_K):
        return
    seen = one_mass(record, motor)
    if seen is not None and seen.conductance_W_per_K < per_K:  # no comparison is true of a NaN
        per_K = seen.conductance_W_per_K
    if is_brief(float(time_s[-1] - time_s[0]) + BLOCK_S, per_K, motor.sink):
        per_K = 0.0  # what has warmed is a winding, and the heat is in it
    is_large = largest > LARGEST_W or per_K > LARGEST_W_PER_K
    if not is_large and not is_small:
        return
    reading = next((one for one in record.mapping if one.channel == "losses_W"), None)
    shown = (
        f"{rounded(largest)} W, {rounded(per_K)} W for each kelvin of rise"
        if per_K
        else f"{rounded(largest)} W"
    )
    yield Finding(
        "losses_absurd",
        "warning" if "losses_W" in record.decided else "error",
        f"Expected losses between {SMALLEST_W:g} W and {LARGEST_W / 1e6:g} MW, and at most "
        f"{LARGEST_W_PER_K:g} W/K; the largest are {shown}.{_explained(reading, largest)}",
        place(record, "losses_W", float(time_s[0]), float(time_s[-1])),
        _remedy(reading, is_large),
        values={"largest_W": largest, "largest_W_per_K": per_K},
    )


def _explained(reading: ColumnReading | None, largest_W: float) -> str:
    """Return what the losses would be in other units than the one that they were read in."""
    if reading is None or reading.unit not in OTHER_UNITS:
        return ""
    shown = [
        f"{rounded(largest_W * _factor(unit) / _factor(reading.unit))} W if in {unit}"
        for unit in OTHER_UNITS[reading.unit]
    ]
    return f" Column '{reading.column}' is read as {reading.unit}; it would be {', '.join(shown)}."


def _remedy(reading: ColumnReading | None, is_large: bool) -> str:
    if reading is None:
        return "Check the units of the powers that the losses follow from, and their signs."
    # the heading whole: its own unit alone would repeat what is in doubt
    line = f'losses_W = "{reading.column} '
    if reading.unit not in OTHER_UNITS:
        return f'State the unit in [columns]: {line}[UNIT]".'
    units = sorted(OTHER_UNITS[reading.unit], key=_factor)
    likely = units[0] if is_large else units[-1]
    return (
        f'State the unit in [columns]: {line}[{likely}]". If {reading.unit} is right, write '
        f'{line}[{reading.unit}]": then this is only a warning.'
    )


def _factor(symbol: str) -> float:
    """Return the watts of a unit of power."""
    return require_unit(symbol, "power", where="").factor
