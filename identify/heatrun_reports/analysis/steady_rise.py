r"""A course that was stopped before it settled, continued to its steady state by an exponential.

The rise over the sink of the last stretch of constant load is taken as

$$ \theta(t) = \theta_\infty + A\, e^{-(t - t_0)/\tau} $$

after its first minutes, in which the fast parts settle. For each time constant the line of least
squares gives the rest; the time constants are weighed by the likelihood that is left, with as many
samples as the residuals are independent. A band follows, and no figure where the course is still
so straight that any steady state would do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from heatrun.bench.checks.samples import block_means
from heatrun.bench.clocks.clock_offset import correlation

BLOCK_S = 60.0
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
    """The steady state that a course tends to, extrapolated.

    Attributes:
        rise_K: Median of the steady rise over the sink [K].
        rise_95_K: Its 95 % limits [K].
        tau_s: Median of the time constant [s].
        end_s: End of what was fitted [s].
        draws: Steady rise, amplitude at the end and time constant, shape (3, draw).
    """

    rise_K: float
    rise_95_K: tuple[float, float]
    tau_s: float
    end_s: float
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
    """Continue a course to its steady state.

    Args:
        time_s: Increasing times of one stretch of constant load [s].
        rise_K: Rise over the sink [K].

    Returns:
        The steady state, or why none can be told.
    """
    skipped_s = min(FAST_S, FAST_SHARE * float(time_s[-1] - time_s[0]))
    late = time_s >= time_s[0] + skipped_s
    middle_s, means = block_means(time_s[late], BLOCK_S, rise_K[late])
    if middle_s.size < FEWEST:
        return f"{middle_s.size} means of a minute are too few"
    span_s = float(np.ptp(middle_s))
    end_s = float(middle_s[-1])
    grid = span_s * np.geomspace(SHORTEST_TAU, LONGEST_TAU, NUM_TAU)
    fits, weight, freedom = _weighed(middle_s - end_s, means, grid)
    if np.sum(weight[-NUM_TAU // 5 :]) > STRAIGHT:
        return "the readings show no bend: any steady state would do"
    taus = grid
    for _ in range(MOST_LOOKS):
        likely = np.flatnonzero(weight > SMALLEST * np.max(weight))
        if likely.size > ENOUGH * NUM_TAU:
            break
        first, last = max(int(likely[0]) - 1, 0), min(int(likely[-1]) + 1, NUM_TAU - 1)
        taus = np.geomspace(taus[first], taus[last], NUM_TAU)
        fits, weight, freedom = _weighed(middle_s - end_s, means, taus)
    rng = np.random.default_rng(0)
    picked = rng.choice(taus.size, NUM_DRAWS, p=weight)
    variance = (min(fit.left for fit in fits) + _floor(means)) / freedom
    draws = np.stack(
        [
            fits[k].solution + np.sqrt(variance) * fits[k].root @ rng.standard_t(freedom, 2)
            for k in picked
        ],
        axis=1,
    )
    low, middle, high = np.quantile(draws[0], (0.025, 0.5, 0.975))
    return SteadyRise(
        float(middle), (float(low), float(high)), float(np.median(taus[picked])), end_s,
        np.vstack([draws, taus[picked]]),
    )  # fmt: skip


@dataclass(frozen=True)
class _Fit:
    """Steady rise and amplitude for one time constant; `root` is of their covariance."""

    solution: np.ndarray
    root: np.ndarray
    residual: np.ndarray
    left: float


def _weighed(
    before_s: np.ndarray, means: np.ndarray, taus: np.ndarray
) -> tuple[list[_Fit], np.ndarray, float]:
    """The fit of each time constant, its probability, and the degrees of freedom behind it."""
    fits = [_fit(before_s, means, tau) for tau in taus]
    left = np.array([fit.left for fit in fits])
    best = fits[int(np.argmin(left))]
    freedom = max(means.size / correlation(best.residual) - 3.0, 1.0)
    log_weight = -0.5 * (freedom + 1.0) * np.log(left + _floor(means))
    weight = np.exp(log_weight - np.max(log_weight))
    return fits, weight / np.sum(weight), freedom


def _floor(means: np.ndarray) -> float:
    """A perfect fit would weigh infinitely; no reading is that good."""
    return 1e-12 * float(np.sum(means**2)) + 1e-300


def _fit(before_s: np.ndarray, means: np.ndarray, tau_s: float) -> _Fit:
    # scaled to 1 at the beginning, so that a short time constant gives no huge numbers
    decay = np.exp(-(before_s - before_s[0]) / tau_s)
    matrix = np.stack([np.ones_like(decay), decay], axis=1)
    solution, *_ = np.linalg.lstsq(matrix, means, rcond=None)
    residual = means - matrix @ solution
    inverse = np.linalg.pinv(matrix.T @ matrix)
    at_end = np.diag([1.0, float(decay[-1])])
    values, axes = np.linalg.eigh(inverse)
    root = at_end @ axes @ np.diag(np.sqrt(np.maximum(values, 0.0)))
    return _Fit(at_end @ solution, root, residual, float(residual @ residual))
