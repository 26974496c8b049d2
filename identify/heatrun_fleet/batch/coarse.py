"""Tests with fewer and longer steps: where a search from afar finds its way as well, and sooner."""

from __future__ import annotations

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .machines import Group, Machines

INPUTS = ("current_squared", "losses", "ambient", "second_sink", "shaft_power", "speed")

NUM_STEPS = 2
"""Steps of a coarse block; three where its number of steps is odd."""


@jax.jit
def coarse(machines: Machines) -> Machines:
    """Return the machines with inputs that hold for several steps, as their mean."""
    return replace(machines, groups=tuple(map(_of_group, machines.groups)))


def _of_group(group: Group) -> Group:
    num_blocks, steps, lanes = group.weight.shape
    num = next((each for each in (NUM_STEPS, 3) if steps % each == 0), steps)
    joined = steps // num

    def parts(values: Array) -> Array:
        return values.reshape(num_blocks, num, joined, lanes)

    def mean(values: Float[Array, "block step lane"] | None) -> Array | None:
        return None if values is None else jnp.mean(parts(values), axis=2)

    weight = parts(group.weight)
    total = jnp.sum(weight, axis=2)
    place = (jnp.arange(joined)[:, None] + parts(group.position)) / joined
    position = jnp.sum(weight * place, axis=2) / jnp.where(total > 0.0, total, math.inf)
    return replace(
        group,
        step=group.step * joined,
        weight=total,
        position=position,
        **{name: mean(getattr(group, name)) for name in INPUTS},
    )
