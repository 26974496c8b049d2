"""Time axes: freed from rounding, and channels of different rates brought to one.

Channels of different rates on one time axis are means around each instant of a raster.
A sample of a record is an instant; whoever reads the record joins the samples by straight lines.
A faster channel is therefore brought to a slower raster by the mean over the interval *centred*
on each instant. The sample nearest to the left would shift the channel by half a step and pick
one value of many; a mean over the interval that follows would shift it too.

Exports of MDF, of data bases and of ROS write tables on all time stamps of channels of different
rates, whose cells in between are empty. Each channel then has a rate of its own, as in a
measurement file: what drives the model is interpolated linearly, readings stay as they are.

A time axis counts from the first sample, and is freed from the rounding of 32-bit loggers.
"""

from collections.abc import Mapping

import numpy as np

from ..errors import InputError
from .channels import READINGS
from .record import Finding
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
    """Return the median distance of neighbouring samples [s]; 0 for fewer than two."""
    return float(np.median(np.diff(time_s))) if time_s.size > 1 else 0.0


def require_increasing(time_s: np.ndarray, where: str) -> None:
    """Check that times [s] increase, without which nothing can be averaged over them.

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
    """Return instants of equal step [s] from the first to the last of some times [s]."""
    num_steps = int(np.floor((time_s[-1] - time_s[0]) / step_s + ROUNDING))
    return time_s[0] + step_s * np.arange(num_steps + 1)


def means_around(
    time_s: np.ndarray, values: np.ndarray, at_s: np.ndarray, *, is_rms: bool = False
) -> np.ndarray:
    """Return the mean of a channel around each instant of a raster, shape (instant,).

    The interval of an instant ends half-way to its neighbours. The course between two samples is
    a straight line (of the squares, for a root mean square); a missing sample and a pause of the
    logger count as not covered. NaN where samples cover less than half of the interval.

    Args:
        time_s: Increasing times of the samples [s], shape (time,).
        values: The samples, NaN where missing, shape (time,).
        at_s: Increasing instants [s], shape (instant,).
        is_rms: Average the squares and take the root, as for a current that heats.
    """
    if time_s.size < 2 or at_s.size < 2:
        return values if np.array_equal(time_s, at_s) else np.full(at_s.size, np.nan)
    # A damaged number may be too large to be squared or summed; its mean is then missing.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        middle = 0.5 * (at_s[1:] + at_s[:-1])
        edges = np.concatenate([[2 * at_s[0] - middle[0]], middle, [2 * at_s[-1] - middle[-1]]])
        inside = np.clip(edges, time_s[0], time_s[-1])
        knots = np.union1d(time_s, inside)
        at_edges = np.searchsorted(knots, inside)
        course = np.where(np.isfinite(values), values, 0.0)
        at_knots = np.interp(knots, time_s, course**2 if is_rms else course)
        known = np.isfinite(values)
        is_covered = known[1:] & known[:-1]
        is_covered &= np.diff(time_s) <= LONGEST_GAP * median_step_s(time_s)
        # the line between two samples on which the course between two knots lies
        line = np.clip(np.searchsorted(time_s, knots[1:]) - 1, 0, time_s.size - 2)
        length = np.diff(knots) * is_covered[line]
        covered = np.concatenate([[0.0], np.cumsum(length)])
        area = integral(at_knots, length)
        share = np.diff(covered[at_edges])
        mean = np.diff(area[at_edges]) / share
        if is_rms:
            mean = np.sqrt(np.maximum(mean, 0.0))
        is_known = share >= (LEAST_COVERED - ROUNDING) * np.diff(edges)
        return np.where(is_known & np.isfinite(mean), mean, np.nan)


LEAST_SAMPLES = 3
"""Fewer have no rate."""


def own_step(values: np.ndarray) -> int:
    """Return how many rows usually lie from a sample to the next; 1 for a channel of every row.

    Where every second cell or more is empty, that is the rate of the channel; a sensor that fails
    for a while leaves its samples next to each other. Empty cells are NaN, shape (time,).
    """
    rows = np.flatnonzero(np.isfinite(values))
    return int(np.median(np.diff(rows))) if rows.size >= LEAST_SAMPLES else 1


def between_samples(values: np.ndarray) -> np.ndarray:
    """Return which empty cells (NaN) lie between samples of a channel's own rate, shape (time,)."""
    known = np.isfinite(values)
    step = own_step(values)
    if step == 1:
        return np.zeros(values.size, dtype=bool)
    rows = np.concatenate(([-1], np.flatnonzero(known), [values.size]))
    after = np.searchsorted(rows, np.arange(values.size))
    return ~known & (rows[after] - rows[after - 1] < 1.5 * step + 1)


