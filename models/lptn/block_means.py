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
from .simulate import readings


def block_means(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    weight: Float[Array, "row step"],
    position: Float[Array, "row step"],
    effects: Sequence[AbstractEffect] = (),
    sensor: Sensor = Sensor(),
    also: Sequence[Sensor] = (),
) -> Float[Array, " row"]:
    """Return weighted means of the reading over blocks of steps [degC], shape (row,).

    As `reading` followed by a weighted mean, but the steps of a block stay in registers: over
    many parameter sets the temperatures would not fit the cache. There is a row for each block, or
    for each block of `sensor` and then of each further sensor.

    Args:
        network: As `simulate`.
        losses: As `simulate`.
        inputs: As `simulate`; its intervals are the steps of all blocks in a row.
        start: As `simulate`.
        weight: Share of each step in the mean of its block [1].
        position: Where in each step the samples lie on average, 0 its start and 1 its end [1].
        effects: As `simulate`.
        sensor: As `simulate`.
        also: Further sensors; effects on the reading do not concern them.

    Raises:
        ValueError: As `reading`, and if the blocks do not hold the steps of `inputs`.
    """
    num = 1 + len(also)
    if weight.shape != position.shape or weight.size != num * inputs.num_time:
        raise ValueError(
            f"weight has shape {weight.shape} and position {position.shape}: expected both of "
            f"shape (row, step) with {num * inputs.num_time} steps in all: those of `inputs` for "
            "each sensor."
        )
    if any(isinstance(effect, SensorEffect) for effect in effects):
        edges = readings(network, losses, inputs, start, effects=effects, sensor=sensor, also=also)
        before, after = edges[:, :-1].reshape(weight.shape), edges[:, 1:].reshape(weight.shape)
        return jnp.sum(weight * (before + position * (after - before)), axis=1)

    network, full_start = prepare(network, losses, inputs, start, effects, (sensor, *also))
    sensors = (sensor, *also)
    first, advance, intervals = sensed_march(network, losses, inputs, full_start, effects, sensors)

    def add(state, x):
        before, totals = state
        interval, shares, places = x
        after = advance(before, interval)
        rows = zip(totals, shares, places, before.reading, after.reading, strict=True)
        return (after, tuple(t + s * (b + p * (a - b)) for t, s, p, b, a in rows)), None

    def block(before, x):
        nothing = tuple(jnp.zeros(()) for _ in sensors)
        (after, totals), _ = jax.lax.scan(add, (before, nothing), x)
        return after, totals

    shape = (weight.shape[0] // num, weight.shape[1])
    rows = jax.tree.map(lambda values: values.reshape(*shape), intervals)
    shares, places = (tuple(v.reshape(num, *shape)) for v in (weight, position))
    _, means = jax.lax.scan(block, first, (rows, shares, places))
    return jnp.concatenate(means)
