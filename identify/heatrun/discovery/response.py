"""How the block means answer to a little heat in a node, or to an error of the sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from lptn import Inputs, Trace
from lptn.effects import NodeEffect, SensorEffect
from lptn.march import heat_effects
from lptn.sensor import lagged
from lptn.stepping import heat_balance, rates

from ..bench.blocks import Blocks
from ..inference.model import Model, Values

SENSOR = "sensor"
"""Name that an error of the reading goes by, beside the names of the nodes."""


@dataclass(frozen=True)
class Response:
    """Derivatives of the block means of one test.

    Attributes:
        knots: Times at which the heat is given; between them it runs straight [s], shape (knot,).
        columns: By node: derivative of the block means by the heat at each knot [K/W], shape
            (block, knot), of the winding and then of each body that is fitted; for `SENSOR` by
            the error of the winding's reading [K/K].
        rise: Winding above the sink, mean over each block [K].
    """

    knots: Float[np.ndarray, " knot"]
    columns: dict[str, Float[np.ndarray, "block knot"]]
    rise: Float[np.ndarray, " block"]


def respond(model: Model, values: Values, test: Blocks, spacing_s: float) -> Response:
    """Return the response of a test's block means, linear around a course.

    Args:
        model: The network with the effects that it has by now.
        values: Its parameters by name.
        test: A reduced record.
        spacing_s: Time between knots [s].
    """
    step = float(test.inputs.step)
    edges = step * np.arange(test.inputs.num_time + 1)
    steps = jnp.full(test.inputs.num_time, step)
    num = max(3, round(test.duration_s / spacing_s) + 1)
    knots = np.linspace(0.0, edges[-1], num)
    middle = 0.5 * (edges[1:] + edges[:-1])
    hats = np.maximum(0.0, 1.0 - np.abs(middle[:, None] - knots) / (knots[1] - knots[0]))

    trace, slopes, capacity = _linear(model, values, test.inputs)
    nodes = sorted(capacity)
    heated = [n for n in model.form.nodes if n in nodes]
    A = np.stack([np.stack([slopes[row][column] for column in nodes], -1) for row in nodes], -2)
    courses = _march(A, step, {n: nodes.index(n) for n in heated}, capacity, hats)
    columns = {}
    for node, course in courses.items():
        readings = [_sense(model, values, test, trace, course, nodes)]
        for body in model.body_sensors(values, test.fitted):
            seen = (1.0 + body.gain) * jnp.asarray(course[:, nodes.index(body.node)])
            late = jax.vmap(lambda one, lag=body.lag or 0.0: lagged(one, lag, steps), 1, 1)
            readings.append(np.asarray(late(seen)))
        columns[node] = _block_means(test, readings)
    at_edges = np.maximum(0.0, 1.0 - np.abs(edges[:, None] - knots) / (knots[1] - knots[0]))
    others = [np.zeros_like(at_edges)] * len(test.fitted)
    columns[SENSOR] = _block_means(test, [at_edges, *others])
    measured = model.form.measured_node
    rise = np.asarray(trace.temperature[measured]) - np.asarray(test.inputs.ambient_at_edges())
    return Response(knots, columns, _block_means(test.winding, [rise[:, None]])[:, 0])


def _linear(model: Model, values: Values, inputs: Inputs):
    """Return the course, the derivatives of rates by temperatures [1/s], and capacities [J/K]."""
    trace, slopes, capacity = _linear_jit(model, values, inputs)
    return (
        trace,
        {row: {c: np.asarray(v) for c, v in columns.items()} for row, columns in slopes.items()},
        {node: float(C) for node, C in capacity.items()},
    )


@partial(jax.jit, static_argnames="model")
def _linear_jit(model: Model, values: Values, inputs: Inputs):
    trace: Trace = model.simulate(values, inputs)
    network = model.network(values)
    effects = model.built_effects(values)
    for effect in effects:
        if isinstance(effect, NodeEffect):
            network = effect.extend(network)
    losses, drive = model.losses(values), inputs.drive()
    heat = heat_effects(effects)
    middle = {n: 0.5 * (T[1:] + T[:-1]) for n, T in trace.temperature.items()}

    def rate(temperature):
        terms = heat_balance(network, losses, heat, temperature, drive)
        return rates(network, terms, temperature)

    slopes: dict[str, dict[str, Array]] = {node: {} for node in network.nodes}
    for column in network.nodes:
        push = {n: jnp.full_like(T, float(n == column)) for n, T in middle.items()}
        _, tangent = jax.jvp(rate, (middle,), (push,))
        for row in network.nodes:
            slopes[row][column] = tangent[row]
    return trace, slopes, network.capacitance


def _march(
    A: np.ndarray,
    step: float,
    heated: dict[str, int],
    capacity: dict[str, float],
    hats: np.ndarray,
) -> dict[str, np.ndarray]:
    """Return the temperatures (edge, node, knot) that a watt at each knot causes, by node."""
    size = A.shape[-1]
    unity = np.eye(size)
    hA = step * A
    square = hA @ hA
    M = unity + hA + square / 2 + square @ hA / 6
    S = step * (unity + hA / 2 + square / 6)
    # all nodes' pulses march side by side: one loop
    names = list(heated)
    nodes = sorted(capacity)
    force = np.zeros((size, len(names)))
    for place, name in enumerate(names):
        force[heated[name], place] = 1.0 / capacity[nodes[heated[name]]]
    gain = S @ force
    num = hats.shape[1]
    state = np.zeros((size, len(names) * num))
    course = np.zeros((A.shape[0] + 1, size, len(names) * num))
    for index in range(A.shape[0]):
        push = (gain[index][:, :, None] * hats[index]).reshape(size, -1)
        state = M[index] @ state + push
        course[index + 1] = state
    return {name: course[:, :, p * num : (p + 1) * num] for p, name in enumerate(names)}


def _sense(
    model: Model, values: Values, test: Blocks, trace: Trace, course: np.ndarray, nodes: list[str]
) -> np.ndarray:
    """Return the change of the reading (edge, knot) for changes of the nodes."""
    sensor = model.sensor(values)
    reading = (1.0 + float(np.asarray(sensor.gain))) * course[:, nodes.index(sensor.node)]
    effects = [e for e in model.built_effects(values) if isinstance(e, SensorEffect)]
    for effect in effects:
        temperature = {node: trace.temperature[node] for node in nodes}
        push = {node: jnp.asarray(course[:, place].T) for place, node in enumerate(nodes)}

        def observe(reading, temperature, effect=effect):
            return effect.observe(reading, temperature, test.inputs)

        def along(reading_push, push, observe=observe, temperature=temperature):
            return jax.jvp(observe, (trace.reading, temperature), (reading_push, push))[1]

        reading = np.asarray(jax.vmap(along)(jnp.asarray(reading.T), push)).T
    return reading


def _block_means(test: Blocks, readings: Sequence[np.ndarray]) -> Float[np.ndarray, "block column"]:
    """Return the means over the blocks of each sensor in turn, of its readings at the edges."""
    rows = []
    for edges, weight, position in zip(
        readings, test.by_sensor(test.weight), test.by_sensor(test.position), strict=True
    ):
        before = edges[:-1].reshape(*weight.shape, -1)
        after = edges[1:].reshape(*weight.shape, -1)
        between = before + position[:, :, None] * (after - before)
        rows.append(np.sum(weight[:, :, None] * between, axis=1))
    return np.concatenate(rows)
