"""Channels of different rates on one time axis: means around each instant of a raster.

A sample of a record is an instant; whoever reads the record joins the samples by straight lines.
A faster channel is therefore brought to a slower raster by the mean over the interval *centred*
on each instant. The sample nearest to the left would shift the channel by half a step and pick
one value of many; a mean over the interval that follows would shift it too.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from .samples import integral

LONGEST_GAP = 10.0
"""Samples further apart than this many median steps [1] are not joined by a straight line: there
the logger paused, and what lies between is not known."""

LEAST_COVERED = 0.5
"""A mean needs samples over this share of its interval [1]; the first and the last interval of a
test reach beyond it by one half."""

ROUNDING = 1e-6
"""Slack of that share [1]: times are sums of rounded steps."""


def median_step_s(time_s: np.ndarray) -> float:
    """Return the median distance of neighbouring samples [s]; 0 for fewer than two.

    Args:
        time_s: Times [s], shape (time,).
    """
    return float(np.median(np.diff(time_s))) if time_s.size > 1 else 0.0


def require_increasing(time_s: np.ndarray, where: str) -> None:
    """Check that times increase, without which nothing can be averaged over them.

    Args:
        time_s: Times [s], shape (time,).
        where: File and channel, for the message.

    Raises:
        InputError: Naming the first time that is missing, repeated or goes back.
    """
    if not np.isfinite(time_s).all():
        first = int(np.flatnonzero(~np.isfinite(time_s))[0])
        raise InputError(
            f"Expected a time for each sample, sample {first + 1} has none.",
            where=where,
            remedy="Export the recording again.",
        )
    back = np.flatnonzero(np.diff(time_s) <= 0.0)
    if back.size:
        at = time_s[back[0]]
        raise InputError(
            f"Channels of different rates need a time that increases; after {at:.9g} s comes "
            f"{time_s[back[0] + 1]:.9g} s.",
            where=where,
            remedy="Split the recording there.",
        )


def raster(time_s: np.ndarray, step_s: float) -> np.ndarray:
    """Return instants of equal step [s] from the first to the last of some times.

    Args:
        time_s: Increasing times [s], shape (time,).
        step_s: Distance of the instants [s].
    """
    num_steps = int(np.floor((time_s[-1] - time_s[0]) / step_s + ROUNDING))
    return time_s[0] + step_s * np.arange(num_steps + 1)


def means_around(
    time_s: np.ndarray, values: np.ndarray, at_s: np.ndarray, *, is_rms: bool = False
) -> np.ndarray:
    """Return the mean of a channel around each instant of a raster.

    The interval of an instant ends half-way to its neighbours. The course between two samples is
    a straight line (of the squares, for a root mean square); a missing sample and a pause of the
    logger count as not covered.

    Args:
        time_s: Increasing times of the samples [s], shape (time,).
        values: The samples, NaN where missing, shape (time,).
        at_s: Increasing instants [s], shape (instant,).
        is_rms: Average the squares and take the root, as for a current that heats.

    Returns:
        Shape (instant,); NaN where samples cover less than half of the interval.
    """
    if time_s.size < 2 or at_s.size < 2:
        return np.interp(at_s, time_s, values) if np.array_equal(time_s, at_s) else _lone(at_s)
    # A damaged number may be too large to be squared or summed; its mean is then missing.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        middle = 0.5 * (at_s[1:] + at_s[:-1])
        edges = np.concatenate([[2 * at_s[0] - middle[0]], middle, [2 * at_s[-1] - middle[-1]]])
        inside = np.clip(edges, time_s[0], time_s[-1])
        knots = np.union1d(time_s, inside)
        at_edges = np.searchsorted(knots, inside)
        course = np.where(np.isfinite(values), values, 0.0)
        at_knots = np.interp(knots, time_s, course**2 if is_rms else course)
        length = np.diff(knots) * _is_covered(time_s, values)[_piece(time_s, knots)]
        covered = np.concatenate([[0.0], np.cumsum(length)])
        area = integral(at_knots, length)
        share = np.diff(covered[at_edges])
        mean = np.diff(area[at_edges]) / share
        if is_rms:
            mean = np.sqrt(np.maximum(mean, 0.0))
        is_known = share >= (LEAST_COVERED - ROUNDING) * np.diff(edges)
        return np.where(is_known & np.isfinite(mean), mean, np.nan)


def _is_covered(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return which straight lines between two samples are known, shape (time - 1,)."""
    is_known = np.isfinite(values)
    is_near = np.diff(time_s) <= LONGEST_GAP * median_step_s(time_s)
    return is_known[1:] & is_known[:-1] & is_near


def _piece(time_s: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Return on which of those lines the course between two knots lies, shape (knot - 1,)."""
    return np.clip(np.searchsorted(time_s, knots[1:], side="left") - 1, 0, time_s.size - 2)


def _lone(at_s: np.ndarray) -> np.ndarray:
    return np.full(at_s.size, np.nan)
