"""Has the machine reached thermal equilibrium at the end of a test?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bench.checks.samples import block_means, samples, sink_channel
from ..bench.clock_offset import correlation
from ..bench.record import Record
from ..motor import Motor

INTERVAL_S = 1800.0
"""Length of each of the two last intervals [s]; ours, the standard leaves it open."""

LARGEST_GRADIENT_K_PER_H = 2.0
"""As in the definition of thermal equilibrium of IEC 60034-1:2010 [K/h]; other editions differ."""

BLOCK_S = 60.0
"""Means that the line is laid through [s]: thirty in an interval, freed of the fast noise."""

MIN_BLOCKS = 10
"""Means in an interval below which its gradient is not told [1]."""

COVER = 2.0
"""Standard errors on each side of a gradient that must agree with the statement [1]: about 95 %."""

CRITERION = (
    "Reached where the rise of a part over the sink changes by at most 2 K per hour in each of the "
    "last two half hours; not reached where it surely changes faster in either; undecided where 2 "
    "K per hour lie within two standard errors. The 2 K per hour follow the definition of thermal "
    "equilibrium in IEC 60034-1:2010; the half hours, the line of least squares through means of a "
    "minute and its standard error, by the correlation of the residuals, are ours. Other editions "
    "and standards ask for other figures: check the one that binds the test."
)
"""The criterion, in words of the report."""


@dataclass(frozen=True)
class Equilibrium:
    """Whether one part of the machine has settled.

    Attributes:
        channel: The temperature.
        is_reached: None where the record does not allow a statement.
        gradients_K_per_h: Over the last but one and the last half hour [K/h]; empty without them.
        errors_K_per_h: Their standard errors [K/h].
        reason: Why there is no statement; else empty.
    """

    channel: str
    is_reached: bool | None
    gradients_K_per_h: tuple[float, ...] = ()
    errors_K_per_h: tuple[float, ...] = ()
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
        return Equilibrium(channel, None, reason=f"no sample with both {channel} and {sink}")
    length_s = float(time_s[-1] - time_s[0])
    # a step may be missing at the end of an hour's test
    if length_s < 2.0 * INTERVAL_S - BLOCK_S:
        return Equilibrium(
            channel,
            None,
            reason=f"{length_s / 60.0:.0f} min were measured, two half hours are needed",
        )
    slopes = []
    for number in (2, 1):
        end_s = time_s[-1] - (number - 1) * INTERVAL_S
        inside = (time_s > end_s - INTERVAL_S) & (time_s <= end_s)
        middle_s, rise = block_means(time_s[inside], BLOCK_S, (part - cold)[inside])
        if middle_s.size < MIN_BLOCKS or np.ptp(middle_s) < 0.8 * INTERVAL_S:
            return Equilibrium(channel, None, reason="a gap lies in the last hour")
        slopes.append(_slope(middle_s / 3600.0, rise))
    gradients = tuple(gradient for gradient, _ in slopes)
    errors = tuple(error for _, error in slopes)
    limit = LARGEST_GRADIENT_K_PER_H
    if all(abs(g) + COVER * e <= limit for g, e in slopes):
        return Equilibrium(channel, True, gradients, errors)
    if any(abs(g) - COVER * e > limit for g, e in slopes):
        return Equilibrium(channel, False, gradients, errors)
    return Equilibrium(
        channel, None, gradients, errors, "2 K/h lie within two standard errors of a gradient"
    )


def _slope(time_h: np.ndarray, rise_K: np.ndarray) -> tuple[float, float]:
    """Slope of a line [K/h] and its standard error, with residuals counted as far as they are new.

    Readings that were rounded to whole degrees leave a step in a flat course; its residuals hang
    together for minutes, and white noise in their place would make the slope look certain.
    """
    centred = time_h - np.mean(time_h)
    spread = float(np.sum(centred**2))
    slope = float(centred @ rise_K) / spread
    residual = rise_K - np.mean(rise_K) - slope * centred
    freedom = max(rise_K.size / correlation(residual) - 2.0, 1.0)
    variance = float(np.sum(residual**2)) / freedom / spread
    return slope, float(np.sqrt(variance))
