"""A reduced record: mean inputs on an even grid, block means to compare.

Two grids are nested. The *steps* (about 2 s) carry the simulation: over each, current squared,
losses and sink enter as means, so energy is conserved. The *blocks* (about 20 s) carry the
comparison: over each, the mean of the measured samples is set against the mean of the model at
the same sample times. Half a sample of misalignment between the two would look like a delay of
the sensor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from lptn import Inputs

BLOCK_S = 20.0
"""Length of a block [s]: long enough that rounding and sampling are averaged out, short against
the fast time constant of a traction motor (60...150 s)."""


SLOW_LOGGER_S = 1.0
"""From this sampling period on the moment of a load step counts as unknown [s]: half of it is half
a per cent of a winding's time constant, half of what Ceq_w of a good test is known to."""


class Logger(NamedTuple):
    """What a test's readings were recorded with: tests that agree in it share their noise.

    Attributes:
        sample_s: Sampling period to two digits [s].
        resolution_K: Resolution of the readings to two digits [K]; 0 if none is seen.
        sensor: Column of the file that holds the readings; empty where it is not known.
    """

    sample_s: float
    resolution_K: float
    sensor: str


@dataclass(frozen=True)
class Blocks:
    """A record, reduced.

    Attributes:
        name: Name of the test.
        inputs: Means over the steps, all of one length; shape (step,).
        measured: Mean of the readings of each block [degC], shape (block,); NaN without any.
        weight: Share of each step in the mean of its block [1], shape (block, step per block).
        position: Mean position of the samples within each step, 0 its start and 1 its end [1],
            shape (block, step per block).
        count: Readings per block, shape (block,).
        time: Mean time of the readings of each block [s], shape (block,).
        block_s: Length of a block [s].
        rounding_K: Resolution of the readings [K]; 0 if none is seen.
        start_degC: Mean reading over the first block's first few seconds [degC].
        start_slope: Trend of the reading over the first block [K/s].
        sample_s: Median sampling period [s].
        stator_start_degC: First measured temperature of the stator [degC], if there is one.
        sensor: Column of the file that holds the readings; empty where it is not known.
        first_s: Time on the record's own axis at which the grid begins [s].
        notes: Sentences on what was interpolated or held.
    """

    name: str
    inputs: Inputs
    measured: Float[np.ndarray, " block"]
    weight: Float[np.ndarray, "block step"]
    position: Float[np.ndarray, "block step"]
    count: Float[np.ndarray, " block"]
    time: Float[np.ndarray, " block"]
    block_s: float
    rounding_K: float
    start_degC: float
    start_slope: float
    sample_s: float
    stator_start_degC: float | None = None
    sensor: str = ""
    first_s: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def is_observed(self) -> np.ndarray:
        """Which blocks hold a reading, shape (block,)."""
        return self.count > 0

    @property
    def duration_s(self) -> float:
        """Length of the grid [s]."""
        return float(self.inputs.step) * self.inputs.num_time

    @property
    def logger(self) -> Logger:
        """What the readings were recorded with."""
        return Logger(float(f"{self.sample_s:.2g}"), float(f"{self.rounding_K:.2g}"), self.sensor)

    def observation(
        self, heat: Float[np.ndarray, "block column"] | None = None, noise_scale: float = 1.0
    ) -> Observation:
        """Return the arrays that the numerics need.

        A reading rounded to a step q errs by q^2/12; what does not average out of a block,
        because the temperature moves slowly, is left to the slow part of the noise.

        Args:
            heat: As `Observation.heat`; no columns by default.
            noise_scale: As `Observation.noise_scale`.
        """
        heat = np.zeros((self.measured.size, 0)) if heat is None else heat
        return Observation(
            inputs=self.inputs,
            measured=jnp.asarray(np.nan_to_num(self.measured)),
            is_observed=jnp.asarray(self.is_observed),
            weight=jnp.asarray(self.weight),
            position=jnp.asarray(self.position),
            count=jnp.asarray(self.count, dtype=float),
            rounding_variance=jnp.asarray(self.rounding_K**2 / 12.0 / np.maximum(self.count, 1.0)),
            block_s=jnp.asarray(self.block_s, dtype=float),
            heat=jnp.asarray(heat),
            noise_scale=jnp.asarray(noise_scale, dtype=float),
        )


class Observation(eqx.Module):
    """The arrays of a reduced record that the numerics need; a pytree.

    Attributes:
        inputs: Means over the steps.
        measured: Mean reading of each block [degC], shape (block,); 0 where there is none.
        is_observed: Which blocks hold a reading, shape (block,).
        weight: As `Blocks.weight`.
        position: As `Blocks.position`.
        count: As `Blocks.count`.
        rounding_variance: Variance of each block's mean from rounding [K^2], shape (block,).
        block_s: Length of a block [s].
        heat: What unmodelled heat with the standard deviation of the mean loss does to the block
            means [K], as columns whose outer product is its covariance, shape (block, column).
        noise_scale: Noise of the test's logger over that of the first one [1].
    """

    inputs: Inputs
    measured: Float[Array, " block"]
    is_observed: Bool[Array, " block"]
    weight: Float[Array, "block step"]
    position: Float[Array, "block step"]
    count: Float[Array, " block"]
    rounding_variance: Float[Array, " block"]
    block_s: Float[Array, ""]
    heat: Float[Array, "block column"]
    noise_scale: Float[Array, ""]
