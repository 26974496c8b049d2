"""Means of the simulated reading over blocks of steps, without storing the steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .effects.base import AbstractEffect, SensorEffect
from .inputs import Inputs
from .losses import CopperLosses
from .march import prepare, sensed_march
from .network import Network
from .sensor import Sensor
from .simulate import reading


def block_means(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    weight: Float[Array, "block step"],
    position: Float[Array, "block step"],
    effects: Sequence[AbstractEffect] = (),
    sensor: Sensor = Sensor(),
) -> Float[Array, " block"]:
    """Return weighted means of the reading over blocks of steps [degC], shape (block,).

    As `reading` followed by a weighted mean, but the steps of a block stay in registers: over
    many parameter sets the temperatures would not fit the cache.

    Args:
        network: As `simulate`.
        losses: As `simulate`.
        inputs: As `simulate`; its intervals are the steps of all blocks in a row.
        start: As `simulate`.
        weight: Share of each step in the mean of its block [1].
        position: Where in each step the samples lie on average, 0 its start and 1 its end [1].
        effects: As `simulate`.
        sensor: As `simulate`.

    Raises:
        ValueError: As `reading`, and if the blocks do not hold the steps of `inputs`.
    """
    if weight.shape != position.shape or weight.size != inputs.num_time:
        raise ValueError(
            f"weight has shape {weight.shape} and position {position.shape}: expected both of "
            f"shape (block, step) with {inputs.num_time} steps in all, as `inputs` has."
        )
    if any(isinstance(effect, SensorEffect) for effect in effects):
        edges = reading(network, losses, inputs, start, effects=effects, sensor=sensor)
        before, after = edges[:-1].reshape(weight.shape), edges[1:].reshape(weight.shape)
        return jnp.sum(weight * (before + position * (after - before)), axis=1)

    network, full_start = prepare(network, losses, inputs, start, effects, sensor)
    first, advance, intervals = sensed_march(network, losses, inputs, full_start, effects, sensor)

    def add(state, x):
        before, total = state
        interval, share, place = x
        after = advance(before, interval)
        total = total + share * (before.reading + place * (after.reading - before.reading))
        return (after, total), None

    def block(before, x):
        (after, total), _ = jax.lax.scan(add, (before, jnp.zeros(())), x)
        return after, total

    rows = jax.tree.map(lambda values: values.reshape(*weight.shape), intervals)
    _, means = jax.lax.scan(block, first, (rows, weight, position))
    return means
