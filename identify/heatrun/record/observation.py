"""The arrays of a reduced record that the numerics need."""

from __future__ import annotations

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from lptn import Inputs

from .blocks import Blocks


class Observation(eqx.Module):
    """The arrays of a reduced record that the numerics need; a pytree.

    Attributes:
        inputs: Means over the steps.
        measured: Mean reading of each block [degC], shape (row,); 0 where there is none.
        is_observed: Which blocks hold a reading, shape (row,).
        weight: As `Blocks.weight`.
        position: As `Blocks.position`.
        count: As `Blocks.count`.
        known_variance: As `Blocks.known_variance`.
        block_s: Length of a block [s].
        heat: What unmodelled heat with the standard deviation of the mean loss does to the block
            means [K], as columns whose outer product is its covariance, shape (row, column).
        moments: As `Blocks.moments`.
        noise_scale: Noise of the logger of each sensor over that of the first one [1], shape
            (sensor,).
        fitted: As `Blocks.fitted`.
    """

    inputs: Inputs
    measured: Float[Array, " row"]
    is_observed: Bool[Array, " row"]
    weight: Float[Array, "row step"]
    position: Float[Array, "row step"]
    count: Float[Array, " row"]
    known_variance: Float[Array, " row"]
    block_s: Float[Array, ""]
    heat: Float[Array, "row column"]
    moments: Float[Array, "row moment"]
    noise_scale: Float[Array, " sensor"]
    fitted: tuple[str, ...] = eqx.field(static=True, default=())

    @property
    def num_sensors(self) -> int:
        """Number of sensors, the winding's included."""
        return 1 + len(self.fitted)

    @classmethod
    def of(
        cls,
        test: Blocks,
        heat: Float[np.ndarray, "row column"] | None,
        noise_scale: Sequence[float] | None,
    ) -> Observation:
        """Return the arrays of a reduced record; arguments as `Blocks.observation`."""
        heat = np.zeros((test.measured.size, 0)) if heat is None else heat
        scale = np.ones(1 + len(test.fitted)) if noise_scale is None else np.array(noise_scale)
        return cls(
            inputs=test.inputs,
            measured=jnp.asarray(np.nan_to_num(test.measured)),
            is_observed=jnp.asarray(test.is_observed),
            weight=jnp.asarray(test.weight),
            position=jnp.asarray(test.position),
            count=jnp.asarray(test.count, dtype=float),
            known_variance=jnp.asarray(test.known_variance),
            block_s=jnp.asarray(test.block_s, dtype=float),
            heat=jnp.asarray(heat),
            moments=jnp.asarray(test.moments),
            noise_scale=jnp.asarray(scale, dtype=float),
            fitted=test.fitted,
        )
