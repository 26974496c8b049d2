"""Has the machine reached thermal equilibrium at the end of a test?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....bench.checks.samples import block_means, samples, sink_channel
from ....bench.clocks.clock_offset import correlation
from ....bench.record import Record
from ....bench.rounding import rounding_step
from ....motor import Motor

INTERVAL_S = 1800.0
"""Length of each of the two last intervals [s]; ours, the standard leaves it open."""

LARGEST_GRADIENT_K_PER_H = 2.0
"""As in the definition of thermal equilibrium of IEC 60034-1:2010 [K/h]; other editions differ."""

BLOCK_S = 60.0
"""Means that the line is laid through [s]: thirty in an interval, freed of the fast noise."""

MIN_BLOCKS = 10
"""Means in an interval below which its gradient is not told [1]."""

MIN_SPAN = 0.8
"""Share of an interval that its means must span [1]: a line over less is that of another one."""

SHORTEST_S = 2.0 * INTERVAL_S - BLOCK_S
"""A test of an hour may lack its last samples [s]."""

LOOK_EVERY_S = 300.0
"""How often a longer test is asked whether it has settled by then [s]."""

COVER = 2.0
"""Standard errors on each side of a gradient that must agree with the statement [1]: about 95 %."""

CRITERION = (
    "Reached where the rise of a part over the sink changes by at most 2 K per hour in each of the "
    "last two half hours; not reached where it surely changes faster in either; undecided where 2 "
    "K per hour lie within two standard errors. The 2 K per hour follow the definition of thermal "
    "equilibrium in IEC 60034-1:2010; the half hours, the line of least squares through means of a "
    "minute and its standard error, by the correlation of the residuals and the step of the "
    "readings, are ours. Other editions and standards ask for other figures: check the one that "
    "binds the test."
)
"""The criterion, in words of the report."""


@dataclass(frozen=True)
class Equilibrium:
    """Whether one part of the machine has settled.

    Attributes:
        channel: The temperature.
        is_reached: At the end of the record; None where it does not allow a statement.
        gradients_K_per_h: Over the last but one and the last half hour [K/h]; empty without them.
        errors_K_per_h: Their standard errors [K/h].
        reason: Why there is no statement; else empty.
        first_reached_s: When the criterion was first met by the hour before [s], looked for every
            five minutes; None if never.
    """

    channel: str
    is_reached: bool | None
    gradients_K_per_h: tuple[float, ...] = ()
    errors_K_per_h: tuple[float, ...] = ()
    reason: str = ""
    first_reached_s: float | None = None


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
    if length_s < SHORTEST_S:
        return Equilibrium(
            channel,
            None,
            reason=f"{length_s / 60.0:.0f} min were measured, two half hours are needed",
        )
    step_K = rounding_step(part) or 0.0
    ends_s = np.arange(time_s[0] + 2.0 * INTERVAL_S, time_s[-1], LOOK_EVERY_S)

    def slopes_at(end_s: float) -> list[tuple[float, float]]:
        return _slopes(time_s, part, cold, step_K, end_s)

    first_s = next((float(end_s) for end_s in ends_s if _state(slopes_at(end_s)) is True), None)
    slopes = slopes_at(float(time_s[-1]))
    if len(slopes) < 2:
        return Equilibrium(
            channel, None, reason="a gap lies in the last hour", first_reached_s=first_s
        )
    state = _state(slopes)
    reason = "2 K/h lie within two standard errors of a gradient" if state is None else ""
    if state is True and first_s is None:
        first_s = float(time_s[-1])
    return Equilibrium(
        channel,
        state,
        tuple(gradient for gradient, _ in slopes),
        tuple(error for _, error in slopes),
        reason,
        first_s,
    )


def _state(slopes: list[tuple[float, float]]) -> bool | None:
    """Whether both half hours are surely within the limit; None where that is undecided."""
    limit = LARGEST_GRADIENT_K_PER_H
    if len(slopes) == 2 and all(abs(g) + COVER * e <= limit for g, e in slopes):
        return True
    if any(abs(g) - COVER * e > limit for g, e in slopes):
        return False
    return None


def _slopes(
    time_s: np.ndarray, part: np.ndarray, cold: np.ndarray, rounding_K: float, end_s: float
) -> list[tuple[float, float]]:
    """Gradient and standard error [K/h] of the two half hours before a moment, without gaps.

    A reading that stands still on a coarse step may be off by a uniform error at either end of the
    interval, 1/12 of the step squared each; where noise carries it to and fro, means know better.
    """
    slopes = []
    for number in (2, 1):
        last_s = end_s - (number - 1) * INTERVAL_S
        inside = (time_s > last_s - INTERVAL_S) & (time_s <= last_s)
        middle_s, means = block_means(time_s[inside], BLOCK_S, (part - cold)[inside])
        if middle_s.size >= MIN_BLOCKS and np.ptp(middle_s) >= MIN_SPAN * INTERVAL_S:
            slope, error = _slope(middle_s / 3600.0, means)
            stuck = _stuck(time_s[inside], part[inside])
            coarse = rounding_K * float(np.sqrt(stuck / 6.0)) / (INTERVAL_S / 3600.0)
            slopes.append((slope, float(np.hypot(error, coarse))))
    return slopes


def _stuck(time_s: np.ndarray, values: np.ndarray) -> float:
    """Share of the means' minutes in which a reading does not change [1]."""
    _, mean, square = block_means(time_s, BLOCK_S, values, values**2)
    return float(np.mean(square - mean**2 < 1e-9 * (1.0 + square)))


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
