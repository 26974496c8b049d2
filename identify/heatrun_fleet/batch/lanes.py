"""Lanes picked, put side by side and handed back."""

from __future__ import annotations

from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from .machines import Machines

Tree = TypeVar("Tree")


@jax.jit
def picked(tree: Tree, places: Int[Array, " picked"]) -> Tree:
    """Return arrays with some of the machines in their trailing axis."""
    return jax.tree.map(lambda values: jnp.take(values, places, axis=-1), tree)


@jax.jit
def picked_machines(machines: Machines, places: Int[Array, " picked"]) -> Machines:
    """Return the numbers of some of the machines."""
    num = machines.centre.shape[-1]
    groups = tuple(
        picked(group, _of_tests(places, len(group.tests), num)) for group in machines.groups
    )
    return Machines(picked(machines.centre, places), picked(machines.sd, places), groups)


@jax.jit
def picked_heat(
    machines: Machines, heat: tuple[Array, ...], places: Int[Array, " picked"]
) -> tuple[Array, ...]:
    """Return arrays of the groups of tests, such as the heat, of some of the machines."""
    num = machines.centre.shape[-1]
    return tuple(
        picked(own, _of_tests(places, len(group.tests), num))
        for own, group in zip(heat, machines.groups, strict=True)
    )


def _of_tests(places: Array, num_tests: int, num_machines: int) -> Array:
    return jnp.concatenate([places + test * num_machines for test in range(num_tests)])


@jax.jit
def kept(is_kept: Array, old: Tree, new: Tree) -> Tree:
    """Return the old arrays in the machines where they are kept, the new ones in the others."""

    def one(before: Array, after: Array) -> Array:
        own = jnp.concatenate([is_kept] * (before.shape[-1] // is_kept.shape[0]))
        return jnp.where(own, before, after)

    return jax.tree.map(one, old, new)


def on_host(tree: Any) -> Any:
    """Return arrays as NumPy arrays."""
    return jax.tree.map(np.asarray, tree)
