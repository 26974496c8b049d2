"""Where a network with effects comes to rest, and the current that brings the copper there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .constant_drive import field
from .effects.base import AbstractEffect
from .inputs import Drive
from .linearise import is_stable
from .losses import CopperLosses
from .network import Network
from .stepping import eliminate

Vector = Float[Array, " node"]

TOLERANCE = 1e-10
"""Largest last step of Newton's method, relative to 1 K and the temperature [1]; the error left
is of the order of its square."""

MOST_ITERATIONS = 50
"""Steps of Newton's method after which it is given up; a handful is usual."""

HOT_K = 1500.0
"""Rise of the second start [K], above every temperature at which there is a machine."""


def steady_state(
    network: Network,
    losses: CopperLosses,
    drive: Drive,
    *,
    effects: Sequence[AbstractEffect] = (),
) -> dict[str, Float[Array, ""]]:
    """Return the temperatures at which a network rests under a constant drive [degC].

    Newton's method on the very balance that `simulate` integrates, from the sink; and from far
    above it, where the copper runs away at first and an effect on the surface catches it. Only an
    equilibrium that small disturbances decay to counts. It can be compiled and mapped.

    Args:
        network: As `linearise`.
        losses: As `linearise`.
        drive: As `linearise`; effects that follow the time stand as they are at `drive.time`, as
            if the clock stood still.
        effects: As `linearise`.

    Returns:
        Temperature by node [degC], nodes of effects among them; all NaN where there is no stable
        equilibrium, that is where the copper runs away.

    Raises:
        ValueError: As `linearise`.
    """
    at = field(network, losses, drive, None, effects)
    return at.by_node(equilibrium(at.slope, at.start))


def equilibrium(slope: Callable[[Vector], Vector], sink: Vector) -> Vector:
    """Return the stable temperatures at which the rates vanish [degC], NaN if there are none.

    Args:
        slope: Rates [K/s] by temperatures [degC].
        sink: Temperature of the sink for every node [degC], where the search begins.
    """
    found, is_found = _newton(slope, jnp.stack([sink, sink + HOT_K]))
    is_found &= jax.vmap(lambda rest: is_stable(jax.jacfwd(slope)(rest)))(found)
    (cold, hot), (is_cold, is_hot) = found, is_found
    return jnp.where(is_cold, cold, jnp.where(is_hot, hot, jnp.nan))


class SteadyCurrent(NamedTuple):
    """The current that holds the copper at a temperature.

    Attributes:
        squared: Squared rms phase current [A^2]; negative where the other losses alone make the
            copper hotter, NaN where none was found.
        temperature: Temperature by node [degC].
    """

    squared: Float[Array, ""]
    temperature: dict[str, Float[Array, ""]]


def steady_current(
    network: Network,
    losses: CopperLosses,
    drive: Drive,
    copper: Float[Array, ""] | float,
    *,
    effects: Sequence[AbstractEffect] = (),
) -> SteadyCurrent:
    """Return the constant current under which the copper rests at a given temperature.

    The same balance as in `steady_state`, with the temperature of the copper given and the
    current unknown. It can be compiled and mapped.

    Args:
        network: As `linearise`.
        losses: As `linearise`.
        drive: As `steady_state`; its current, which must not be 0, is the first guess.
        copper: Temperature of the copper node [degC].
        effects: As `linearise`.

    Raises:
        ValueError: As `linearise`.
    """
    at = field(network, losses, drive, None, effects)
    place = at.place(network.copper_node)
    copper = jnp.asarray(copper, dtype=float)

    def residual(unknown: Vector) -> Vector:
        scaled = drive.scale_current(unknown[place])
        slope = field(network, losses, scaled, None, effects).slope
        return slope(unknown.at[place].set(copper))

    (found,), (is_found,) = _newton(residual, at.start.at[place].set(1.0)[None])
    found = jnp.where(is_found, found, jnp.nan)
    temperature = at.by_node(found.at[place].set(copper))
    return SteadyCurrent(found[place] * drive.current_squared, temperature)


def _newton(
    residual: Callable[[Vector], Vector], first: Float[Array, "start node"]
) -> tuple[Float[Array, "start node"], Bool[Array, " start"]]:
    """Return where each start leads, and whether that is a zero."""

    def step(value: Vector) -> Vector:
        there, slopes = jax.vmap(
            lambda way: jax.jvp(residual, (value,), (way,)), out_axes=(None, 1)
        )(jnp.eye(value.size))
        return eliminate(slopes, -there[:, None])[:, 0]

    def improve(state):
        value, _, count = state
        change = jax.vmap(step)(value)
        after = value + change
        return after, jnp.max(jnp.abs(change) / (1.0 + jnp.abs(after)), axis=1), count + 1

    def is_moving(state):
        _, size, count = state
        return jnp.any(size > TOLERANCE) & (count < MOST_ITERATIONS)  # false for NaN

    sizes = jnp.full(first.shape[:1], jnp.inf)
    value, size, _ = jax.lax.while_loop(is_moving, improve, (first, sizes, jnp.asarray(0)))
    return value, size <= TOLERANCE
