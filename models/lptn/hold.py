"""The temperatures after a constant drive was held for a while."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .constant_drive import field
from .effects.base import AbstractEffect
from .inputs import Drive
from .losses import CopperLosses
from .network import Network
from .stepping import mean, stages


class Held(NamedTuple):
    """Where a drive that was held has led.

    Attributes:
        last: Temperature by node at the end [degC], nodes of effects among them.
        highest: Highest temperature by node at the edges of the steps [degC], the start's too.
    """

    last: dict[str, Float[Array, ""]]
    highest: dict[str, Float[Array, ""]]


def hold(
    network: Network,
    losses: CopperLosses,
    drive: Drive,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    step: Float[Array, ""] | float,
    num_steps: Int[Array, ""] | int,
    effects: Sequence[AbstractEffect] = (),
) -> Held:
    """Return the temperatures after a constant drive has been held, by the steps of `simulate`.

    Nothing is stored on the way, and the number of steps need not be known when it is compiled.

    Args:
        network: As `linearise`.
        losses: As `linearise`.
        drive: As `steady_state`.
        start: As `time_to`; the `last` of another call continues it.
        step: Length of a step [s].
        num_steps: Number of steps.
        effects: As `linearise`.

    Raises:
        ValueError: As `linearise`.

    Valid for: steps well below the shortest time constant (error ~ (h/tau)^3/24 of a change).
    """
    at = field(network, losses, drive, start, effects)

    def advance(_, state):
        vector, highest = state
        after = advanced(at.slope, vector, step)[0]
        return after, jnp.maximum(highest, after)

    last, highest = jax.lax.fori_loop(0, num_steps, advance, (at.start, at.start))
    return Held(at.by_node(last), at.by_node(highest))


def advanced(slope, vector: Float[Array, " node"], step: Float[Array, ""] | float):
    """Return the temperatures after a step of the simulation's scheme, and the first rates."""
    _, (first, second, third) = stages({"": vector}, step, lambda state: {"": slope(state[""])})
    return vector + step * mean(first[""], second[""], third[""]), first[""]
