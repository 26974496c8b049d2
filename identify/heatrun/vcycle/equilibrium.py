"""Has the machine reached thermal equilibrium at the end of a test?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bench.checks.samples import samples, sink_channel
from ..bench.record import Record
from ..motor import Motor

INTERVAL_S = 1800.0
"""Length of each of the two last intervals [s]; ours, where the standard says "reasonable"."""

LARGEST_GRADIENT_K_PER_H = 2.0
"""IEC 60034-1, edition 12 (2010), definition of thermal equilibrium [K/h]."""

MIN_SAMPLES = 10
"""Readings in an interval below which its gradient is not told [1]."""

CRITERION = (
    "Reached where the rise of a part over the sink has a gradient of at most 2 K per hour over "
    "each of the last two half hours. The gradient is that of the definition of thermal "
    "equilibrium in IEC 60034-1, edition 12 (2010); half an hour as the length of the interval, "
    "and a line of least squares through all its readings instead of through its ends, are ours."
)
"""The criterion, in words of the report."""


@dataclass(frozen=True)
class Equilibrium:
    """Whether one part of the machine has settled.

    Attributes:
        channel: The temperature.
        is_reached: None where the record does not allow a statement.
        gradients_K_per_h: Over the last but one and the last half hour [K/h]; empty without them.
        reason: Why there is no statement; else empty.
    """

    channel: str
    is_reached: bool | None
    gradients_K_per_h: tuple[float, ...] = ()
    reason: str = ""


def equilibrium(record: Record, motor: Motor, channel: str) -> Equilibrium:
    """Judge whether the rise of a part over the sink has settled at the end of a test.

    Args:
        record: Any record.
        motor: Says which channel is the sink.
        channel: A temperature of the machine.
    """
    sink = sink_channel(motor)
    time_s, part, cold = samples(record, channel, sink)
    if time_s.size == 0:
        return Equilibrium(channel, None, (), f"no sample with both {channel} and {sink}")
    length_s = float(time_s[-1] - time_s[0])
    if length_s < 2.0 * INTERVAL_S:
        return Equilibrium(
            channel, None, (), f"{length_s / 60.0:.0f} min were measured, two half hours are needed"
        )
    gradients = []
    for number in (2, 1):
        end_s = time_s[-1] - (number - 1) * INTERVAL_S
        inside = (time_s >= end_s - INTERVAL_S) & (time_s <= end_s)
        if np.sum(inside) < MIN_SAMPLES or np.ptp(time_s[inside]) < 0.9 * INTERVAL_S:
            return Equilibrium(channel, None, (), "a gap lies in the last hour")
        slope = np.polyfit(time_s[inside] - end_s, (part - cold)[inside], 1)[0]
        gradients.append(3600.0 * float(slope))
    is_reached = all(abs(gradient) <= LARGEST_GRADIENT_K_PER_H for gradient in gradients)
    return Equilibrium(channel, is_reached, tuple(gradients))
