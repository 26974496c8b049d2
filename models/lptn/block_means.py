"""Means of the simulated reading over blocks of steps, without storing the steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .effects.base import AbstractEffect, SensorEffect
from .inputs import Inputs
from .losses import CopperLosses
from .network import Network
from .sensor import Sensor
from .simulate import _heat_effects, _prepare, _step, reading


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
    """
    if any(isinstance(effect, SensorEffect) for effect in effects):
        edges = reading(network, losses, inputs, start, effects=effects, sensor=sensor)
        before, after = edges[:-1].reshape(weight.shape), edges[1:].reshape(weight.shape)
        return jnp.sum(weight * (before + position * (after - before)), axis=1)

    network, full_start = _prepare(network, start, effects)
    step = _step(network, losses, inputs, _heat_effects(effects))

    def advance(state, x):
        temperature, before, total = state
        (drive, length), share, place = x
        temperature = step(temperature, drive, length)
        sink = drive.ambient + losses.ambient_offset
        after = sensor.read(temperature[sensor.node], sink)
        total = total + share * (before + place * (after - before))
        return (temperature, after, total), None

    def block(state, x):
        state, _ = jax.lax.scan(advance, (*state, jnp.zeros(())), x)
        return state[:2], state[2]

    def rows(values):
        return values.reshape(*weight.shape)

    lengths = jnp.broadcast_to(inputs.step, (inputs.num_time,))
    intervals = jax.tree.map(rows, (inputs.drive(), lengths))
    first = sensor.read(full_start[sensor.node], inputs.ambient[0] + losses.ambient_offset)
    _, means = jax.lax.scan(block, (full_start, first), (intervals, weight, position))
    return means
