"""The offset of two clocks near a first guess, and how sure it is.

Three traps lie here. Along a search the overlap of the records changes, and with it how much the
signals vary in it: a slow course correlates best where its flat part is left out. So the stretch of
the test is the same at every offset tried. Interpolation halfway between noisy samples averages
their noise, so that every half step would look like a better offset. So both records are smoothed
by a Gaussian before, which leaves the noise the same wherever it is read. And the noise of one
record resembles that of the other here and there; where a signal is slow, that would pass as a
sharp answer. So the Gaussian is as wide as it can be without taking off what both records share.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from heatrun.bench.checks.samples import median_step, samples
from heatrun.bench.clocks.clock_offset import correlation as residual_correlation
from heatrun.bench.record import Record

from .likeness import pearson, score

SMOOTHING = (1.5, 3.0, 6.0, 12.0, 24.0, 48.0)
"""Standard deviations of the Gaussian tried, in steps of the grid [1]. With the first, the variance
of noise read between two samples differs by less than 1e-6 from that at a sample."""

HARMLESS = 1.2
"""A Gaussian that takes off more than this many times the noise takes off signal [1]; the noise is
what a straight line of one record leaves of the other."""

FEWEST = 10
"""Samples of a signal below which it says nothing of the offset [1]."""

NUM_TRIED = 61
"""Offsets tried across a range; the next range is where the likelihood is."""

FALLEN = 12.0
"""A log likelihood this far below the peak holds under a 1e-5 of its probability."""

ENOUGH = 0.4
"""Share of the offsets tried that must carry likelihood [1], so that its width is resolved."""

FIRST_RANGE = 6.0
"""Half width of the first range, in steps of the grid that the guess comes from [1]."""

LARGEST_RANGE = 0.2
"""Half width of the last range, as a share of the overlap [1]: the rest must be left to compare."""

MIN_RANGE_SD = 3.0
"""Standard uncertainties that must fit into the half width [1], or the range was too narrow."""


@dataclass(frozen=True)
class Courses:
    """The shared signals of two records, smoothed.

    Attributes:
        time_s: Even grid on the test's clock [s], shape (grid,).
        ours: Signals of the test on it, shape (grid,) each.
        theirs: Signals of the reference, to be read at any time on its clock.
        reference_s: First and last time of the reference, on its clock [s].
        correlated: Points of the grid that the Gaussian makes count as one, by signal [1].
    """

    time_s: Float[np.ndarray, " grid"]
    ours: Mapping[str, Float[np.ndarray, " grid"]]
    theirs: Mapping[str, CubicSpline]
    reference_s: tuple[float, float]
    correlated: Mapping[str, float]

    @classmethod
    def of(
        cls,
        test: Record,
        reference: Record,
        channels: Sequence[str],
        offset_s: float,
        grid_s: float,
    ) -> Courses:
        """Smooth two records for a grid [s], which stand to each other about by an offset [s]."""
        ours_s, theirs_s = samples(test)[0], samples(reference)[0]
        time_s = np.arange(ours_s[0], ours_s[-1], grid_s)
        width = {
            c: _width(test, reference, c, offset_s, grid_s)
            for c in channels
            if min(samples(test, c)[0].size, samples(reference, c)[0].size) >= FEWEST
        }
        return cls(
            time_s,
            {c: _smoothed(test, c, w * grid_s)(time_s) for c, w in width.items()},
            {c: _smoothed(reference, c, w * grid_s) for c, w in width.items()},
            (float(theirs_s[0]), float(theirs_s[-1])),
            {c: 2.0 * float(np.sqrt(np.pi)) * w for c, w in width.items()},
        )

    def overlap(self, offset_s: float) -> tuple[float, float]:
        """Return first and last time on the test's clock that both cover [s]."""
        first, last = (end + offset_s for end in self.reference_s)
        return max(float(self.time_s[0]), first), min(float(self.time_s[-1]), last)

    def correlations(self, offset_s: float, window_s: tuple[float, float]) -> dict[str, float]:
        """Return the correlation of each signal that varies in a window of the test [1]."""
        inside = self._inside(window_s)
        found = {}
        for channel, ours in self.ours.items():
            r = pearson(ours[inside], self.theirs[channel](self.time_s[inside] - offset_s))
            if r is not None:
                found[channel] = r
        return found

    def independent(self, offset_s: float, window_s: tuple[float, float]) -> dict[str, float]:
        """Return how many independent samples each signal counts that follows the other [1]."""
        inside = self._inside(window_s)
        numbers = {}
        for channel, r in self.correlations(offset_s, window_s).items():
            if r > 0.0:
                a = self.ours[channel][inside]
                b = self.theirs[channel](self.time_s[inside] - offset_s)
                a, b = a - np.mean(a), b - np.mean(b)
                residual = a - (a @ b) / (b @ b) * b
                hang_together = max(residual_correlation(residual), self.correlated[channel])
                numbers[channel] = residual.size / hang_together
        return numbers

    def _inside(self, window_s: tuple[float, float]) -> np.ndarray:
        return (self.time_s >= window_s[0]) & (self.time_s <= window_s[1])


