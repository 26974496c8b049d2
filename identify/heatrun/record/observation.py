"""The arrays of a reduced record that the numerics need."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from lptn import Inputs
from lptn.inputs import SIGNALS

from .blocks import length_class, with_more

FEWEST_MOMENTS = 4
"""Columns of load steps at unknown moments that `Observation.padded` has at least, if any."""


class Observation(eqx.Module):
    """The arrays of a reduced record that the numerics need; a pytree."""

    inputs: Inputs  # Means over the steps.
    # Mean reading of each block [degC], shape (row,); 0 where there is none.
    measured: Float[Any, " row"]
    is_observed: Bool[Any, " row"]  # Which blocks hold a reading, shape (row,).
    weight: Float[Any, "row step"]  # As `Blocks.weight`.
    position: Float[Any, "row step"]  # As `Blocks.position`.
    count: Float[Any, " row"]  # As `Blocks.count`.
    known_variance: Float[Any, " row"]  # As `Blocks.known_variance`.
    block_s: Float[Any, ""]  # Length of a block [s].
    # What unmodelled heat with the standard deviation of the mean loss does to the block means [K],
    # as columns whose outer product is its covariance, shape (row, column).
    heat: Float[Any, "row column"]
    moments: Float[Any, "row moment"]  # As `Blocks.moments`.
    # Noise of the logger of each sensor over that of the first one [1], shape (sensor,).
    noise_scale: Float[Any, " sensor"]
    fitted: tuple[str, ...] = eqx.field(static=True, default=())  # As `Blocks.fitted`.

    @property
    def num_sensors(self) -> int:
        """Number of sensors, the winding's included."""
        return 1 + len(self.fitted)

    def padded(self, fewest: int = 0, *, is_seldom: bool = False) -> Observation:
        """Return it with blocks without readings up to the next `length_class`.

        The inputs are held there, so that an early reading sees past the end of the last block;
        columns of `moments` are filled up likewise, with zeros, which do nothing.
        """
        num, per_block = self.weight.shape[0] // self.num_sensors, self.weight.shape[1]
        whole = length_class(max(num, fewest), is_seldom=is_seldom)
        inputs = self.inputs
        held = {
            name: np.pad(np.asarray(values), (0, (whole - num) * per_block), mode="edge")
            for name in SIGNALS
            if (values := getattr(inputs, name)) is not None
        }

        def more(rows: Any, value: float | bool = 0.0) -> np.ndarray:
            return with_more(np.asarray(rows), self.num_sensors, whole, value)

        moments = more(self.moments)
        columns = moments.shape[1]
        if columns:
            columns = max(FEWEST_MOMENTS, length_class(columns, is_seldom=is_seldom))
        return replace(
            self,
            inputs=replace(inputs, **held),
            measured=more(self.measured),
            is_observed=more(self.is_observed, False),
            weight=more(self.weight),
            position=more(self.position, 0.5),
            count=more(self.count),
            known_variance=more(self.known_variance),
            heat=more(self.heat),
            moments=np.pad(moments, ((0, 0), (0, columns - moments.shape[1]))),
        )

    def simulated(self) -> Observation:
        """Return what a simulation needs of it: programs do not ask for the rest of the test."""
        nothing = np.zeros(0)
        return replace(
            self,
            measured=nothing,
            is_observed=nothing.astype(bool),
            count=nothing,
            known_variance=nothing,
            block_s=np.zeros(()),
            heat=np.zeros((0, 0)),
            moments=np.zeros((0, 0)),
            noise_scale=nothing,
        )

    def compared(self) -> Observation:
        """Return what the noise needs of it, likewise."""
        nothing = np.zeros(0)
        inputs = Inputs(step=np.zeros(()), current_squared=nothing, losses=nothing, ambient=nothing)
        return replace(self, inputs=inputs, weight=np.zeros((0, 0)), position=np.zeros((0, 0)))
