"""Simulation of a network over a record: `simulate` is fast, `reference` is exact and slow."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float

from .balance import heat_balance, loss_split, rates
from .effects.base import AbstractEffect, HeatEffect, NodeEffect, SensorEffect
from .inputs import Drive, Inputs
from .losses import CopperLosses
from .network import Link, Network
from .sensor import Sensor
from .stepping import Step, affine_step, general_step, mean, stages

Carry = TypeVar("Carry")


class Trace(eqx.Module):
    """What the network did: temperatures at the edges, flows as means over the intervals.

    Attributes:
        time: Times of the edges [s], shape (time + 1,).
        temperature: Temperature by node [degC], shape (time + 1,).
        reading: What the sensor reads [degC], shape (time + 1,).
        flow: Heat flow by link, first end to second [W], shape (time,). P_ws is
            `flow["winding", "stator"]`, P_se is `flow["stator", "ambient"]`.
        heat: Heat put into each node [W], shape (time,).
        copper_loss: P_js [W], shape (time,).
        other_loss: P_ol [W], shape (time,).
    """

    time: Float[Array, " edge"]
    temperature: dict[str, Float[Array, " edge"]]
    reading: Float[Array, " edge"]
    flow: dict[Link, Float[Array, " time"]]
    heat: dict[str, Float[Array, " time"]]
    copper_loss: Float[Array, " time"]
    other_loss: Float[Array, " time"]


def simulate(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    effects: Sequence[AbstractEffect] = (),
    sensor: Sensor = Sensor(),
) -> Trace:
    """Simulate a record by explicit third-order steps on the grid of the inputs.

    A bare network on equal steps takes the affine form of the step, everything else the general
    one; the numbers are the same. Outputs that are not used cost nothing under `jax.jit`.

    Args:
        network: Nodes and links.
        losses: Copper loss and the meaning of the loss channel.
        inputs: Means over the intervals.
        start: Temperature of each node of `network` at the first edge [degC]; an effect that
            adds a node knows its start.
        effects: Effects, applied in this order.
        sensor: Where the temperature is read, and with what error.

    Returns:
        Temperatures, reading, flows and losses.

    Raises:
        ValueError: If JAX runs in float32, a start temperature is missing, or the step is longer
            than `longest_step` (checked outside of jit).

    Valid for: steps well below the shortest time constant (error ~ (h/tau)^3/24 of a change).
    """
    network, full_start = _prepare(network, start, effects)
    _check_step(network, inputs)
    temperature = _march(network, losses, inputs, full_start, _heat_effects(effects))
    return _trace(network, losses, inputs, temperature, effects, sensor)


def reading(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    effects: Sequence[AbstractEffect] = (),
    sensor: Sensor = Sensor(),
) -> Float[Array, " edge"]:
    """Return only the sensor's reading at the edges [degC], shape (time + 1,).

    As `simulate`, without the checks: the path that a fit calls thousands of times.
    """
    network, full_start = _prepare(network, start, effects)
    temperature = _march(network, losses, inputs, full_start, _heat_effects(effects))
    return _read(inputs, temperature, effects, sensor, losses)


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
    """
    if any(isinstance(effect, SensorEffect) for effect in effects):
        raise ValueError("accumulate() carries no sensor effects: use reading() for them.")
    network, full_start = _prepare(network, start, effects)
    step = _step(network, losses, inputs, _heat_effects(effects))

    def advance(state, x):
        temperature, before, carry = state
        drive, length, item = x
        temperature = step(temperature, drive, length)
        sink = drive.ambient + losses.ambient_offset
        after = sensor.read(temperature[sensor.node], sink)
        return (temperature, after, update(carry, before, after, item)), None

    sink = inputs.ambient[0] + losses.ambient_offset
    first = sensor.read(full_start[sensor.node], sink)
    last, _ = jax.lax.scan(advance, (full_start, first, carry), (*_intervals(inputs), data))
    return last[2]


def reference(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    effects: Sequence[AbstractEffect] = (),
    sensor: Sensor = Sensor(),
    tolerance: float = 1e-11,
) -> Trace:
    """As `simulate`, solved by diffrax from edge to edge with an adaptive 5th-order method.

    The inputs jump at the edges, so the solver is started anew at each: a method that steps
    over the jumps is neither fast nor accurate.

    Args:
        network: As `simulate`.
        losses: As `simulate`.
        inputs: As `simulate`.
        start: As `simulate`.
        effects: As `simulate`.
        sensor: As `simulate`.
        tolerance: Relative and absolute [K] tolerance of the step size control.
    """
    network, full_start = _prepare(network, start, effects)
    heat_effects = _heat_effects(effects)

    def slope(t, state, drive):
        terms = heat_balance(network, losses, heat_effects, state, drive)
        return rates(network, terms, state)

    def advance(state, x):
        drive, step = x
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(slope),  # pyright: ignore[reportArgumentType]
            diffrax.Tsit5(),
            t0=0.0,
            t1=step,
            dt0=step,
            y0=state,
            args=drive,
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
            saveat=diffrax.SaveAt(t1=True),
        )
        after = jax.tree.map(lambda values: values[-1], solution.ys)
        return after, after

    steps = jnp.broadcast_to(inputs.step, (inputs.num_time,))
    _, after = jax.lax.scan(advance, full_start, (inputs.drive(), steps))
    temperature = _with_start(full_start, after)
    return _trace(network, losses, inputs, temperature, effects, sensor)


