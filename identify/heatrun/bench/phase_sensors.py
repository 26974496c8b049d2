"""Sensors of the three phases, told by their names and by their values.

The names are alike but for one sign, U, V and W, or 1, 2 and 3. T_U, T_V and T_W may also be room,
inlet and winding, and T1 to T3 anything, so the values decide: sensors of one winding stay within
a few kelvin of each other while they warm by much more, and currents of a balanced machine within
a tenth of their value.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .channels.combined import APART_K, APART_SHARE

PHASES = ("UVW", "uvw", "123", "ABC", "abc")
SIGN = re.compile(f"[{''.join(first[0] for first in PHASES)}]")

NUM_SAMPLES = 400
"""So many samples of a column are compared."""

LEAST_RISE_K = 10.0
"""Below it, sensors anywhere in a machine read the same [K]."""

CLOSE_SHARE = 0.1
"""Sensors whose names say nothing agree to this share of their rise, currents of theirs [1]."""


@dataclass(frozen=True)
class Sensor:
    """A column that may be the sensor of one phase.

    Attributes:
        label: Its name without the unit.
        values: In the channel's unit, shape (time,).
        is_named: The name speaks for the channel.
    """

    label: str
    values: np.ndarray
    is_named: bool


def phases(sensors: Mapping[str, Sensor], quantity: str) -> Iterator[tuple[str, str, str]]:
    """Yield the names of three columns that read one winding, in the order of the phases.

    Args:
        sensors: By the name of the column.
        quantity: `"temperature"` or `"phase current"`.
    """
    by_label = {sensor.label: name for name, sensor in sensors.items()}
    for label in by_label:
        for sign in SIGN.finditer(label):
            place = sign.start()
            letters = next(letters for letters in PHASES if letters[0] == sign[0])
            alike = [f"{label[:place]}{letter}{label[place + 1 :]}" for letter in letters]
            if not all(one in by_label for one in alike):
                continue
            first, second, third = (by_label[one] for one in alike)
            if _is_one_winding([sensors[name] for name in (first, second, third)], quantity):
                yield first, second, third


def _is_one_winding(three: Sequence[Sensor], quantity: str) -> bool:
    stacked = np.stack([_samples(sensor.values) for sensor in three])
    stacked = stacked[:, np.all(np.isfinite(stacked), axis=0)]
    if stacked.shape[1] < 2:
        return False
    middle = np.median(stacked, axis=0)
    apart = float(np.max(np.quantile(np.abs(stacked - middle), 0.95, axis=1)))
    low, high = np.quantile(middle, (0.01, 0.99))
    if quantity == "phase current":
        return high > 0.0 and apart <= CLOSE_SHARE * high
    rise = float(high - low)
    if all(sensor.is_named for sensor in three):
        return apart <= max(APART_K, APART_SHARE * rise)
    return rise >= LEAST_RISE_K and apart <= min(APART_K, CLOSE_SHARE * rise)


def _samples(values: np.ndarray) -> np.ndarray:
    """Return samples over the whole of a column, whatever its rate, shape (NUM_SAMPLES,)."""
    if values.size == 0:
        return np.full(NUM_SAMPLES, np.nan)
    return values[np.linspace(0, values.size - 1, NUM_SAMPLES).astype(int)]
