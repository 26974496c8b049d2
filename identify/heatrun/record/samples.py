"""The samples of a record that a check can reason on, and how a place in it is named.

Every check must stand any record: full of NaN, empty, with a clock that runs backwards. They all
read the record through `samples`, which leaves out what carries no measurement; that something is
left out is itself reported, by `nan_block` and by the checks of the time axis.

The step that a channel was rounded to is read off its samples too.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from .channels import CHANNEL
from .motor import Motor
from .record import Finding, Record
from .stretch import runs as runs

BEYOND_MEASURE = 1e12
"""No channel of a motor bench reaches this in its unit; what does is an overflow, not a value."""

LOADED_SHARE = 0.05
"""Heat flows where the losses exceed this share of their peak [1]: above what a power meter shows
at rest, below the no-load losses of any machine."""


BLOCK_S = 20.0
"""Length of a block [s]: long enough that rounding and sampling are averaged out, short against
the fast time constant of a traction motor (60...150 s)."""

SLOW_LOGGER_S = 1.0
"""From this sampling period on the moment of a load step counts as unknown [s]: half of it is half
a per cent of a winding's time constant, half of what Ceq_w of a good test is known to."""

START_S = 2.0
"""A winding under full load moves about 2 K in its first second at most, and less than 0.5 K as a
rule; the first 2 s therefore still show the start where a record begins with the load already
on."""

EQUILIBRIUM_K = 2.0
"""Two sensors of a bench agree to about 1 K each; a larger difference is heat left in the
machine."""


def sink_channel(motor: Motor) -> str:
    """Return the channel that is the temperature T0 [degC] which the stator loses its heat to."""
    return "coolant_degC" if motor.sink == "coolant" else "ambient_degC"


def needed_channels(record: Record, motor: Motor) -> tuple[str, ...]:
    """Return the channels of a record that a fit needs, `time_s` first.

    Under a measured balance a network of one node needs no current: one that is not there is asked
    for by the network.
    """
    needed = ("time_s", "phase_current_A", "losses_W", sink_channel(motor), "winding_degC")
    is_asked = motor.losses == "map" or "phase_current_A" in record
    return needed if is_asked else tuple(name for name in needed if name != "phase_current_A")


def require(record: Record, channels: Iterable[str]) -> None:
    """Check that a record has channels.

    Raises:
        InputError: Naming the missing channels, what the file has and how to map them.
    """
    missing = [CHANNEL[name] for name in channels if name not in record]
    if missing:
        told = ", ".join(f"{one.name} ({one.meaning})" for one in missing)
        raise InputError(
            f"Missing: {told}. The file gives {', '.join(record.channels)}; not used: "
            f"{', '.join(record.unused) or 'nothing'}.",
            where=record.name,
            remedy="Map each in the motor file: [columns] "
            f'{missing[0].name} = "COLUMN [{missing[0].unit}]".',
        )


def is_measured(values: np.ndarray) -> np.ndarray:
    """Return which samples hold a number that can be a measurement, shape (time,)."""
    return np.abs(values) < BEYOND_MEASURE


def samples(record: Record, *channels: str) -> tuple[np.ndarray, ...]:
    """Return time and channels where all of them are measured and time increases.

    Time [s] and each channel in its unit have the shape (usable,), and are all empty if a channel
    is missing.
    """
    if not all(channel in record for channel in channels):
        return (np.empty(0),) * (len(channels) + 1)
    columns = [np.asarray(record[channel], dtype=float) for channel in ("time_s", *channels)]
    kept = np.logical_and.reduce([is_measured(column) for column in columns])
    columns = _only(columns, kept)
    latest = np.maximum.accumulate(columns[0])
    increasing = np.ones(latest.size, dtype=bool)
    increasing[1:] = columns[0][1:] > latest[:-1]
    return tuple(_only(columns, increasing))