def longest_step(network: Network) -> Float[Array, ""]:
    """Return the longest step [s] that the explicit method takes with a bounded error.

    The row sums of |A| bound every eigenvalue (Gershgorin); the method is stable up to
    |h lambda| = 2.5, and less than half of that keeps the decay of the fastest node monotonous.
    """
    rate = []
    for node in network.nodes:
        conductance = sum(
            (1.0 / R for link, R in network.resistance.items() if node in link), jnp.zeros(())
        )
        rate.append(2.0 * conductance / network.capacitance[node])
    return 1.0 / jnp.max(jnp.stack(rate))


def _prepare(network, start, effects):
    if not jax.config.read("jax_enable_x64"):
        raise ValueError(
            "lptn needs float64 and JAX runs in float32: call "
            '`jax.config.update("jax_enable_x64", True)` before the first array is made.'
        )
    missing = set(network.nodes) - set(start)
    if missing or set(start) - set(network.nodes):
        raise ValueError(
            f"Start temperatures are given for {sorted(start)}, expected one for each node of "
            f"{list(network.nodes)}."
        )
    full_start = {node: jnp.asarray(start[node], dtype=float) for node in network.nodes}
    for effect in effects:
        if isinstance(effect, NodeEffect):
            network = effect.extend(network)
            full_start = effect.start(full_start)
    return network, full_start


def _check_step(network: Network, inputs: Inputs) -> None:
    longest, step = longest_step(network), jnp.max(inputs.step)
    if not _is_concrete(longest, step):
        return
    if step > longest:
        raise ValueError(
            f"The step of {float(step):.3g} s is longer than the fastest node allows "
            f"({float(longest):.3g} s): give the inputs on a finer grid."
        )


def _is_concrete(*values: Array) -> bool:
    """Whether the values are numbers, not placeholders of a trace."""
    return not any(isinstance(value, Tracer) for value in values)


def _heat_effects(effects: Sequence[AbstractEffect]) -> list[HeatEffect]:
    return [effect for effect in effects if isinstance(effect, HeatEffect)]


def _march(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: dict[str, Float[Array, ""]],
    effects: Sequence[HeatEffect],
) -> dict[str, Float[Array, " edge"]]:
    """Return the temperatures at the edges by node."""
    step = _step(network, losses, inputs, effects)

    def advance(state, x):
        after = step(state, *x)
        return after, after

    _, after = jax.lax.scan(advance, start, _intervals(inputs))
    return _with_start(start, after)


def _step(network, losses, inputs, effects) -> Step:
    if effects or not inputs.is_uniform:
        return general_step(network, losses, effects)
    return affine_step(network, losses, inputs.step)


def _intervals(inputs: Inputs) -> tuple[Drive, Float[Array, " time"]]:
    return inputs.drive(), jnp.broadcast_to(inputs.step, (inputs.num_time,))


def _with_start(start, after):
    return {node: jnp.concatenate([start[node][None], after[node]]) for node in after}


def _read(inputs, temperature, effects, sensor, losses):
    sink = inputs.ambient + losses.ambient_offset
    sink_at_edges = jnp.concatenate([sink[:1], 0.5 * (sink[1:] + sink[:-1]), sink[-1:]])
    values = sensor.read(temperature[sensor.node], sink_at_edges)
    for effect in effects:
        if isinstance(effect, SensorEffect):
            values = effect.observe(values, temperature, inputs.edges())
    return values


def _trace(network, losses, inputs, temperature, effects, sensor) -> Trace:
    """Take flows and losses as means over the stages of each step, so that energy closes."""
    drive = inputs.drive()
    heat_effects = _heat_effects(effects)

    def balance(state):
        return heat_balance(network, losses, heat_effects, state, drive)

    before = {node: T[:-1] for node, T in temperature.items()}
    states, _ = stages(before, inputs.step, lambda state: rates(network, balance(state), state))
    terms = [balance(state) for state in states]
    split = [loss_split(losses, state[network.copper_node], drive) for state in states]
    return Trace(
        time=inputs.edges(),
        temperature=temperature,
        reading=_read(inputs, temperature, effects, sensor, losses),
        flow={
            link: mean(*(t.flow(link, state) for t, state in zip(terms, states, strict=True)))
            for link in network.links
        },
        heat={node: mean(*(t.heat[node] for t in terms)) for node in network.nodes},
        copper_loss=mean(*(copper for copper, _ in split)),
        other_loss=mean(*(other for _, other in split)),
    )
