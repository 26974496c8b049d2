"""Short steps between the samples of a record, on which `lptn` simulates what a file holds."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

SHARE_OF_LONGEST = 0.02
"""Steps stay below this share of the longest that the method takes, about a hundredth of the
fastest time constant: means over a step then stand for straight lines to 1e-4 of a change."""


@dataclass(frozen=True)
class Grid:
    """Steps that split each interval between two samples evenly.

    Attributes:
        time: Time of the samples [s], shape (sample,).
        step: Length of the steps [s], shape (step,).
        first: Number of the edge at which each sample lies, shape (sample,).
        middle: Middle of the steps [s], shape (step,).
    """

    time: np.ndarray
    step: np.ndarray
    first: np.ndarray
    middle: np.ndarray

    @classmethod
    def of(cls, time: np.ndarray, longest: float) -> Grid:
        """Return the grid of a record.

        Args:
            time: Time of the samples [s], shape (sample,).
            longest: No step is longer than this [s].
        """
        interval = np.diff(time)
        parts = np.ceil(interval / longest).astype(int)
        step = np.repeat(interval / parts, parts)
        first = np.concatenate([[0], np.cumsum(parts)])
        inside = np.arange(step.size) - np.repeat(first[:-1], parts)
        middle = np.repeat(time[:-1], parts) + (inside + 0.5) * step
        return cls(time, step, first, middle)

    def mean(self, values: np.ndarray) -> jnp.ndarray:
        """Return the mean over each step of straight lines from sample to sample, (step,)."""
        return jnp.asarray(np.interp(self.middle, self.time, values.ravel()))


@dataclass(frozen=True)
class Held:
    """Steps over which the inputs are held, each split evenly.

    Attributes:
        step: Length of the parts [s], shape (part,).
        parts: Number of parts of a step.
    """

    step: np.ndarray
    parts: int

    def mean(self, values: np.ndarray) -> jnp.ndarray:
        """Return values of the steps, shape (step,), at the parts, shape (part,)."""
        return jnp.asarray(np.repeat(values, self.parts))
