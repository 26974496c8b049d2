"""Readings that come late, for machines side by side: `lptn.TimeShift`, lane by lane.

A logger of the load that is too slow to tell when a step came moves the whole reading by a time of
its own in each test, straight between the edges of the steps.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from .machines import Group, Lane

SIDE_S = 1e-9
"""Puts no shift on the side from which `lptn.TimeShift` has its slope [s]."""


def ambient_at_edges(group: Group) -> Float[Array, "edge lane"]:
    """Return the sink at the edges of the steps [degC]: between two steps, their mean."""
    steps = group.ambient.reshape(-1, group.ambient.shape[-1])
    before, after = jnp.concatenate([steps[:1], steps]), jnp.concatenate([steps, steps[-1:]])
    is_inside = jnp.arange(before.shape[0])[:, None] < _num_steps(group)
    return jnp.where(is_inside, 0.5 * (before + after), before)


def late_means(
    edges: Float[Array, "edge quantity lane"], shift: Lane, group: Group
) -> tuple[Float[Array, "block quantity lane"], Float[Array, "block quantity lane"]]:
    """Return block means of quantities that are read late, and their derivatives by the time.

    Args:
        edges: The quantities at the edges of the steps.
        shift: How late [s]; before the first edge and after the last one the nearest holds.
        group: The tests.
    """
    num = edges.shape[0] - 1
    steps = (shift + SIDE_S) / group.step
    whole = jnp.floor(steps)
    wanted = jnp.arange(-1, num + 1)[:, None] - whole
    wanted = jnp.clip(wanted, 0, _num_steps(group)).astype(int)
    found = jnp.take_along_axis(edges, wanted[:, None], axis=0)
    earlier, now = found[:-1], found[1:]
    slope = (earlier - now) / group.step
    return _means(now + (steps - whole) * (earlier - now), group), _means(slope, group)


def _means(edges: Float[Array, "edge quantity lane"], group: Group) -> Array:
    shape = (*group.weight.shape[:2], *edges.shape[1:])
    before, after = edges[:-1].reshape(shape), edges[1:].reshape(shape)
    weight, position = group.weight[:, :, None], group.position[:, :, None]
    return jnp.sum(weight * (before + position * (after - before)), axis=1)


def _num_steps(group: Group) -> Lane:
    """Return the steps of each test without the padding."""
    return group.num_blocks * group.weight.shape[1]
