"""How the clocks of two records of one manoeuvre stand to each other, by their shared signals.

`heatrun.readers.align` joins two loggers of one test that share no signal, by the winding's
answer to the drive. Two prototypes that drive one manoeuvre share most of their signals, so here
these are laid over each other: the offset is the one at which a straight line explains most of each
signal of one record by that of the other. A bias or a wrong scale therefore does not move it.

How alike two signals are under an offset of their clocks, whatever their bias and scale.

The offset of two clocks near a first guess, and how sure it is.

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
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from heatrun.errors import InputError
from heatrun.readers.clock_offset import correlation as residual_correlation
from heatrun.record.record import Finding, Record
from heatrun.record.samples import median_step, samples

if TYPE_CHECKING:  # SciPy has it in a part that is slow to load
    from scipy.interpolate import CubicSpline

CLOSEST = 1e-6
"""Unexplained share of the variance [1] below which two signals count as the same."""


@dataclass(frozen=True)
class Likeness:
    """A signal of one record explained by a straight line of the other's.

    Attributes:
        r: Correlation [1].
        residual: What the line leaves, in the unit of the signal, shape (common,).
    """

    r: float
    residual: Float[np.ndarray, " common"]


def likeness(
    test: Record, reference: Record, channels: Sequence[str], offset_s: float
) -> dict[str, Likeness]:
    """Return how alike the records are in each signal that varies, at the samples of the test.

    Args:
        test: The record whose clock is kept.
        reference: The other record, interpolated.
        channels: Signals that both hold.
        offset_s: What is added to the reference's clock [s].
    """
    found = {}
    for channel in channels:
        time_s, ours = samples(test, channel)
        other_s, theirs = samples(reference, channel)
        inside = (time_s >= other_s[0] + offset_s) & (time_s <= other_s[-1] + offset_s)
        moved = np.interp(time_s[inside] - offset_s, other_s, theirs)
        r = pearson(ours[inside], moved)
        if r is not None:
            a, b = ours[inside] - np.mean(ours[inside]), moved - np.mean(moved)
            found[channel] = Likeness(r, a - (a @ b) / (b @ b) * b)
    return found


def even(record: Record, channel: str, grid_s: float) -> Float[np.ndarray, " grid"]:
    """Return a signal on an even grid from the record's first sample; NaN outside its samples."""
    all_s = samples(record)[0]
    time_s, values = samples(record, channel)
    grid = np.arange(all_s[0], all_s[-1] + 1e-9 * grid_s, grid_s)
    return np.interp(grid, time_s, values, left=np.nan, right=np.nan)


