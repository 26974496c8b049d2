"""How the values of a column run, before anybody has said what the column is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SPIKES = 0.01
"""Share of the samples at either end that a course is told without: a loose contact is none."""


@dataclass(frozen=True)
class Course:
    """The course of one column, in the unit of the file.

    Attributes:
        low: Value that 99 % of the samples exceed.
        high: Value that 1 % of the samples exceed.
        mean: Mean of the samples.
        is_growing: No sample is smaller than the one before it, and the last exceeds the first.
    """

    low: float
    high: float
    mean: float
    is_growing: bool = False

    def converted(self, factor: float, offset: float) -> Course:
        """Return the course in another unit: `factor * value + offset`.

        Args:
            factor: New units per old unit, positive.
            offset: In the new unit.
        """
        low, high, mean = (factor * value + offset for value in (self.low, self.high, self.mean))
        return Course(low, high, mean, self.is_growing)


def course_of(values: np.ndarray) -> Course | None:
    """Return the course of a column, None without a value.

    Args:
        values: Finite, in the unit of the file, shape (time,).
    """
    if values.size == 0:
        return None
    low, high = np.quantile(values, (SPIKES, 1.0 - SPIKES))
    is_growing = bool(values[-1] > values[0] and np.all(np.diff(values) >= 0.0))
    return Course(float(low), float(high), float(np.mean(values)), is_growing)
