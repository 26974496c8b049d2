"""How the clocks of two records of one manoeuvre stand to each other, by their shared signals.

`heatrun.bench.clocks.align` joins two loggers of one test that share no signal, by the winding's
answer to the drive. Two prototypes that drive one manoeuvre share most of their signals, so here
these are laid over each other: the offset is the one at which a straight line explains most of each
signal of one record by that of the other. A bias or a wrong scale therefore does not move it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heatrun.bench.checks.samples import median_step, samples
from heatrun.bench.record import Finding, Record
from heatrun.errors import InputError

from .likeness import even, likeness, overlap, pearson, score
from .refine_offset import refine

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
    it finds on a grid is refined by `heatrun_reports.analysis.refine_offset`.

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
