"""Simulation of a network over a record: `simulate` is fast, `reference` is exact and slow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .effects.base import AbstractEffect, SensorEffect, extended
from .inputs import Inputs
from .march import heat_effects, is_concrete, march, prepare, sensed_march
from .network import CopperLosses, Link, Network, Sensor, lagged
from .stepping import State, heat_balance, loss_split, mean, rates, stages


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
        ValueError: If JAX runs in float32, a start temperature is missing, an effect or the
            sensor names a node or link that is not there, an input is missing that an effect
            or the torque offset needs, the shares of a network do not add up to one, or a step
            is not above 0 or longer than `longest_step` (the last three outside of jit only).

    Valid for: steps well below the shortest time constant (error ~ (h/tau)^3/24 of a change).
    """
    network, full_start = prepare(network, losses, inputs, start, effects, (sensor,))
    _check_shares(network)
    _check_step(network, inputs)
    temperature = _march(network, losses, inputs, full_start, effects)
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

    As `simulate`, without the check of shares and steps: a fit calls it thousands of times.
    """
    return readings(network, losses, inputs, start, effects=effects, sensor=sensor)[0]


def readings(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    effects: Sequence[AbstractEffect] = (),
    sensor: Sensor = Sensor(),
    also: Sequence[Sensor] = (),
) -> Float[Array, "sensor edge"]:
    """Return the readings of several sensors at the edges [degC], shape (sensor, time + 1).

    As `reading`; effects on the reading concern the first sensor alone.
    """
    network, full_start = prepare(network, losses, inputs, start, effects, (sensor, *also))
    temperature = _march(network, losses, inputs, full_start, effects)
    rows = [_read(inputs, temperature, effects, sensor, losses)]
    rows += [_read(inputs, temperature, (), other, losses) for other in also]
    return jnp.stack(rows)


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
    import diffrax  # half a second to import, and nothing else needs it

    network, full_start = prepare(network, losses, inputs, start, effects, (sensor,))
    heat = heat_effects(effects)

    def slope(t, state, drive):
        terms = heat_balance(network, losses, heat, state, drive)
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


def longest_step(network: Network, effects: Iterable[AbstractEffect] = ()) -> Float[Array, ""]:
    """Return the longest step [s] that the explicit method takes with a bounded error.

    Args:
        network: The base network.
        effects: What is in it beside; those with nodes of their own count.

    The row sums of |A| bound every eigenvalue (Gershgorin); the method is stable up to
    |h lambda| = 2.5, and less than half of that keeps the decay of the fastest node monotonous.
    """
    network = extended(network, effects)
    rate = []
    for node in network.nodes:
        conductance = sum(
            (1.0 / R for link, R in network.resistance.items() if node in link), jnp.zeros(())
        )
        rate.append(2.0 * conductance / network.capacitance[node])
    return 1.0 / jnp.max(jnp.stack(rate))


def _check_shares(network: Network) -> None:
    total = sum(network.share.values(), start=jnp.zeros(()))
    # 1e-6: shares that a parametrisation computes add up to one within rounding, not exactly
    if is_concrete(total) and not abs(total - 1.0) < 1e-6:
        raise ValueError(
            f"The shares of {list(network.share)} in the other losses add up to "
            f"{float(total):.6g}, expected 1: heat would be lost or made. Scale them."
        )


def _check_step(network: Network, inputs: Inputs) -> None:
    longest, step = longest_step(network), jnp.max(inputs.step)
    if not is_concrete(longest, step):
        return
    if not jnp.min(inputs.step) > 0.0:
        raise ValueError(
            f"The shortest step is {float(jnp.min(inputs.step)):.3g} s, expected above 0 s: the "
            "times of the record must increase."
        )
    if step > longest:
        raise ValueError(
            f"The step of {float(step):.3g} s is longer than the fastest node allows "
            f"({float(longest):.3g} s): give the inputs on a finer grid."
        )


def _march(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: State,
    effects: Sequence[AbstractEffect],
) -> dict[str, Float[Array, " edge"]]:
    """Return the temperatures at the edges by node [degC]."""
    first, origin, step, intervals = march(network, losses, inputs, start, effects)

    def advance(state, x):
        after = step(state, *x)
        return after, after

    _, after = jax.lax.scan(advance, first, intervals)
    return _with_start(start, {node: T + origin for node, T in after.items()})


def _with_start(start, after):
    return {node: jnp.concatenate([start[node][None], after[node]]) for node in after}


def _read(inputs, temperature, effects, sensor, losses):
    sink = inputs.ambient_at_edges() + losses.ambient_offset
    values = sensor.read(temperature[sensor.node], sink)
    if sensor.lag is not None:
        values = lagged(values, sensor.lag, jnp.broadcast_to(inputs.step, (inputs.num_time,)))
    for effect in effects:
        if isinstance(effect, SensorEffect):
            values = effect.observe(values, temperature, inputs)
    return values


def _trace(network, losses, inputs, temperature, effects, sensor) -> Trace:
    """Take flows and losses as means over the stages of each step, so that energy closes."""
    drive = inputs.drive()
    heat = heat_effects(effects)

    def balance(state):
        return heat_balance(network, losses, heat, state, drive)

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


def block_means(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    weight: Float[Array, "row step"],
    position: Float[Array, "row step"],
    effects: Sequence[AbstractEffect] = (),
    sensor: Sensor = Sensor(),
    also: Sequence[Sensor] = (),
) -> Float[Array, " row"]:
    """Return weighted means of the reading over blocks of steps [degC], shape (row,).

    As `reading` followed by a weighted mean, but the steps of a block stay in registers: over
    many parameter sets the temperatures would not fit the cache. There is a row for each block, or
    for each block of `sensor` and then of each further sensor.

    Args:
        network: As `simulate`.
        losses: As `simulate`.
        inputs: As `simulate`; its intervals are the steps of all blocks in a row.
        start: As `simulate`.
        weight: Share of each step in the mean of its block [1].
        position: Where in each step the samples lie on average, 0 its start and 1 its end [1].
        effects: As `simulate`.
        sensor: As `simulate`.
        also: Further sensors; effects on the reading do not concern them.

    Raises:
        ValueError: As `reading`, and if the blocks do not hold the steps of `inputs`.
    """
    num = 1 + len(also)
    if weight.shape != position.shape or weight.size != num * inputs.num_time:
        raise ValueError(
            f"weight has shape {weight.shape} and position {position.shape}: expected both of "
            f"shape (row, step) with {num * inputs.num_time} steps in all: those of `inputs` for "
            "each sensor."
        )
    if any(isinstance(effect, SensorEffect) for effect in effects):
        edges = readings(network, losses, inputs, start, effects=effects, sensor=sensor, also=also)
        before, after = edges[:, :-1].reshape(weight.shape), edges[:, 1:].reshape(weight.shape)
        return jnp.sum(weight * (before + position * (after - before)), axis=1)

    network, full_start = prepare(network, losses, inputs, start, effects, (sensor, *also))
    sensors = (sensor, *also)
    first, advance, intervals = sensed_march(network, losses, inputs, full_start, effects, sensors)

    def add(state, x):
        before, totals = state
        interval, shares, places = x
        after = advance(before, interval)
        rows = zip(totals, shares, places, before.reading, after.reading, strict=True)
        return (after, tuple(t + s * (b + p * (a - b)) for t, s, p, b, a in rows)), None

    def block(before, x):
        nothing = tuple(jnp.zeros(()) for _ in sensors)
        (after, totals), _ = jax.lax.scan(add, (before, nothing), x)
        return after, totals

    shape = (weight.shape[0] // num, weight.shape[1])
    rows = jax.tree.map(lambda values: values.reshape(*shape), intervals)
    shares, places = (tuple(v.reshape(num, *shape)) for v in (weight, position))
    _, means = jax.lax.scan(block, first, (rows, shares, places))
    return jnp.concatenate(means)
