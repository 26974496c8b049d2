"""How fast the network of each draw is: state matrices, and the times of its nodes."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from lptn import Drive, Network, linearise, steady_current

from ..inference.model import Model
from .machine import under_load


class Rates(NamedTuple):
    """What one draw says; arrays over draws where many are evaluated.

    Attributes:
        node_times: Capacity times resistance of each node and its only way to the sink [s];
            empty where a node has several.
        A: State matrix without current [1/s], shape (node, node).
        A_fed: State matrix at the loaded part's current, with R(T) and the other losses held as
            for the steady rise [1/s], shape (node, node).
        follows_time: Whether an effect depends on the time since the start of a test.
    """

    node_times: dict[str, Float[Array, "*draw"]]
    A: Float[Array, "*draw node node"]
    A_fed: Float[Array, "*draw node node"]
    follows_time: Array


@partial(jax.jit, static_argnames="model")
def rates(
    model: Model,
    values: dict[str, Float[Array, " draw"]],
    loaded: Drive,
    winding: Float[Array, ""],
) -> Rates:
    """Return the rates of each draw; compiled once per model.

    Args:
        model: Network with effects.
        values: Parameters of the machine in general by name [their units].
        loaded: The loaded part of the tests.
        winding: Mean reading of the loaded part [degC]; where laws bend with the temperature, the
            rates are those with the winding there.
    """

    def one(values: dict[str, Float[Array, ""]]) -> Rates:
        network, rated, drive, effects = under_load(model, values, loaded, winding)
        losses = model.losses(values)
        held = steady_current(network, rated, drive, winding, effects=effects).temperature
        at = {node: jnp.where(jnp.isfinite(T), T, winding) for node, T in held.items()}
        timeless = replace(loaded, time=jnp.asarray(jnp.nan))
        return Rates(
            node_times=node_times(network),
            A=linearise(network, losses, loaded.scale_current(0.0), at, effects=effects).A,
            A_fed=linearise(network, rated, drive, at, effects=effects).A,
            # no time at all is seen by whoever looks at it
            follows_time=jnp.any(
                jnp.isnan(linearise(network, losses, timeless, at, effects=effects).offset)
            ),
        )

    return jax.vmap(one)(values)


def node_times(network: Network) -> dict[str, Float[Array, ""]]:
    """Return capacity times resistance of each node and its link towards the sink [s].

    Empty if there is one node, which has no other time, or if a node has several ways.
    """
    if len(network.nodes) == 1 or len(network.links) != len(network.nodes):
        return {}
    way: dict[str, Float[Array, ""]] = {}
    reached = {network.boundary}
    while True:
        new = {
            near: network.resistance[link]
            for link in network.links
            for near, far in (link, link[::-1])
            if far in reached and near not in reached
        }
        if not new:
            break
        way |= new
        reached |= set(new)
    if set(way) != set(network.nodes):
        return {}
    return {node: network.capacitance[node] * way[node] for node in network.nodes}
