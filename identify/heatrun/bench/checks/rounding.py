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


def rounding_step(values: np.ndarray) -> float | None:
    """Return the step that values were rounded to, or None if they do not lie on a grid.

    The offset of the grid does not matter, so kelvin rounded to 1 K and then converted is found
    too.

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
        return None
    # Not the minimum: one interpolated sample would then set the step.
    step = float(np.quantile(changes, 0.02, method="lower"))
    multiples = changes / step
    on_grid = np.abs(multiples - np.round(multiples)) < MULTIPLE_TOLERANCE
    return step if float(np.mean(on_grid)) >= ON_GRID_SHARE else None
