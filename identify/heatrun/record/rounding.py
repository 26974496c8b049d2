"""The step that a channel was rounded to, read off its values."""

from __future__ import annotations

import numpy as np

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
    too, and so is any unit: 1 degF is a step of 5/9 K.

    Args:
        values: Measured values without NaN, shape (time,).

    Returns:
        Step in the unit of the values, or None.
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
