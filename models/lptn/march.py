"""The way of a network through the intervals of a record, shared by all that simulate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float

from .effects.base import AbstractEffect, HeatEffect, NodeEffect, SensorEffect
from .inputs import Drive, Inputs
from .network import CopperLosses, Network, Sensor
from .stepping import Scalar, State, Step, affine_step, general_step


class March(NamedTuple):
    """Where a simulation starts and how it goes on from interval to interval."""

    first: State  # Temperature of each node at the first edge, counted from `origin` [K].
    origin: Scalar  # Temperature that the state is counted from [degC].
    advance: Step  # Takes the state over one interval.
    # Inputs and length [s] of each interval, leading axis of shape (time,).
    intervals: tuple[Drive, Float[Array, " time"]]


def march(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: State,
    effects: Sequence[AbstractEffect],
) -> March:
    """Return the march of a prepared network; the affine step wherever it applies.

    Args:
        network: Network with the nodes of all effects in it.
        losses: As `lptn.simulate`.
        inputs: As `lptn.simulate`.
        start: Temperature of each node at the first edge [degC].
        effects: As `lptn.simulate`.
    """
    lengths = jnp.broadcast_to(inputs.step, (inputs.num_time,))
    intervals = (inputs.drive(), lengths)
    heat = heat_effects(effects)
    if heat or not inputs.is_uniform:
        return March(start, 0.0, general_step(network, losses, heat), intervals)
    first = {node: T + losses.coefficient for node, T in start.items()}
    advance = affine_step(network, losses, inputs.step)
    return March(first, -losses.coefficient, advance, intervals)


class Sensed(NamedTuple):
    """The state of a march at an edge, with what the sensors read there."""

    state: State  # Temperatures as in `March.first` [K].
    at_once: tuple[Float[Array, ""], ...]  # Reading of each sensor, had it no lag [degC].
    reading: tuple[Float[Array, ""], ...]  # Reading of each sensor [degC].


def sensed_march(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: State,
    effects: Sequence[AbstractEffect],
    sensors: Sequence[Sensor],
) -> tuple[Sensed, Callable[[Sensed, Any], Sensed], Any]:
    """Return the first state, the step to the next, and what to scan it over.

    Args:
        network: As `march`.
        losses: As `march`.
        inputs: As `march`.
        start: As `march`.
        effects: As `march`; effects on the sensor are left out.
        sensors: What is read.
    """
    first, origin, advance, intervals = march(network, losses, inputs, start, effects)
    ambient = inputs.ambient_at_edges()

    def sense(state: State, ambient: Float[Array, ""]) -> tuple[Float[Array, ""], ...]:
        sink = ambient + losses.ambient_offset
        return tuple(sensor.read(state[sensor.node] + origin, sink) for sensor in sensors)

    def advance_and_sense(seen: Sensed, x) -> Sensed:
        (drive, step), ambient = x
        state = advance(seen.state, drive, step)
        at_once = sense(state, ambient)
        rows = zip(sensors, seen.reading, seen.at_once, at_once, strict=True)
        reading = tuple(s.follow(sensed, before, after, step) for s, sensed, before, after in rows)
        return Sensed(state, at_once, reading)

    at_first = sense(first, ambient[0])
    return Sensed(first, at_first, at_first), advance_and_sense, (intervals, ambient[1:])


def prepare(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs | Drive,
    start: Mapping[str, Float[Array, ""] | float],
    effects: Sequence[AbstractEffect],
    sensors: Sequence[Sensor],
) -> tuple[Network, State]:
    """Return network and start temperatures [degC] with the nodes of the effects in them.

    Raises:
        ValueError: If JAX runs in float32, a start temperature is missing or no scalar, the
            sensor sits nowhere, a torque offset has no speed to act on, or a second boundary
            no temperature.
    """
    if not jax.config.read("jax_enable_x64"):
        raise ValueError(
            "lptn needs float64 and JAX runs in float32: call "
            '`jax.config.update("jax_enable_x64", True)` before the first array is made.'
        )
    if set(start) != set(network.nodes):
        raise ValueError(
            f"Start temperatures are given for {sorted(start)}, expected one for each node of "
            f"{list(network.nodes)}."
        )
    if inputs.speed is None and is_concrete(losses.torque_offset) and losses.torque_offset != 0.0:
        raise ValueError(
            f"A torque offset of {float(losses.torque_offset):.3g} N m needs the speed, and "
            f"{type(inputs).__name__}.speed is None: give the speed, or drop the offset."
        )
    if network.second_boundary and inputs.second_sink is None:
        raise ValueError(
            f"The network also loses heat to {network.second_boundary!r}, and "
            f"{type(inputs).__name__}.second_sink is None: give the temperature of that sink."
        )
    full_start = {node: jnp.asarray(start[node], dtype=float) for node in network.nodes}
    for node, T in full_start.items():
        if T.ndim:
            raise ValueError(
                f"The start temperature of {node!r} has shape {T.shape}, expected one number "
                "[degC]: use `jax.vmap` for many starts."
            )
    for effect in effects:
        if isinstance(effect, NodeEffect):
            network = effect.extend(network)
            full_start = effect.start(full_start)
    for sensor in sensors:
        if sensor.node not in network.nodes:
            raise ValueError(
                f"The sensor sits in node {sensor.node!r}, which is none of "
                f"{list(network.nodes)}: build it with `Sensor(node=...)`."
            )
    return network, full_start


def heat_effects(effects: Sequence[AbstractEffect]) -> list[HeatEffect]:
    """Return those effects that act on the heat balance, those that look at all of it last."""
    acting = [effect for effect in effects if isinstance(effect, HeatEffect)]
    return sorted(acting, key=lambda effect: effect.rebuilds)


def is_concrete(*values: Scalar) -> bool:
    """Whether the values are numbers, not placeholders of a trace."""
    return not any(isinstance(value, Tracer) for value in values)


Carry = TypeVar("Carry")


def accumulate(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    update: Callable[[Carry, Float[Array, ""], Float[Array, ""], Any], Carry],
    carry: Carry,
    data: Any,
    effects: Sequence[AbstractEffect] = (),
    sensor: Sensor = Sensor(),
) -> Carry:
    """Fold a function over the readings while simulating, without storing them.

    A likelihood over many samples and many parameter sets is bound by memory as soon as the
    temperatures are written out; here they stay in registers.

    Args:
        network: As `simulate`.
        losses: As `simulate`.
        inputs: As `simulate`.
        start: As `simulate`.
        update: Called as `update(carry, before, after, item)` with the readings [degC] at both
            edges of an interval and that interval's item of `data`; returns the next carry.
        carry: What `update` starts from.
        data: Arrays with a leading axis of shape (time,).
        effects: As `simulate`; effects on the sensor keep a state of their own and are refused.
        sensor: As `simulate`.

    Returns:
        The last carry.

    Raises:
        ValueError: As `reading`, and if an effect acts on the sensor.
    """
    if any(isinstance(effect, SensorEffect) for effect in effects):
        raise ValueError("accumulate() carries no sensor effects: use reading() for them.")
    network, full_start = prepare(network, losses, inputs, start, effects, (sensor,))
    first, advance, intervals = sensed_march(
        network, losses, inputs, full_start, effects, (sensor,)
    )

    def fold(state, x):
        before, carry = state
        interval, item = x
        after = advance(before, interval)
        return (after, update(carry, before.reading[0], after.reading[0], item)), None

    last, _ = jax.lax.scan(fold, (first, carry), (intervals, data))
    return last[1]
