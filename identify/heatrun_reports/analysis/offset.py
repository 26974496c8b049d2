"""How the clocks of two records of one manoeuvre stand to each other, by their shared signals.

`heatrun.readers.align` joins two loggers of one test that share no signal, by the winding's
answer to the drive. Two prototypes that drive one manoeuvre share most of their signals, so here
these are laid over each other: the offset is the one at which a straight line explains most of each
signal of one record by that of the other. A bias or a wrong scale therefore does not move it. Both
search the likelihood of the offset in the same way (`heatrun.readers.clock_offset`).

Three traps lie here. Along a search the overlap of the records changes, and with it how much the
signals vary in it: a slow course correlates best where its flat part is left out. So the stretch of
the test is the same at every offset tried. Interpolation halfway between noisy samples averages
their noise, so that every half step would look like a better offset. So both records are smoothed
by a Gaussian before, which leaves the noise the same wherever it is read. And the noise of one
record resembles that of the other here and there; where a signal is slow, that would pass as a
sharp answer. So the Gaussian is as wide as it can be without taking off what both records share.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from heatrun.errors import InputError
from heatrun.readers.clock_offset import correlation, search_offset, stamp_sd_s
from heatrun.record.record import Finding, Record
from heatrun.record.samples import median_step, samples

if TYPE_CHECKING:  # SciPy has it in a part that is slow to load
    from scipy.interpolate import CubicSpline

CLOSEST = 1e-6
"""Unexplained share of the variance [1] below which two signals count as the same."""


def _likeness(
    test: Record, reference: Record, channels: Sequence[str], offset_s: float
) -> dict[str, float]:
    """Return the correlation of each signal that varies [1], at the samples of the test.

    The reference is interpolated, an offset [s] added to its clock.
    """
    found = {}
    for channel in channels:
        time_s, ours = samples(test, channel)
        clock, theirs = samples(reference, channel)
        clock = clock + offset_s
        inside = (time_s >= clock[0]) & (time_s <= clock[-1])
        line = _line(ours[inside], np.interp(time_s[inside], clock, theirs))
        if line is not None:
            found[channel] = line[0]
    return found


def _line(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, np.ndarray] | None:
    """Correlation, and what a straight line leaves of the first; None where either is constant."""
    known = np.isfinite(ours) & np.isfinite(theirs)
    if np.sum(known) < 3:
        return None
    ours, theirs = ours[known], theirs[known]
    a, b = ours - np.mean(ours), theirs - np.mean(theirs)
    size = float(np.sqrt((a @ a) * (b @ b)))
    # what is left of a constant after its mean is rounding of that mean
    if size <= 1e-12 * ours.size * float(np.max(np.abs(ours)) * np.max(np.abs(theirs))):
        return None
    return float(a @ b) / size, a - (a @ b) / (b @ b) * b


def _score(r: float) -> float:
    r"""Gain of a line, $-\tfrac12\ln(1 - r^2)$ [nat] a sample; correlations below 0 count as 0."""
    return float(-0.5 * np.log(max(1.0 - max(r, 0.0) ** 2, CLOSEST)))


SMOOTHING = (1.5, 3.0, 6.0, 12.0, 24.0, 48.0)
"""Standard deviations of the Gaussian tried, in steps of the grid [1]. With the first, the variance
of noise read between two samples differs by less than 1e-6 from that at a sample."""

HARMLESS = 1.2
"""A Gaussian that takes off more than this many times the noise takes off signal [1]; the noise is
what a straight line of one record leaves of the other."""

FEWEST_REFINED = 10
"""Samples of a signal below which it says nothing of the offset [1]."""

NUM_TRIED = 61
"""Offsets tried first across a range."""

FIRST_RANGE = 6.0
"""Half width of the first range, in steps of the grid that the guess comes from [1]."""

LARGEST_RANGE = 0.2
"""Half width of the last range, as a share of the overlap [1]: the rest must be left to compare."""

MIN_RANGE_SD = 3.0
"""Standard uncertainties that must fit into the half width [1], or the range was too narrow."""


@dataclass(frozen=True)
class Courses:
    """The shared signals of two records, smoothed."""

    time_s: Float[np.ndarray, " grid"]  # Even grid on the test's clock [s], shape (grid,).
    ours: Mapping[str, Float[np.ndarray, " grid"]]  # Signals of the test on it, shape (grid,) each.
    # Signals of the reference, to be read at any time on its clock.
    theirs: Mapping[str, CubicSpline]
    reference_s: tuple[float, float]  # First and last time of the reference, on its clock [s].
    # Points of the grid that the Gaussian makes count as one, by signal [1].
    correlated: Mapping[str, float]

    @classmethod
    def of(
        cls,
        test: Record,
        reference: Record,
        channels: Sequence[str],
        offset_s: float,
        grid_s: float,
    ) -> Courses:  # fmt: skip
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

    def lines(
        self, offset_s: float, window_s: tuple[float, float]
    ) -> Iterator[tuple[str, float, np.ndarray]]:
        """Yield name, correlation and residual of each signal that varies in a window."""
        inside = (self.time_s >= window_s[0]) & (self.time_s <= window_s[1])
        for channel, ours in self.ours.items():
            line = _line(ours[inside], self.theirs[channel](self.time_s[inside] - offset_s))
            if line is not None:
                yield channel, *line


def _log_likelihood(
    courses: Courses, window_s: tuple[float, float], weight: Mapping[str, float], offset_s: float
) -> float:
    lines = courses.lines(offset_s, window_s)
    return sum(weight.get(name, 0.0) * _score(r) for name, r, _ in lines)


def _refined(
    test: Record, reference: Record, channels: Sequence[str], start_s: float, grid_s: float
) -> tuple[float, float]:
    r"""Return the offset that fits best near a guess, and its standard uncertainty [s].

    The log likelihood of an offset is the sum over the signals of $-\tfrac{n}{2}\ln(1 - r^2)$, each
    with as many samples n as its residuals are independent.
    """
    courses = Courses.of(test, reference, channels, start_s, grid_s)
    centre_s, half_s = start_s, FIRST_RANGE * grid_s
    while True:
        first_s, last_s = courses.overlap(centre_s)
        limit_s = LARGEST_RANGE * (last_s - first_s)
        half_s = min(half_s, limit_s)
        window_s: tuple[float, float] = (first_s + half_s, last_s - half_s)
        weight: dict[str, float] = {
            name: residual.size / max(correlation(residual), courses.correlated[name])
            for name, r, residual in courses.lines(centre_s, window_s)
            if r > 0.0
        }

        tried = np.linspace(centre_s - half_s, centre_s + half_s, NUM_TRIED)
        found = search_offset(partial(_log_likelihood, courses, window_s, weight), tried)
        is_inside = abs(found.mean_s - centre_s) < 0.9 * half_s
        if (is_inside and MIN_RANGE_SD * found.sd_s <= half_s) or half_s >= limit_s:
            return found.mean_s, found.sd_s
        centre_s, half_s = found.mean_s, 2.0 * half_s


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
    if _line(a, b) is None:
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
    """How the clocks of two records stand to each other."""

    offset_s: float  # What is added to the reference's clock to give the test's [s].
    # Standard uncertainty [s]: of the fit, and of where in its interval a logger stamps; 0 where
    # the offset was given.
    sd_s: float
    method: str  # How it was found.
    findings: tuple[Finding, ...] = ()  # Doubts about it.


def find_offset(test: Record, reference: Record, channels: Sequence[str]) -> Offset:
    r"""Find the offset of the reference's clock to the test's.

    The score at an offset is the mean over the signals of $-\tfrac12\ln(1 - r^2)$, the gain in log
    likelihood per sample of a straight line over a constant; correlations below 0 count as 0.

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
    offset_s, fit_sd_s = _refined(test, reference, channels, start_s, grid_s)
    found = _likeness(test, reference, channels, offset_s)
    most = max(found.values(), default=0.0)
    if most < MIN_CORRELATION:
        raise InputError(
            "Expected two records of one manoeuvre; at the best offset their most similar signal "
            f"correlates by {most:.2f} (at least {MIN_CORRELATION:.2f} are needed), over "
            f"{', '.join(channels)}.",
            where=where,
            remedy="Are they of one manoeuvre? If so, give --offset SECONDS.",
        )
    sd_s = float(np.hypot(fit_sd_s, stamp_sd_s(*steps_s)))
    return Offset(
        offset_s=offset_s,
        sd_s=sd_s,
        method=f"shared signals: {', '.join(found)}",
        findings=tuple(_doubts(where, test.name, offset_s, sd_s, offsets_s, scores)),
    )


