"""How alike two signals are under an offset of their clocks, whatever their bias and scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from heatrun.bench.checks.samples import samples
from heatrun.bench.record import Record

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
