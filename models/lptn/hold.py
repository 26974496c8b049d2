"""The temperatures after a constant drive was held, and how long a node takes to a temperature."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .constant_drive import equilibrium, field
from .effects.base import AbstractEffect
from .inputs import Drive
from .network import CopperLosses, Network
from .stepping import eliminate


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
    """Return the temperatures after a constant drive has been held.

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

    Valid for: steps well below the time constants that matter, as those of `time_to`. A node that
        is faster follows at once.
    """
    at = field(network, losses, drive, start, effects)

    def advance(_, state):
        vector, highest = state
        after = _implicit(at.slope, vector, jnp.asarray(step))[0]
        return after, jnp.maximum(highest, after)

    last, highest = jax.lax.fori_loop(0, num_steps, advance, (at.start, at.start))
    return Held(at.by_node(last), at.by_node(highest))


GROWTH = 0.07
"""Steps in terms of the time since the start [1]: modes fade before steps pass them by."""

SHORTEST = 0.02
"""First step in terms of the fastest node's time [1]."""

NEAR = 0.1
"""Share of the gap to the limit [1] within which no node may lie above its steady temperature
when a network is said to stay below the limit: a node that is hotter warms its neighbours by
less than it is hotter itself, or little more where the resistance R(T) feeds it."""

MOST_STEPS = 2000
"""Steps after which an answer is given up: time has grown by a factor of 10^58."""

NUM_HALVINGS = 60
"""Halvings of the last step: to the last digit of a float64."""


class _State(NamedTuple):
    """Where the march is: before and after the last step, and what came of it."""

    time: Float[Array, ""]
    step: Float[Array, ""]
    before: Float[Array, " node"]
    after: Float[Array, " node"]
    is_never: Bool[Array, ""]
    num_steps: Array


def time_to(
    network: Network,
    losses: CopperLosses,
    drive: Drive,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    node: str,
    limit: Float[Array, ""] | float,
    effects: Sequence[AbstractEffect] = (),
    steady: Mapping[str, Float[Array, ""]] | None = None,
) -> Float[Array, ""]:
    """Return the time until a node reaches a limit under a constant drive [s].

    The balance of `simulate`, by an implicit method of third order in steps that grow with the
    time since the start, however fast a node is, and a cubic between the last two. The temperature
    at the time returned is the limit to within 2e-5 of the largest change on the way. It can be
    compiled and mapped.

    Args:
        network: As `linearise`.
        losses: As `linearise`.
        drive: As `steady_state`.
        start: Temperature of each node of `network` [degC]; an effect that adds a node knows its
            start, unless it is given.
        node: Node that is to stay below the limit.
        limit: Its limit [degC].
        effects: As `linearise`.
        steady: The `steady_state` under the drive [degC], where it is known by now.

    Returns:
        Time [s]: 0 if the node is there at the start, inf if it never gets there, NaN if it has
        not been decided within 2000 steps.

    Raises:
        ValueError: As `linearise`, and if there is no such node.
    """
    at = field(network, losses, drive, start, effects)
    place, limit = at.place(node), jnp.asarray(limit, dtype=float)
    if steady is None:
        sink = jnp.full_like(at.start, drive.ambient + losses.ambient_offset)
        rest = equilibrium(at.slope, sink)
    else:
        rest = jnp.stack([steady[each] for each in at.nodes])
    ends = jnp.stack([at.start, jnp.full_like(at.start, limit)])
    fastest = jnp.min(jax.vmap(lambda T: _fastest(at.slope, T))(ends))

    def is_going(state: _State) -> Bool[Array, ""]:
        is_below = state.after[place] < limit
        return is_below & ~state.is_never & (state.num_steps < MOST_STEPS)

    def advance(state: _State) -> _State:
        time, before = state.time + state.step, state.after
        step = jnp.maximum(GROWTH * time, SHORTEST * fastest)
        after, slope = _implicit(at.slope, before, step)
        gap = limit - rest[place]
        stays = (gap > 0.0) & jnp.all(before - rest <= NEAR * gap)
        is_never = stays | jnp.all(slope <= 0.0)  # what cools everywhere goes on cooling
        # nothing moves while it is decided that nothing will
        after = jnp.where(is_never, before, after)
        return _State(time, step, before, after, is_never, state.num_steps + 1)

    zero = jnp.zeros(())
    first = _State(zero, zero, at.start, at.start, jnp.asarray(False), jnp.asarray(0))
    last = jax.lax.while_loop(is_going, advance, first)
    ends = jnp.stack([last.before, last.after])
    slopes = jax.vmap(at.slope)(ends)
    inside = _crossing(last.step, ends[:, place], slopes[:, place], limit)
    found = jnp.where(last.after[place] >= limit, last.time + inside, jnp.nan)
    return jnp.where(last.is_never, jnp.inf, found)


def _implicit(
    slope: Callable[[Float[Array, " node"]], Float[Array, " node"]],
    vector: Float[Array, " node"],
    step: Float[Array, ""],
) -> tuple[Float[Array, " node"], Float[Array, " node"]]:
    """Return the temperatures after a step that no fast node bounds, and the first rates.

    Reference: A. Sandu et al., Benchmarking stiff ODE solvers for atmospheric chemistry problems
        II: Rosenbrock solvers, Atmospheric Environment 31 (1997) 3459-3472 (RODAS3, order 3,
        L-stable).
    """
    rate = slope(vector)
    jacobian = jax.jacfwd(slope)(vector)
    unit = jnp.eye(vector.size)
    solve = eliminate(2.0 * unit - step * jacobian, unit)  # also of a step of no length

    def moved(rate: Array, *parts: Array) -> Array:
        return jnp.sum(solve * (step * rate + sum(parts))[None, :], axis=1)

    first = moved(rate)
    second = moved(rate, 4.0 * first)
    third = moved(slope(vector + 2.0 * first), first, -second)
    last = vector + 2.0 * first + third
    fourth = moved(slope(last), first, -second, -8.0 / 3.0 * third)
    return last + fourth, rate


def _fastest(slope, temperature: Float[Array, " node"]) -> Float[Array, ""]:
    """Return a bound from below on the shortest time constant [s] (Gershgorin)."""
    A = jax.jacfwd(slope)(temperature)
    return 1.0 / jnp.max(jnp.sum(jnp.abs(A), axis=1))


def _crossing(step, values, slopes, limit) -> Float[Array, ""]:
    """Return when a cubic with these ends reaches the limit [s since the step's start].

    It begins below the limit and ends at or above it, or both at it.
    """
    (start, end), (rise, fall) = values, slopes

    def cubic(x):
        return (
            (1.0 + 2.0 * x) * (1.0 - x) ** 2 * start
            + x * (1.0 - x) ** 2 * step * rise
            + x**2 * (3.0 - 2.0 * x) * end
            - x**2 * (1.0 - x) * step * fall
        )

    def halve(_, bounds):
        low, high = bounds
        middle = 0.5 * (low + high)
        is_there = cubic(middle) >= limit
        return jnp.where(is_there, low, middle), jnp.where(is_there, middle, high)

    _, high = jax.lax.fori_loop(0, NUM_HALVINGS, halve, (jnp.zeros(()), jnp.ones(())))
    return high * step
