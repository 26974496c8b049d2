"""Has the machine reached thermal equilibrium, on each stretch of constant load by itself?

A course that was stopped before it settled is continued to its steady state (`steady_rise`).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from ..checks.quick_fit import Solved, closer, solved_decays, weighed
from ..readers.clock_offset import correlation
from ..record.motor import EQUILIBRIA, Criterion, Motor
from ..record.record import Record
from ..record.samples import block_means, has, rounding_step, runs, samples, sink_channel

BLOCK_S = 60.0
"""Means that are compared [s]: a duty that repeats within a minute counts as a constant load."""

SIDE = 3
"""Means on each side of a moment whose medians are compared [1]: one outlier moves neither."""

STEP_SHARE = 0.05
"""A change of the load by this share of its largest magnitude ends a stretch [1]: above what the
warming of copper or a controller changes within minutes, below every step of a test plan."""

GAP_BLOCKS = 3.0
"""Minutes without a sample that end a stretch [1]."""

LOADS = (
    ("torque_Nm", "phase_current_A"),
    ("losses_W",),
    ("mechanical_power_W", "electrical_power_W", "dc_power_W"),
    ("i_d_A", "i_q_A"),
)
"""What tells the load, the most direct first: the first group that was recorded counts."""

BESIDE = ("speed_rpm", "coolant_flow_L_per_min", "fan")
"""What changes losses or cooling beside it."""


@dataclass(frozen=True)
class Stretch:
    """A stretch of constant load."""

    from_s: float  # Its beginning, on the record's clock [s].
    to_s: float  # Its end [s].

    @property
    def length_s(self) -> float:
        """How long it is [s]."""
        return self.to_s - self.from_s

    def holds(self, time_s: Float[np.ndarray, " time"]) -> bool:
        """Return whether any of these times lies in it."""
        return bool(np.any((time_s >= self.from_s) & (time_s <= self.to_s)))


def load_channels(record: Record) -> tuple[str, ...]:
    """Return the channels that tell whether the load was held; empty where none was recorded."""
    for group in LOADS:
        found = [channel for channel in group if has(record, channel)]
        if found:
            return (*found, *(channel for channel in BESIDE if has(record, channel)))
    return tuple(channel for channel in BESIDE if has(record, channel))


def stretches(record: Record, shortest_s: float) -> tuple[Stretch, ...]:
    """Return the stretches of constant load, in their order.

    The minutes on both sides of a step belong to no stretch.

    Args:
        record: With one of the `load_channels`.
        shortest_s: Shorter ones are left out [s].
    """
    channels = load_channels(record)
    time_s, *loads = samples(record, *channels)
    if time_s.size == 0:
        return ()
    middle_s, *means = block_means(time_s, BLOCK_S, *loads)
    is_held = np.ones(middle_s.size, dtype=bool)
    for values in means:
        is_held &= ~_changes(values)
    width_s = max(BLOCK_S, float(np.median(np.diff(middle_s)))) if middle_s.size > 1 else BLOCK_S
    is_cut = np.append(False, np.diff(middle_s) > GAP_BLOCKS * width_s)
    found = []
    for first, end in zip(*runs(is_held), strict=True):
        cuts = [first, *(k for k in np.flatnonzero(is_cut) if first < k < end), end]
        for low, high in pairwise(cuts):
            from_s = float(middle_s[low]) - 0.5 * BLOCK_S
            to_s = float(middle_s[high - 1]) + 0.5 * BLOCK_S
            stretch = Stretch(max(from_s, float(time_s[0])), min(to_s, float(time_s[-1])))
            if stretch.length_s >= shortest_s:
                found.append(stretch)
    return tuple(found)


def _changes(values: np.ndarray) -> np.ndarray:
    """Whether the load changes on either side of a block."""
    limit = STEP_SHARE * float(np.max(np.abs(values)))
    jump = np.zeros(values.size + 1, dtype=bool)
    for k in range(1, values.size):
        before = np.median(values[max(0, k - SIDE) : k])
        after = np.median(values[k : k + SIDE])
        # the medians also change beside a step; the step itself is where the neighbours differ
        jump[k] = abs(after - before) > limit and abs(values[k] - values[k - 1]) > 0.5 * limit
    return jump[:-1] | jump[1:]


STEADY_BLOCK_S = 60.0
"""Means that are fitted [s]."""

FAST_S = 600.0
"""Left out at the beginning [s]: five time constants of a winding of two minutes."""

FAST_SHARE = 1.0 / 3.0
"""At most this share of the stretch is left out [1]."""

FEWEST = 12
"""Means below which nothing is fitted [1]."""

NUM_TAU = 160
SHORTEST_TAU, LONGEST_TAU = 0.05, 20.0
"""Time constants tried, in lengths of what is fitted [1]."""

SMALLEST, ENOUGH, MOST_LOOKS = 1e-6, 0.4, 12
"""The grid is drawn closer until this share of it [1] has more than the smallest weight beside the
best [1]: an exact record leaves the time constant open by less than a coarse step."""

NUM_DRAWS = 2000
"""Draws behind the band: its limits are good to a twentieth of its half width."""

STRAIGHT = 0.05
"""Share of the probability at the longest time constants from which on the course is straight [1];
the upper fifth of the logarithms tried counts as such."""


@dataclass(frozen=True)
class SteadyRise:
    """The steady state that a course tends to, extrapolated."""

    rise_K: float  # Median of the steady rise over the sink [K].
    rise_95_K: tuple[float, float]  # Its 95 % limits [K].
    tau_s: float  # Median of the time constant [s].
    end_s: float  # End of what was fitted [s].
    # Steady rise, amplitude at the end and time constant, shape (3, draw).
    draws: Float[np.ndarray, "3 draw"]

    def course(self, time_s: Float[np.ndarray, " time"]) -> tuple[np.ndarray, ...]:
        """Return lower limit, median and upper limit of the rise at later times [K].

        Args:
            time_s: On the clock of what was fitted [s], from its end on.
        """
        rest, amplitude, tau = self.draws[:, :, None]
        courses = rest + amplitude * np.exp(-(time_s[None, :] - self.end_s) / tau)
        low, middle, high = np.quantile(courses, (0.025, 0.5, 0.975), axis=0)
        return low, middle, high


def steady_rise(
    time_s: Float[np.ndarray, " time"], rise_K: Float[np.ndarray, " time"]
) -> SteadyRise | str:
    r"""Continue a course to its steady state.

    The rise over the sink of the last stretch of constant load is taken as

    $$ \theta(t) = \theta_\infty + A\, e^{-(t - t_0)/\tau} $$

    after its first minutes, in which the fast parts settle. For each time constant the line of
    least squares gives the rest; the time constants are weighed by the likelihood that is left,
    with as many samples as the residuals are independent. A band follows, and no figure where the
    course is still so straight that any steady state would do.

    Args:
        time_s: Increasing times of one stretch of constant load [s].
        rise_K: Rise over the sink [K].

    Returns:
        The steady state, or why none can be told.
    """
    skipped_s = min(FAST_S, FAST_SHARE * float(time_s[-1] - time_s[0]))
    late = time_s >= time_s[0] + skipped_s
    middle_s, means = block_means(time_s[late], STEADY_BLOCK_S, rise_K[late])
    if middle_s.size < FEWEST:
        return f"{middle_s.size} means of a minute are too few"
    span_s = float(np.ptp(middle_s))
    end_s = float(middle_s[-1])
    grid = span_s * np.geomspace(SHORTEST_TAU, LONGEST_TAU, NUM_TAU)
    fits, weight, freedom = _on_grid(middle_s, means, grid)
    if np.sum(weight[-NUM_TAU // 5 :]) > STRAIGHT:
        return "the readings show no bend: any steady state would do"
    taus = grid
    for _ in range(MOST_LOOKS):
        likely = np.flatnonzero(weight > SMALLEST * np.max(weight))
        if likely.size > ENOUGH * NUM_TAU:
            break
        taus = closer(taus, likely)
        fits, weight, freedom = _on_grid(middle_s, means, taus)
    rng = np.random.default_rng(0)
    picked = rng.choice(taus.size, NUM_DRAWS, p=weight)
    variance = (np.min(fits.squares) + _floor(means)) / freedom
    root = np.sqrt(variance) * np.linalg.cholesky(fits.inverse)[picked]
    apart = np.einsum("dij,dj->di", root, rng.standard_t(freedom, (NUM_DRAWS, 2)))
    first, rest = (fits.solution[picked] + apart).T
    draws = np.stack([rest, first * np.exp(-span_s / taus[picked])])
    low, middle, high = np.quantile(draws[0], (0.025, 0.5, 0.975))
    return SteadyRise(
        float(middle), (float(low), float(high)), float(np.median(taus[picked])), end_s,
        np.vstack([draws, taus[picked]]),
    )  # fmt: skip


def _on_grid(
    middle_s: np.ndarray, means: np.ndarray, taus: np.ndarray
) -> tuple[Solved, np.ndarray, float]:
    """Decay and rest of each time constant, its probability, and the degrees of freedom."""
    fits = solved_decays(middle_s, means, taus[:, None], has_rest=True)
    best = int(np.argmin(fits.squares))
    first, rest = fits.solution[best]
    residual = means - rest - first * np.exp((middle_s[0] - middle_s) / taus[best])
    freedom = max(means.size / correlation(residual) - 3.0, 1.0)
    weight = weighed(-0.5 * (freedom + 1.0) * np.log(fits.squares + _floor(means)))
    return fits, weight, freedom


def _floor(means: np.ndarray) -> float:
    """A perfect fit would weigh infinitely; no reading is that good."""
    return 1e-12 * float(np.sum(means**2)) + 1e-300


INTERVALS_S = (1800.0, 1200.0, 900.0)
"""Lengths of each of two successive intervals at the end of a stretch [s]: the longest tells coarse
readings from a drift, the shortest is free of the answer to a load step first. Ours: the standard
speaks of two successive reasonable intervals."""

MOST = 3.0
"""An interval is at most this part of the stretch [1]: the rest belongs to the answer to the load
step. Stretches below 45 min have intervals of this part alone."""

MIN_BLOCKS = 10
"""Means in an interval below which its gradient is not told [1]."""

MIN_SPAN = 0.8
"""Share of an interval that its means must span [1]: a line over less is that of another one."""

SHORTEST_S = 1800.0 - BLOCK_S
"""Stretches that are judged [s]; one of half an hour may lack its last samples."""

LOOK_EVERY_S = 300.0
"""How often a stretch is asked whether it has settled by then [s]."""

COVER = 2.0
"""Standard errors on each side of a gradient that must agree with the statement [1]: about 95 %."""

_HELD = (
    "Judged at the end of each stretch of constant load of half an hour or more; a change of the "
    "load by 5 % of its largest magnitude ends a stretch, and a load that is not known or never "
    "held makes the record one. Reached where the rise of a part over the sink surely changes by "
)
_SURELY = " Surely is by two standard errors of a line through means of a minute. "
TWO_INTERVALS = (
    f"{_HELD}at most 2 K per hour in two successive intervals of half an hour, 20 or 15 minutes "
    "(at most a third of the stretch); not reached where it surely changes faster in one of the "
    f"shortest; else undecided.{_SURELY}The 2 K "
    "per hour follow the definition of thermal equilibrium in IEC 60034-1:2010, the rest is ours; "
    "other editions and standards ask for other figures: check the one that binds the test."
)


def criterion_words(name: str) -> str:
    """Return a criterion of `EQUILIBRIA` in words of the report."""
    of = EQUILIBRIA[name]
    if of.num_intervals > 1:
        return TWO_INTERVALS
    return (
        f"{_HELD}at most {of.change_K:g} K in its last {of.over_s / 60.0:.0f} min; not reached "
        f"where it surely changes by more; else undecided.{_SURELY}The criterion is that of {name} "
        f"({of.source}); check the edition that binds the test."
    )


EXTRAPOLATION = (
    "Where a stretch ends before equilibrium, the rise after its first ten minutes is continued by "
    "one exponential; the band holds 95 % of the time constants and steady states that the "
    "readings leave open under constant load and sink. It is no measurement, and a machine with "
    "several slow parts may settle higher."
)
"""What a continued course is, in words of the report."""


@dataclass(frozen=True)
class Equilibrium:
    """Whether one part of the machine has settled on a stretch of constant load."""

    channel: str  # The temperature.
    is_reached: bool | None  # At the end of the stretch; None where it does not allow a statement.
    # Over the last but one and the last interval [K/h]; empty without them.
    gradients_K_per_h: tuple[float, ...] = ()
    errors_K_per_h: tuple[float, ...] = ()  # Their standard errors [K/h].
    reason: str = ""  # Why there is no statement; else empty.
    # When the criterion was first met by the intervals before [s], looked for every five minutes;
    # None if never.
    first_reached_s: float | None = None
    stretch: Stretch | None = None  # The stretch; None where the record has no sample for it.
    # Where it was not reached, the steady rise that the course tends to, extrapolated; why there is
    # none; or None where it was reached.
    steady: SteadyRise | str | None = None
    # Mean of the sink over the last interval [degC]; NaN without samples.
    sink_degC: float = float("nan")
    is_held: bool = False  # Whether the load is known to have been constant.


def equilibria(record: Record, motor: Motor, channel: str) -> tuple[Equilibrium, ...]:
    """Judge whether the rise of a part over the sink has settled on each stretch.

    Args:
        record: Any record.
        motor: Says which channel is the sink.
        channel: A temperature of the machine.

    Returns:
        One for each stretch of constant load, in their order; one for the whole record where the
        load was not recorded or never held.
    """
    sink = sink_channel(motor)
    time_s, part, cold = samples(record, channel, sink)
    if time_s.size == 0:
        return (Equilibrium(channel, None, reason=f"no sample with both {channel} and {sink}"),)
    loads = load_channels(record)
    held = stretches(record, SHORTEST_S) if loads else ()
    by = EQUILIBRIA[motor.equilibrium]
    if held:
        return tuple(_judged(time_s, part, cold, channel, stretch, "", by) for stretch in held)
    unknown = "the load is not held" if loads else "no channel tells whether the load was held"
    whole = Stretch(float(time_s[0]), float(time_s[-1]))
    return (_judged(time_s, part, cold, channel, whole, unknown, by),)


def equilibrium(record: Record, motor: Motor, channel: str) -> Equilibrium:
    """Return the verdict on the last stretch; as `equilibria`."""
    return equilibria(record, motor, channel)[-1]


def _judged(
    time_s: np.ndarray,
    part: np.ndarray,
    cold: np.ndarray,
    channel: str,
    stretch: Stretch,
    unknown: str,
    by: Criterion,
) -> Equilibrium:
    """The verdict on one stretch; `unknown` says why its course cannot be continued."""
    inside = (time_s >= stretch.from_s) & (time_s <= stretch.to_s)
    time_s, part, cold = time_s[inside], part[inside], cold[inside]
    if stretch.length_s < SHORTEST_S or time_s.size < 2:
        reason = f"{stretch.length_s / 60.0:.0f} min were measured, half an hour is needed"
        return Equilibrium(channel, None, reason=reason, stretch=stretch)
    step_K = rounding_step(part) or 0.0

    def slopes_at(end_s: float) -> list[tuple[float, float]]:
        """Those that show equilibrium, else those of the shortest intervals."""
        longest_s = (end_s - stretch.from_s) / MOST
        lengths_s = [s for s in INTERVALS_S if s <= longest_s] or [longest_s]
        if by.num_intervals == 1:
            lengths_s = [by.over_s]
        found = [_slopes(time_s, part, cold, step_K, end_s, s, by) for s in lengths_s]
        return next((slopes for slopes in found if _state(slopes, by) is True), found[-1])

    ends_s = np.arange(stretch.from_s + SHORTEST_S, stretch.to_s, LOOK_EVERY_S)
    first_s = next((float(end_s) for end_s in ends_s if _state(slopes_at(end_s), by) is True), None)
    slopes = slopes_at(stretch.to_s)
    late = time_s >= stretch.to_s - min(INTERVALS_S[0], stretch.length_s / MOST)
    sink_degC = float(np.mean(cold[late])) if late.any() else float("nan")
    if len(slopes) < by.num_intervals:
        reason = "a gap lies in the last intervals, or they have too few samples"
        return Equilibrium(channel, None, reason=reason, first_reached_s=first_s, stretch=stretch,
                           sink_degC=sink_degC)  # fmt: skip
    state = _state(slopes, by)
    return Equilibrium(
        channel=channel,
        is_reached=state,
        gradients_K_per_h=tuple(gradient for gradient, _ in slopes),
        errors_K_per_h=tuple(error for _, error in slopes),
        reason=f"{by.K_per_h:g} K/h lie within two standard errors of a gradient"
        if state is None
        else "",
        first_reached_s=stretch.to_s if state is True and first_s is None else first_s,
        stretch=stretch,
        steady=None if state is True else unknown or steady_rise(time_s, part - cold),
        sink_degC=sink_degC,
        is_held=not unknown,
    )


def _state(slopes: list[tuple[float, float]], by: Criterion) -> bool | None:
    """Whether all intervals are surely within the limit; None where that is undecided."""
    limit = by.K_per_h
    if len(slopes) == by.num_intervals and all(abs(g) + COVER * e <= limit for g, e in slopes):
        return True
    if any(abs(g) - COVER * e > limit for g, e in slopes):
        return False
    return None


def _slopes(
    time_s: np.ndarray,
    part: np.ndarray,
    cold: np.ndarray,
    rounding_K: float,
    end_s: float,
    interval_s: float,
    by: Criterion,
) -> list[tuple[float, float]]:
    """Gradient and standard error [K/h] of the intervals before a moment, without gaps.

    A reading that stands still on a coarse step may be off by a uniform error at either end of the
    interval, 1/12 of the step squared each; where noise carries it to and fro, means know better.
    """
    slopes = []
    for number in range(by.num_intervals, 0, -1):
        last_s = end_s - (number - 1) * interval_s
        inside = (time_s > last_s - interval_s) & (time_s <= last_s)
        middle_s, means = block_means(time_s[inside], BLOCK_S, (part - cold)[inside])
        if middle_s.size >= MIN_BLOCKS and np.ptp(middle_s) >= MIN_SPAN * interval_s:
            slope, error = _slope(middle_s / 3600.0, means)
            stuck = _stuck(time_s[inside], part[inside])
            coarse = rounding_K * float(np.sqrt(stuck / 6.0)) / (interval_s / 3600.0)
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
