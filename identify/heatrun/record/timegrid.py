"""The time axis: from the first sample, and freed from the rounding of 32-bit loggers."""

from __future__ import annotations

import numpy as np

FLOAT32_ULPS = 2.0
"""Clock and start time are each rounded by half an ulp; their difference carries both, and so
does a step that was itself computed from rounded times."""

CLOCK_RESOLUTION_S = 1e-6
"""A deviation that no thermal record can tell from none [s]: 1 microsecond."""

MOST_DECIMALS = 6
LONGEST_TEST_S = 1e9
"""A time beyond 30 years [s] is no time of a test, and 32 bits could not hold its steps."""

LARGEST_SHARE_OF_STEP = 0.05
"""Rounding beyond this share of a step could hide true jitter: then the times stay as they are."""


def from_first_sample(time_s: np.ndarray) -> tuple[np.ndarray, float, str]:
    """Return times counted from the first finite one [s], that one [s], and a note on lost ones.

    A time that is infinite, or so far off that the difference is, counts as missing.

    Args:
        time_s: Times [s], shape (time,); not all NaN.
    """
    start = float(time_s[np.flatnonzero(np.isfinite(time_s))[0]])
    with np.errstate(over="ignore"):
        moved = time_s - start
    absurd = np.isinf(moved)
    note = f"{int(absurd.sum())} times are too large for a number and count as missing."
    return np.where(absurd, np.nan, moved), start, note if absurd.any() else ""


def counted_from(origin_s: float) -> str:
    """Return the note on times that count from a first sample at `origin_s` in the file."""
    return f"time_s counts from the first sample, at {origin_s:.9g} s in the file."


def exact_grid(time_s: np.ndarray) -> tuple[np.ndarray, str]:
    """Return the regular grid that times were rounded from, and a note if they move.

    Loggers that keep time as a 32-bit number write 0.100000143 and 0.200000048 for a step of
    0.1 s. The step is taken as the shortest decimal that explains every sample to the rounding
    of such a number; samples that are missing on the grid or come twice stay so.

    Args:
        time_s: Times from the first sample [s], shape (time,).

    Returns:
        The times unchanged and an empty note where they are exact already, where no step
        explains all of them or where the rounding is no small part of the step.
    """
    largest = float(np.max(np.abs(time_s), initial=0.0))
    if time_s.size < 3 or not largest < LONGEST_TEST_S:  # also where a time is missing
        return time_s, ""
    ulp = float(np.spacing(np.float32(largest)))
    tolerance = max(FLOAT32_ULPS * ulp, CLOCK_RESOLUTION_S)
    steps = np.diff(time_s)
    if tolerance > LARGEST_SHARE_OF_STEP * np.median(steps):
        return time_s, ""
    # Steps are counted one by one: a median step off by 1e-3 would miscount thousands of them.
    index = np.concatenate(([0.0], np.cumsum(np.round(steps / np.median(steps)))))
    if index[-1] <= 0:
        return time_s, ""
    step = time_s[-1] / index[-1]
    for decimals in range(MOST_DECIMALS + 1):
        candidate = round(float(step), decimals)
        grid = np.round(index * candidate, decimals)
        deviation = float(np.max(np.abs(time_s - grid)))
        if candidate > 0 and deviation <= tolerance:
            if deviation <= 1e-12 * largest:  # the rounding of a double: exact already
                return time_s, ""
            return grid, (
                f"time_s lies on a grid of {candidate:g} s to {deviation:.2g} s, the rounding of "
                "a 32-bit clock; the exact grid is used."
            )
    return time_s, ""
