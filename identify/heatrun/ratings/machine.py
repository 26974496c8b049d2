"""The machine of each draw under the load of the tests: what the figures are read from.

The other losses P_ol are held at what they were in the loaded part of the tests, because a
balance says nothing about loads that were not run; the copper loss follows current and
temperature. All physics is that of `lptn`, for any network with any effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from lptn import (
    CopperLosses,
    Drive,
    Network,
    heat_input,
    linearise,
    steady_current,
    steady_state,
    time_to,
)
from lptn.effects import AbstractEffect

from ..inference.model import Model

WARM = 0.75
"""Share of the steady rise that a warm start has [1]."""


class Machine(NamedTuple):
    """What one draw says; arrays over draws where many are evaluated.

    Attributes:
        other: Other losses of the loaded part [W].
        copper_slope: Copper loss per squared ampere and kelvin [W/(A^2 K)].
        node_times: Capacity times resistance of each node and its only way to the sink [s];
            empty where a node has several.
        A: State matrix without current [1/s], shape (node, node).
        A_fed: State matrix at the loaded part's current, with R(T) and the other losses held as
            for the steady rise [1/s], shape (node, node).
        rise: Steady rise of the copper at the loaded part's current [K]; inf where it runs away.
        limit_squared: Squared current that holds the copper at the limit [A^2].
        cold_s: Time to the limit at the loaded part's current, from the sink [s].
        warm_s: The same from `WARM` of the steady rise [s].
        follows_time: Whether an effect depends on the time since the start of a test.
    """

    other: Float[Array, "*draw"]
    copper_slope: Float[Array, "*draw"]
    node_times: dict[str, Float[Array, "*draw"]]
    A: Float[Array, "*draw node node"]
    A_fed: Float[Array, "*draw node node"]
    rise: Float[Array, "*draw"]
    limit_squared: Float[Array, "*draw"]
    cold_s: Float[Array, "*draw"]
    warm_s: Float[Array, "*draw"]
    follows_time: Array


@partial(jax.jit, static_argnames="model")
def machines(
    model: Model,
    values: dict[str, Float[Array, " draw"]],
    loaded: Drive,
    winding: Float[Array, ""],
    limit: Float[Array, ""],
) -> Machine:
    """Return the machine of each draw; compiled once per model.

    Args:
        model: Network with effects.
        values: Parameters of the machine in general by name [their units].
        loaded: The loaded part of the tests.
        winding: Mean reading of the loaded part [degC]; where laws bend with the temperature, the
            time constants are those with the winding there.
        limit: Limit of the insulation [degC]; NaN for none, and nothing is said of it.
    """

    def one(values: dict[str, Float[Array, ""]]) -> Machine:
        network, losses = model.network(values), model.losses(values)
        effects = model.built_effects(values)
        rated = fixed_losses(losses)
        drive = replace(loaded, losses=other_losses(network, losses, loaded, winding, effects))
        held = steady_current(network, rated, drive, winding, effects=effects).temperature
        at = {node: jnp.where(jnp.isfinite(T), T, winding) for node, T in held.items()}
        rest = steady_state(network, rated, drive, effects=effects)
        top = steady_current(network, rated, drive, limit, effects=effects)
        sink, copper = drive.ambient, network.copper_node

        def time_from(share: Float[Array, ""]) -> Float[Array, ""]:
            start = {
                # where the copper runs away, the warm start is on the way to the limit
                node: sink + share * (jnp.where(jnp.isfinite(T), T, top.temperature[node]) - sink)
                for node, T in rest.items()
            }
            return time_to(network, rated, drive, start, node=copper, limit=limit, effects=effects)

        cold_s, warm_s = jax.vmap(time_from)(jnp.asarray([0.0, WARM]))
        timeless = replace(loaded, time=jnp.asarray(jnp.nan))
        return Machine(
            other=drive.losses,
            copper_slope=losses.slope(jnp.asarray(1.0)),
            node_times=node_times(network),
            A=linearise(network, losses, loaded.scale_current(0.0), at, effects=effects).A,
            A_fed=linearise(network, rated, drive, at, effects=effects).A,
            rise=jnp.where(jnp.isfinite(rest[copper]), rest[copper] - sink, jnp.inf),
            limit_squared=top.squared,
            cold_s=cold_s,
            warm_s=warm_s,
            # no time at all is seen by whoever looks at it
            follows_time=jnp.any(
                jnp.isnan(linearise(network, losses, timeless, at, effects=effects).offset)
            ),
        )

    return jax.vmap(one)(values)


def fixed_losses(losses: CopperLosses) -> CopperLosses:
    """Return the losses of a machine whose other losses are given, and its true sink.

    The current stays as the bench reads it, with its error.
    """
    return replace(
        losses,
        kind="map",
        power_gain=0.0,
        torque_offset=0.0,
        ambient_offset=0.0,
        shaft_power_gain=0.0,
        shaft_power_offset=0.0,
        second_sink_offset=0.0,
    )


def other_losses(
    network: Network,
    losses: CopperLosses,
    loaded: Drive,
    winding: Float[Array, ""],
    effects: Sequence[AbstractEffect],
) -> Float[Array, ""]:
    """Return the other losses [W] with which the machine is heated as it was in the tests.

    The heat is proportional to them apart from a constant, so one step of Newton's method is the
    solution. Effects on the copper loss are counted: under a balance their heat is part of Pd.
    """
    at = dict.fromkeys(network.nodes, winding)

    def total(losses: CopperLosses, watts: Float[Array, ""]) -> Float[Array, ""]:
        drive = replace(loaded, losses=watts)
        heat = heat_input(network, losses, drive, at, effects=effects)
        return jnp.sum(jnp.stack(list(heat.values())))

    def excess(watts: Float[Array, ""]) -> Float[Array, ""]:
        return total(fixed_losses(losses), watts) - total(losses, loaded.losses)

    guess = loaded.losses
    value, slope = jax.jvp(excess, (guess,), (jnp.ones_like(guess),))
    return guess - value / slope


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