def refine(
    test: Record, reference: Record, channels: Sequence[str], start_s: float, grid_s: float
) -> tuple[float, float]:
    r"""Return the offset that fits best near a guess, and its standard uncertainty [s].

    The log likelihood of an offset is the sum over the signals of $-\tfrac{n}{2}\ln(1 - r^2)$, each
    with as many samples n as its residuals are independent; under a flat prior it gives mean and
    uncertainty.

    Args:
        test: The record whose clock is kept.
        reference: The other record.
        channels: Signals that both hold.
        start_s: The guess [s].
        grid_s: How far it may be off [s].
    """
    courses = Courses.of(test, reference, channels, start_s, grid_s)
    centre_s, half_s = start_s, FIRST_RANGE * grid_s
    while True:
        first_s, last_s = courses.overlap(centre_s)
        limit_s = LARGEST_RANGE * (last_s - first_s)
        half_s = min(half_s, limit_s)
        window_s = (first_s + half_s, last_s - half_s)
        offset_s, sd_s = _within(courses, centre_s, half_s, window_s)
        is_inside = abs(offset_s - centre_s) < 0.9 * half_s and MIN_RANGE_SD * sd_s <= half_s
        if is_inside or half_s >= limit_s:
            return offset_s, sd_s
        centre_s, half_s = offset_s, 2.0 * half_s


def _within(
    courses: Courses, centre_s: float, half_s: float, window_s: tuple[float, float]
) -> tuple[float, float]:
    """Mean and standard deviation of the offset in a range, under a flat prior."""
    weights = courses.independent(centre_s, window_s)

    def log_likelihood(offset_s: float) -> float:
        near = courses.correlations(offset_s, window_s)
        return sum(n * score([near[c]]) for c, n in weights.items() if c in near)

    low_s, high_s = centre_s - half_s, centre_s + half_s
    while True:
        tried = np.linspace(low_s, high_s, NUM_TRIED)
        values = np.array([log_likelihood(float(offset_s)) for offset_s in tried])
        near = np.flatnonzero(values > np.max(values) - FALLEN)
        first, last = max(int(near[0]) - 1, 0), min(int(near[-1]) + 1, NUM_TRIED - 1)
        if last - first > ENOUGH * NUM_TRIED:
            mass = np.exp(values - np.max(values))
            mean_s = float(mass @ tried / np.sum(mass))
            return mean_s, float(np.sqrt(mass @ (tried - mean_s) ** 2 / np.sum(mass)))
        low_s, high_s = float(tried[first]), float(tried[last])


def _smoothed(record: Record, channel: str, width_s: float) -> CubicSpline:
    """A signal under a Gaussian, as a curve over the record's own clock."""
    time_s, values = samples(record, channel)
    width = width_s / median_step(time_s)
    return CubicSpline(time_s, gaussian_filter1d(values, width, mode="nearest"))


def _width(test: Record, reference: Record, channel: str, offset_s: float, grid_s: float) -> float:
    """The widest Gaussian, in steps of the grid, that takes nothing but noise off a signal."""
    ours_s, ours = samples(test, channel)
    theirs_s, theirs = samples(reference, channel)
    first_s = max(ours_s[0], theirs_s[0] + offset_s)
    time_s = np.arange(first_s, min(ours_s[-1], theirs_s[-1] + offset_s), grid_s)
    a = np.interp(time_s, ours_s, ours)
    b = np.interp(time_s - offset_s, theirs_s, theirs)
    if pearson(a, b) is None:
        return SMOOTHING[0]
    b = b * float(np.polyfit(b, a, 1)[0])

    def taken_off(values: np.ndarray, width: float) -> float:
        return float(np.mean((values - gaussian_filter1d(values, width, mode="nearest")) ** 2))

    chosen = SMOOTHING[0]
    for width in SMOOTHING[1:]:
        if taken_off(a, width) + taken_off(b, width) > HARMLESS * taken_off(a - b, width):
            break
        chosen = width
    return chosen