def overlap(ours: np.ndarray, theirs: np.ndarray, lag: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the parts of two signals that meet when the second is moved by `lag` grid points."""
    first, last = max(lag, 0), min(ours.size, theirs.size + lag)
    return ours[first:last], theirs[first - lag : last - lag]


def pearson(ours: np.ndarray, theirs: np.ndarray) -> float | None:
    """Return the correlation where both are known [1]; None where either does not vary."""
    known = np.isfinite(ours) & np.isfinite(theirs)
    if np.sum(known) < 3:
        return None
    ours, theirs = ours[known], theirs[known]
    a, b = ours - np.mean(ours), theirs - np.mean(theirs)
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    largest = [float(np.max(np.abs(each))) for each in (ours, theirs)]
    # what is left of a constant after its mean is rounding of that mean
    floor = 1e-12 * ours.size * largest[0] * largest[1]
    return float(np.sum(a * b)) / size if size > floor else None


def score(correlations: Sequence[float]) -> float:
    r"""Return the mean of $-\tfrac12\ln(1 - r^2)$, correlations below 0 counted as 0 [nat]."""
    if not correlations:
        return 0.0
    r = np.clip(np.asarray(correlations), 0.0, None)
    return float(np.mean(-0.5 * np.log(np.maximum(1.0 - r**2, CLOSEST))))


SMOOTHING = (1.5, 3.0, 6.0, 12.0, 24.0, 48.0)
"""Standard deviations of the Gaussian tried, in steps of the grid [1]. With the first, the variance
of noise read between two samples differs by less than 1e-6 from that at a sample."""

HARMLESS = 1.2
"""A Gaussian that takes off more than this many times the noise takes off signal [1]; the noise is
what a straight line of one record leaves of the other."""

FEWEST_REFINED = 10
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
            if min(samples(test, c)[0].size, samples(reference, c)[0].size) >= FEWEST_REFINED
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
    from scipy.interpolate import CubicSpline
    from scipy.ndimage import gaussian_filter1d

    time_s, values = samples(record, channel)
    width = width_s / median_step(time_s)
    return CubicSpline(time_s, gaussian_filter1d(values, width, mode="nearest"))


def _width(test: Record, reference: Record, channel: str, offset_s: float, grid_s: float) -> float:
    """The widest Gaussian, in steps of the grid, that takes nothing but noise off a signal."""
    from scipy.ndimage import gaussian_filter1d

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


MIN_OVERLAP = 0.5
"""Share of the shorter record [1] that must lie in the other: a few samples always resemble."""

MAX_GRID = 2000
"""Points of the search grid: steps of 2.7 s in 90 min, refined afterwards."""

MIN_CORRELATION = 0.7
"""Half of a signal's variance [1]: below it for every signal, no manoeuvre is recognised."""

LEFT_SHARE = 0.5
RIVAL_SHARE = 0.9
"""A second offset counts as a rival if its score is this share of the best [1] and the score
between falls below `LEFT_SHARE` of it."""

FEWEST = 10
"""Samples of a record below which no offset is looked for [1]."""

MAX_SD_S = 5.0
"""Standard uncertainty [s] from which the overlay is in doubt: 5 % of a winding's time constant."""


@dataclass(frozen=True)
class Offset:
    """How the clocks of two records stand to each other.

    Attributes:
        offset_s: What is added to the reference's clock to give the test's [s].
        sd_s: Standard uncertainty [s]: of the fit, and of where in its interval a logger stamps; 0
            where the offset was given.
        correlation: Of each shared signal at this offset [1].
        method: How it was found.
        findings: Doubts about it.
    """

    offset_s: float
    sd_s: float
    correlation: dict[str, float]
    method: str
    findings: tuple[Finding, ...] = ()


def find_offset(test: Record, reference: Record, channels: Sequence[str]) -> Offset:
    r"""Find the offset of the reference's clock to the test's.

    The score at an offset is the mean over the signals of $-\tfrac12\ln(1 - r^2)$, the gain in log
    likelihood per sample of a straight line over a constant; correlations below 0 count as 0. What
    it finds on a grid is refined by `heatrun_reports.analysis.offset`.

    Args:
        test: The record whose clock is kept.
        reference: The other record.
        channels: Signals that both hold.

    Raises:
        InputError: If no signal varies in both, or none follows the other at any offset.
    """
    where = f"{test.name}, {reference.name}"
    sizes = [samples(record)[0].size for record in (test, reference)]
    if min(sizes) < FEWEST:
        raise InputError(
            f"Expected at least {FEWEST} samples in each record, got {sizes[0]} and {sizes[1]}.",
            where=where,
            remedy="Check that the files are complete, or give --offset SECONDS.",
        )
    steps_s = [median_step(samples(record)[0]) for record in (test, reference)]
    spans_s = [float(np.ptp(samples(record)[0])) for record in (test, reference)]
    grid_s = max(*steps_s, max(spans_s) / MAX_GRID)
    offsets_s, scores = _search(test, reference, channels, grid_s, spans_s)
    start_s = float(offsets_s[np.argmax(scores)])
    offset_s, fit_sd_s = refine(test, reference, channels, start_s, grid_s)
    found = likeness(test, reference, channels, offset_s)
    most = max((each.r for each in found.values()), default=0.0)
    if most < MIN_CORRELATION:
        raise InputError(
            "Expected two records of one manoeuvre; at the best offset their most similar signal "
            f"correlates by {most:.2f} (at least {MIN_CORRELATION:.2f} are needed), over "
            f"{', '.join(channels)}.",
            where=where,
            remedy="Are they of one manoeuvre? If so, give --offset SECONDS.",
        )
    # A stamp may mark the beginning, middle or end of its interval: uniform over one step each.
    stamp_sd_s = float(np.hypot(steps_s[0], steps_s[1])) / float(np.sqrt(12.0))
    sd_s = float(np.hypot(fit_sd_s, stamp_sd_s))
    findings = (*_rival(where, test.name, offsets_s, scores), *_uncertain(where, test.name, sd_s))
    return Offset(
        offset_s=offset_s,
        sd_s=sd_s,
        correlation={channel: each.r for channel, each in found.items()},
        method=f"shared signals: {', '.join(found)}",
        findings=findings,
    )


def _search(
    test: Record,
    reference: Record,
    channels: Sequence[str],
    grid_s: float,
    spans_s: Sequence[float],
) -> tuple[np.ndarray, np.ndarray]:
    """Offsets on a grid with enough overlap, and their scores."""
    pairs = [(even(test, c, grid_s), even(reference, c, grid_s)) for c in channels]
    num_test, num_reference = (int(span / grid_s + 1e-9) + 1 for span in spans_s)
    needed = max(3, int(MIN_OVERLAP * min(num_test, num_reference)))
    lags = range(needed - num_reference, num_test - needed + 1)
    scores = [score([pearson(*overlap(a, b, lag)) or 0.0 for a, b in pairs]) for lag in lags]
    return np.array(lags) * grid_s, np.array(scores)


def _uncertain(where: str, test: str, sd_s: float) -> tuple[Finding, ...]:
    if sd_s <= MAX_SD_S:
        return ()
    return (
        Finding(
            "offset_uncertain",
            "warning",
            f"Expected an offset known to {MAX_SD_S:.0f} s; its standard uncertainty is {sd_s:.1f} "
            "s, since no shared signal changes sharply.",
            where,
            "Give --offset SECONDS if you know it, or record a step in both.",
            test,
            {"sd_s": sd_s},
        ),
    )


def _rival(where: str, test: str, offsets_s: np.ndarray, scores: np.ndarray) -> tuple[Finding, ...]:
    """A warning if another offset, apart from the best, fits nearly as well."""
    best = int(np.argmax(scores))
    low = np.flatnonzero(scores < LEFT_SHARE * scores[best])
    left = low[low < best].max(initial=-1)
    right = low[low > best].min(initial=scores.size)
    outside = np.r_[scores[: left + 1], np.full(right - left - 1, -np.inf), scores[right:]]
    rival = int(np.argmax(outside))
    if outside[rival] < RIVAL_SHARE * scores[best]:
        return ()
    return (
        Finding(
            "offset_ambiguous",
            "warning",
            f"Expected one offset; {offsets_s[rival]:+.1f} s fits nearly as well as "
            f"{offsets_s[best]:+.1f} s: the manoeuvre repeats.",
            where,
            "Give --offset SECONDS if you know it.",
            test,
            {"rival_s": float(offsets_s[rival])},
        ),
    )
