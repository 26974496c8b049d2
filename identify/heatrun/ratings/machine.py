"""The machine of each draw under the load of the tests: what ratings are read from.

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

from lptn import CopperLosses, Drive, Network, heat_input, steady_current, steady_state, time_to
from lptn.effects import AbstractEffect

from ..inference.model import Model

WARM = 0.75
"""Share of the steady rise that a warm start has [1]."""


class Machine(NamedTuple):
    """What one draw says; arrays over draws where many are evaluated.

    Attributes:
        other: Other losses of the loaded part [W].
        copper_slope: Copper loss per squared ampere and kelvin [W/(A^2 K)].
        rise: Steady rise of the copper [K], at the rated current where that was given, else at the
            loaded part's; inf where it runs away.
        limit_squared: Squared current that holds the copper at the limit [A^2].
        cold_s: Time to the limit at the loaded part's current, from the sink [s].
        warm_s: The same from `WARM` of the steady rise [s].
    """

    other: Float[Array, "*draw"]
    copper_slope: Float[Array, "*draw"]
    rise: Float[Array, "*draw"]
    limit_squared: Float[Array, "*draw"]
    cold_s: Float[Array, "*draw"]
    warm_s: Float[Array, "*draw"]


@partial(jax.jit, static_argnames="model")
def machines(
    model: Model,
    values: dict[str, Float[Array, " draw"]],
    loaded: Drive,
    winding: Float[Array, ""],
    limit: Float[Array, ""],
    rated: Float[Array, ""] | float = 1.0,
) -> Machine:
    """Return the machine of each draw; compiled once per model.

    Args:
        model: Network with effects.
        values: Parameters of the machine in general by name [their units].
        loaded: The loaded part of the tests.
        winding: Mean reading of the loaded part [degC].
        limit: Limit of the insulation [degC]; NaN for none, and nothing is said of it.
        rated: Squared rated current over that of the loaded part [1]; 1 where none is given.
    """

    def one(values: dict[str, Float[Array, ""]]) -> Machine:
        at = under_load(model, values, loaded, winding)
        network, drive, effects = at.network, at.drive, at.effects
        rest = steady_state(network, at.losses, drive, effects=effects)
        top = steady_current(network, at.losses, drive, limit, effects=effects)
        sink, copper = drive.ambient, network.copper_node
        under_rated = drive.scale_current(rated)
        top_rise = steady_state(network, at.losses, under_rated, effects=effects)[copper] - sink

        def time_from(share: Float[Array, ""]) -> Float[Array, ""]:
            start = {
                # where the copper runs away, the warm start is on the way to the limit
                node: sink + share * (jnp.where(jnp.isfinite(T), T, top.temperature[node]) - sink)
                for node, T in rest.items()
            }
            return time_to(
                network, at.losses, drive, start, node=copper, limit=limit, effects=effects
            )

        cold_s, warm_s = jax.vmap(time_from)(jnp.asarray([0.0, WARM]))
        return Machine(
            other=drive.losses,
            copper_slope=at.losses.slope(jnp.asarray(1.0)),
            rise=jnp.where(jnp.isfinite(top_rise), top_rise, jnp.inf),
            limit_squared=top.squared,
            cold_s=cold_s,
            warm_s=warm_s,
        )

    return jax.vmap(one)(values)


class UnderLoad(NamedTuple):
    """A machine at the load of the tests.

    Attributes:
        network: The network.
        losses: Its losses, the other ones given.
        drive: The loaded part, with the other losses.
        effects: The effects.
    """

    network: Network
    losses: CopperLosses
    drive: Drive
    effects: tuple[AbstractEffect, ...]


def under_load(
    model: Model,
    values: dict[str, Float[Array, ""]],
    loaded: Drive,
    winding: Float[Array, ""],
) -> UnderLoad:
    """Return the machine of one draw, with the other losses held at what they were in the tests.

    Args:
        model: Network with effects.
        values: Parameters by name [their units].
        loaded: The loaded part of the tests.
        winding: Mean reading of the loaded part [degC].
    """
    network, losses = model.network(values), model.losses(values)
    effects = model.built_effects(values)
    other = other_losses(network, losses, loaded, winding, effects)
    return UnderLoad(network, fixed_losses(losses), replace(loaded, losses=other), effects)


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