def _only(columns: list[np.ndarray], kept: np.ndarray) -> list[np.ndarray]:
    """Return the rows of columns that are kept, without a copy where these are all."""
    return columns if kept.all() else [column[kept] for column in columns]


def median_step(time_s: np.ndarray) -> float:
    """Return the usual distance between two samples [s]; NaN with fewer than two."""
    return float(np.median(np.diff(time_s))) if time_s.size > 1 else float("nan")


def has(record: Record, *channels: str) -> bool:
    """Return whether a record holds a measured sample, with a time, of each channel."""
    return all(samples(record, channel)[0].size > 0 for channel in channels)


def block_means(
    time_s: np.ndarray, width_s: float, *channels: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return mean time and mean of each channel over blocks of equal width that hold samples.

    Times [s] increase; they and the channels have shape (usable,), the means shape (blocks,).
    """
    if time_s.size == 0:
        return (np.empty(0),) * (len(channels) + 1)
    block = np.floor((time_s - time_s[0]) / width_s)
    first = np.concatenate(([0], np.flatnonzero(np.diff(block)) + 1))
    counts = np.diff(np.append(first, time_s.size))
    return tuple(np.add.reduceat(values, first) / counts for values in (time_s, *channels))


def integral(values: np.ndarray, steps: np.ndarray | float) -> np.ndarray:
    """Return the integral from the first sample to each, straight in between; steps are in [s]."""
    return np.concatenate([[0.0], np.cumsum(0.5 * steps * (values[1:] + values[:-1]))])


def with_all_heat(record: Record, motor: Motor) -> Record:
    """Return the record with the copper loss in its losses, where they leave it out.

    At a constant resistance, or in proportion to the squared current where none is given: enough
    to tell load from rest.
    """
    names = ("losses_W", "phase_current_A")
    if motor.losses != "map" or not all(name in record for name in names):
        return record
    losses, current = (np.asarray(record[name], dtype=float) for name in names)
    if losses.shape != current.shape:
        return record
    with np.errstate(over="ignore", invalid="ignore"):
        total = losses + motor.phases * (motor.phase_resistance_ohm or 1.0) * current**2
    return record.having({"losses_W": total})


def is_loaded(losses_W: np.ndarray) -> np.ndarray:
    """Return where heat flows: losses above `LOADED_SHARE` of their peak, shape (time,)."""
    if losses_W.size == 0:
        return np.empty(0, dtype=bool)
    # The 99 % quantile: a single spike must not declare the whole test idle.
    peak = float(np.quantile(losses_W, 0.99))
    return (losses_W > LOADED_SHARE * peak) & (losses_W > 0.0)


def lead_in(time_s: np.ndarray, losses_W: np.ndarray) -> int:
    """Return how many samples at the start show the temperatures before heat has changed them.

    They are those before heat flows; where it flows from the first sample on, those of the first
    two seconds. Times [s] increase, shape (usable,), as the losses [W].
    """
    if time_s.size == 0:
        return 0
    loaded = is_loaded(losses_W)
    idle = int(np.argmax(loaded)) if loaded.any() else time_s.size
    return max(idle, int(np.searchsorted(time_s, time_s[0] + START_S)))


def place(record: Record, channel: str, from_s: float, to_s: float | None = None) -> str:
    """Return test, channel and time or time span in words."""
    moment = f"t = {from_s:.1f} s" if to_s is None else f"{from_s:.1f} s to {to_s:.1f} s"
    return ", ".join(part for part in (record.name, channel, moment) if part)


def channel_of(finding: Finding) -> str:
    """Return the channel that a finding is about, as `place` names it; empty if it names none."""
    return next((part for part in finding.where.split(", ") if part in CHANNEL), "")


MULTIPLE_TOLERANCE = 1e-3
"""A change counts as a whole number of steps within this share of a step [1]: far above what float
arithmetic leaves of a unit conversion, and met by chance by 0.2 % of unrounded changes only."""

ON_GRID_SHARE = 0.98
"""Share of changes that must be whole steps [1]; a few interpolated samples may be off the grid."""

MIN_CHANGES = 8
"""With fewer changes than this, whole multiples of the smallest one can be chance."""

FEW_CHANGES = 3
"""So few changes show a step where nearly all samples repeat the one before."""

REPEATS = 4
"""Samples for each change [1] from which on a record counts as repeating its values."""

SHORT = 10.0
"""Changes of fewer steps than this refine the step."""

LARGEST_DIVISOR = 20
"""The smallest change seen may be this many steps: noise of many steps rarely moves by one."""


def rounding_step(values: np.ndarray) -> float | None:
    """Return the step that values were rounded to, or None if they do not lie on a grid.

    The offset of the grid does not matter, so kelvin rounded to 1 K and then converted is found
    too, and so is any unit: 1 degF is a step of 5/9 K. Values, shape (time,), are without NaN.
    """
    if values.size < 2:
        return None
    changes = np.abs(np.diff(values))
    # Float subtraction leaves a dust of about 1e-16 of the value, which is no change.
    changes = changes[changes > 1e-9 * (1.0 + float(np.max(np.abs(values))))]
    if changes.size < MIN_CHANGES:
        return _repeated_step(changes, values.size)
    # Not the minimum: one interpolated sample would then set the step.
    smallest = float(np.quantile(changes, 0.02, method="lower"))
    for divisor in range(1, LARGEST_DIVISOR + 1):
        step = _refined(changes, smallest / divisor)
        if _share_on_grid(changes, step) >= ON_GRID_SHARE:
            return step
    return None


def _repeated_step(changes: np.ndarray, num_values: int) -> float | None:
    """Return the step of a record that keeps its value for most of the time, or None."""
    if changes.size < FEW_CHANGES or num_values < REPEATS * changes.size:
        return None
    step = float(np.min(changes))
    # most changes are one step: jumps of a failing sensor are not alike
    is_step = np.median(changes) < (1.0 + MULTIPLE_TOLERANCE) * step
    return step if is_step and _share_on_grid(changes, step) == 1.0 else None


def _refined(changes: np.ndarray, step: float) -> float:
    """Return the step that short changes agree on: one change carries the dust of its float."""
    near = changes[changes <= max(SHORT * step, float(np.min(changes)))]
    counts = np.round(near / step)
    if not np.any(counts > 0):
        return step  # only the dust of roundings elsewhere is as short
    return float(np.median(near[counts > 0] / counts[counts > 0]))


def _share_on_grid(changes: np.ndarray, step: float) -> float:
    multiples = changes / step
    return float(np.mean(np.abs(multiples - np.round(multiples)) < MULTIPLE_TOLERANCE))


NOISE_SIGMAS = 6.0
"""Gaussian noise exceeds six standard deviations once in 5e8 samples."""


def slack_K(values: np.ndarray) -> float:
    """Return what rounding and noise may move a reading from sample to sample [K]."""
    changes = np.diff(values)
    noise = 1.4826 * float(np.median(np.abs(changes - np.median(changes))))
    return 2.0 * (rounding_step(values) or 0.0) + NOISE_SIGMAS * noise


def leaps_K(
    time_s: np.ndarray, reading: np.ndarray, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far readings move within two samples beyond the slopes before and after, and
    beyond the mean of both [K].

    A load that steps between them changes the slope of a temperature, which then moves by something
    between the two, about their mean; a sensor that shifts moves at once.

    Args:
        time_s: Times of the samples [s].
        reading: Readings [degC].
        at: The sample before each step; two come before it and four after it.
    """
    before, moved, after = (reading[at + 2 * n] - reading[at + 2 * n - 2] for n in range(3))
    lasts_s = [time_s[at + 2 * n] - time_s[at + 2 * n - 2] for n in range(3)]
    by_slope = lasts_s[1] * np.sort([before / lasts_s[0], after / lasts_s[2]], axis=0)
    return moved - np.clip(moved, *by_slope), moved - np.mean(by_slope, axis=0)


STEPS_BY, STILL_BY = 0.2, 0.05
"""Of the largest current [1]: a step is more than the one, and what lies beside it less than the
other."""

LAWS = (0.0, 1.0, 2.0)
"""Exponents of the current by which a sensor's line may pick it up [1]."""

FEWEST_STEPS, ALIKE, MOSTLY = 3, 0.3, 0.8
"""Steps that tell it, one less where it goes up and down; of so many [1] the jump over the step of
the law agrees to this share [1]."""

MOST_LOADED = 0.99
"""Quantile of the current that counts as the largest [1]."""


class Pickup(NamedTuple):
    """What the line of the winding's sensor adds to its reading with the current."""

    rated_K: float  # At the largest current [K].
    exponent: float  # Of the current [1].
    largest_A: float  # The largest current, without an inrush [A].
    num_steps: int  # Load steps at which the reading jumps with it.
    span_s: tuple[float, float]  # Times about the first load step [s].


def pickup(record: Record, most_K_per_s: float = 0.0) -> Pickup | None:
    """Return what a reading picks up of the current; None where its samples show nothing.

    A body, however fast, moves after the load; this jumps with it. Means over blocks do not tell
    the two, samples do.

    Args:
        record: Any record.
        most_K_per_s: How fast a temperature may move by itself.
    """
    time_s, winding, current = samples(record, "winding_degC", "phase_current_A")
    if time_s.size < 10:
        return None
    largest_A = float(np.quantile(np.abs(current), MOST_LOADED))
    if not 0.0 < largest_A < np.inf:
        return None
    ratio = np.abs(current) / largest_A
    change = np.abs(np.diff(ratio))
    at = np.arange(2, time_s.size - 4)
    is_still = np.maximum(change[at - 1], change[at + 1]) < STILL_BY
    at = at[(change[at] > STEPS_BY) & is_still]
    if at.size < FEWEST_STEPS - 1:
        return None
    at_least, moved = leaps_K(time_s, winding, at)
    least_K = most_K_per_s * median_step(time_s) + slack_K(winding)
    tried = []
    for exponent in LAWS:
        of_law = _picked_up(ratio, exponent)
        steps = of_law[at + 1] - of_law[at]
        told = np.abs(steps) > STEPS_BY
        if not told.any() or abs(np.median(at_least[told] / steps[told])) <= least_K:
            continue
        jumps_K = moved[told] / steps[told]
        middle_K = float(np.median(jumps_K))
        is_alike = np.abs(jumps_K - middle_K) < ALIKE * abs(middle_K)
        num_ways = np.unique(np.sign(steps[told][is_alike])).size
        is_enough = np.sum(is_alike) + num_ways > FEWEST_STEPS
        if is_enough and np.sum(is_alike) >= MOSTLY * told.sum():
            scatter = float(np.median(np.abs(jumps_K - middle_K))) / abs(middle_K)
            tried.append((scatter, exponent, middle_K, int(np.sum(is_alike))))
    if not tried:
        return None
    _, exponent, rated_K, num_steps = min(tried)
    first, last = map(float, time_s[[at[0], at[0] + 2]])
    return Pickup(rated_K, exponent, largest_A, num_steps, (first, last))


def without_pickup(record: Record, finding: Finding) -> Record:
    """Return a record without what its winding's sensor picks up, as a finding has it."""
    ratio = np.abs(record["phase_current_A"]) / (finding.values["largest_A"] or 1.0)
    law = _picked_up(ratio, finding.values["exponent"] or 0.0)
    winding = record["winding_degC"] - (finding.values["rated_K"] or 0.0) * law
    return record.having({"winding_degC": winding})


def _picked_up(ratio: np.ndarray, exponent: float) -> np.ndarray:
    return np.where(ratio > STILL_BY, ratio**exponent, 0.0)