def _search(
    test: Record,
    reference: Record,
    channels: Sequence[str],
    grid_s: float,
    spans_s: Sequence[float],
) -> tuple[np.ndarray, np.ndarray]:
    """Offsets on a grid with enough overlap, and their scores."""
    pairs = [(_even(test, c, grid_s), _even(reference, c, grid_s)) for c in channels]
    num_test, num_reference = (int(span / grid_s + 1e-9) + 1 for span in spans_s)
    needed = max(3, int(MIN_OVERLAP * min(num_test, num_reference)))
    lags = range(needed - num_reference, num_test - needed + 1)

    def score(ours: np.ndarray, theirs: np.ndarray, lag: int) -> float:
        first, last = max(lag, 0), min(ours.size, theirs.size + lag)
        line = _line(ours[first:last], theirs[first - lag : last - lag])
        return _score(line[0]) if line else 0.0

    scores = [np.mean([score(a, b, lag) for a, b in pairs]) for lag in lags]
    return np.array(lags) * grid_s, np.array(scores)


def _even(record: Record, channel: str, grid_s: float) -> np.ndarray:
    """A signal on an even grid from the record's first sample; NaN outside its samples."""
    all_s = samples(record)[0]
    grid = np.arange(all_s[0], all_s[-1] + 1e-9 * grid_s, grid_s)
    return np.interp(grid, *samples(record, channel), left=np.nan, right=np.nan)


def _doubts(
    where: str, test: str, offset_s: float, sd_s: float, offsets_s: np.ndarray, scores: np.ndarray
) -> Iterator[Finding]:
    """Warn of another offset, apart from the best, that fits nearly as well, and of a wide one."""
    best = int(np.argmax(scores))
    low = np.flatnonzero(scores < LEFT_SHARE * scores[best])
    left = low[low < best].max(initial=-1)
    right = low[low > best].min(initial=scores.size)
    outside = np.r_[scores[: left + 1], np.full(right - left - 1, -np.inf), scores[right:]]
    rival = int(np.argmax(outside))
    if outside[rival] >= RIVAL_SHARE * scores[best]:
        yield Finding(
            "offset_ambiguous",
            "warning",
            f"Expected one offset; {offsets_s[rival]:+.1f} s fits nearly as well as "
            f"{offset_s:+.1f} s: the manoeuvre repeats.",
            where,
            "Give --offset SECONDS if you know it.",
            test,
            {"rival_s": float(offsets_s[rival])},
        )
    if sd_s > MAX_SD_S:
        yield Finding(
            "offset_uncertain",
            "warning",
            f"Expected an offset known to {MAX_SD_S:.0f} s; its standard uncertainty is {sd_s:.1f} "
            "s, since no shared signal changes sharply.",
            where,
            "Give --offset SECONDS if you know it, or record a step in both.",
            test,
            {"sd_s": sd_s},
        )