def at_own_rates(
    channels: Mapping[str, np.ndarray], where: str, *, is_by_tag: bool = False
) -> tuple[dict[str, np.ndarray], tuple[Finding, ...]]:
    """Return channels without empty cells where their own rate left these, and a note for each.

    Rows that hold samples of slower inputs alone are dropped once these are interpolated. Channels,
    with `time_s`, are NaN where empty, shape (time,); by tag, each has times of its own, near to
    those of the others.
    """
    channels = {
        name: _without_repeats(values) if name.endswith("_degC") else values
        for name, values in _merged(channels).items()
    }
    time_s = channels["time_s"]
    held = {name: np.isfinite(values) for name, values in channels.items() if name != "time_s"}
    slow = {name for name in held if own_step(channels[name]) > 1}
    slow |= {name for name in held if is_by_tag and not held[name].all()}
    if not slow or not (np.diff(time_s[np.isfinite(time_s)]) > 0.0).all():
        return dict(channels), ()
    nothing = np.zeros(time_s.size, dtype=bool)
    read = np.logical_or.reduce([nothing, *(held[name] for name in held if name in READINGS)])
    dense = np.logical_or.reduce([nothing, *(held[name] for name in held if name not in slow)])
    filled, findings = dict(channels), []
    for name in (one for one in held if one not in READINGS):
        empty = np.isfinite(time_s) if name in slow else read & ~dense
        empty &= ~held[name]
        known = held[name] & np.isfinite(time_s)
        if not empty.any() or known.sum() < LEAST_SAMPLES:
            continue
        step_s = float(np.median(np.diff(time_s[known])))
        at, values = time_s[known], channels[name][known]
        after = np.clip(np.searchsorted(at, time_s[empty]), 1, at.size - 1)
        is_near = (at[after] - at[after - 1] <= LONGEST_GAP * step_s) & (
            np.abs(time_s[empty] - np.clip(time_s[empty], at[0], at[-1])) <= step_s
        )
        filled[name] = channels[name].copy()
        filled[name][empty] = np.where(is_near, np.interp(time_s[empty], at, values), np.nan)
        if name in slow:
            message = (
                f"{int(empty.sum())} of {time_s.size} cells are empty, since the channel comes "
            )
            message += f"every {step_s:g} s alone: values in between are interpolated linearly."
            at, remedy = f"{where}, {name}", "Nothing need be done."
            values = {"step_s": step_s}
            findings.append(Finding("raster_joined", "note", message, at, remedy, values=values))
    kept = read | dense if dense.any() or (is_by_tag and read.any()) else ~nothing
    return {name: values[kept] for name, values in filled.items()}, tuple(findings)


def _without_repeats(values: np.ndarray) -> np.ndarray:
    """Return a temperature without what a logger repeats of it until its next sample comes.

    So it is where it changes after the same number of rows each time; a reading that stands still
    because it is rounded does not.
    """
    comes = np.flatnonzero(np.diff(values) != 0.0) + 1
    if comes.size < FEWEST_REPEATED or not np.isfinite(values).all():
        return values
    lasts = np.diff(comes)
    step = int(np.median(lasts))
    times = np.round(lasts / max(step, 1))
    jitter = 1 if step >= FEWEST_REPEATED // 2 else 0
    is_regular = np.all(np.abs(lasts - times * step) <= jitter) and np.mean(times == 1.0) > 0.5
    if step < 3 or not is_regular:
        return values
    kept = np.full(values.size, np.nan)
    kept[comes] = values[comes]
    kept[0] = values[0]
    return kept


def _merged(channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return channels with one row for each time stamp, where no two rows of it fill one cell."""
    steps = np.diff(channels["time_s"])
    starts = np.concatenate(([0], np.flatnonzero(steps != 0.0) + 1))
    if starts.size > steps.size or not (steps >= 0.0).all():
        return dict(channels)
    held = [np.isfinite(values) for name, values in channels.items() if name != "time_s"]
    if any((np.add.reduceat(one.astype(int), starts) > 1).any() for one in held):
        return dict(channels)
    return {name: np.fmax.reduceat(values, starts) for name, values in channels.items()}


FEWEST_REPEATED = 20
"""Samples of a reading that show that it is repeated in between."""

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

    A time that is infinite, or so far off that the difference is, counts as missing. Not all may
    be.
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
    """Return the regular grid [s] that times [s] were rounded from, and a note if they move.

    Loggers that keep time as a 32-bit number write 0.100000143 and 0.200000048 for a step of
    0.1 s. The step is taken as the shortest decimal that explains every sample to the rounding
    of such a number; samples that are missing on the grid or come twice stay so. Times, counted
    from the first sample, stay as they are where they are exact already, where no step explains
    all of them or where the rounding is no small part of the step.
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
