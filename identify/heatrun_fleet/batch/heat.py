"""What unmodelled heat does to the tests of many machines: `inference.discrepancy`, lane by lane.

The columns are the same up to their signs: the strongest directions of the responses to a
Gauss-Markov heat in each heated node.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from heatrun.inference.discrepancy import NUM_COLUMNS, SPACING_S
from heatrun.inference.noise import HEAT
from heatrun.inference.problem import Structure

from .machines import Group, Machines
from .residuals import values_of_group

LONGEST_BLOCK_S = 24.0
"""Blocks are at most this long [s], or a test has more knots than there is room for."""

NUM_HALVINGS, ORDER = 10, 9
"""Of the step whose exponential is taken, and of its series: for a network whose fastest node takes
a fifth of a block, the series errs by 1e-17."""


def most_knots(num_blocks: int) -> int:
    """Return the room for knots in a test of a padded length [blocks]."""
    return math.ceil(num_blocks * LONGEST_BLOCK_S / SPACING_S) + 2


@partial(jax.jit, static_argnames="structure")
def heat_columns(
    structure: Structure, machines: Machines, z: Float[Array, "parameter machine"]
) -> tuple[Float[Array, "block column lane"], ...]:
    """Return the columns of each group of tests, as `Observation.heat`; 0 in the padding."""
    return tuple(_of_group(structure, machines, z, group) for group in machines.groups)


def _of_group(
    structure: Structure, machines: Machines, z: Float[Array, "parameter machine"], group: Group
) -> Float[Array, "block column lane"]:
    model = structure.model
    values, _ = values_of_group(structure, machines, z, group)
    mean_loss = group.mean_losses
    if model.kind == "map":
        mean_loss = mean_loss + model.phases * values["Rs0"] * group.mean_current_squared
    size = jnp.maximum(jnp.abs(mean_loss), 1e-3) * model.adequacy.unmodelled_heat / HEAT.centre

    network = model.network(values)
    nodes = network.nodes
    heated = [n for n in nodes if n == network.copper_node or n in network.share]
    num = group.measured.shape[0]
    course = _courses(group, num, model.adequacy.heat_time_s)
    step = _exponential(_system(network, heated, model.form.measured_node, group))
    last = len(nodes)  # the place of the integral of the measured node
    first = [[jnp.zeros_like(course[0]) for _ in nodes] for _ in heated]

    def advance(state, x):
        heat, slope = x
        after, means = [], []
        for place, own in enumerate(state):
            rows = []
            for row in range(last + 1):
                total = step[row, last + 1 + 2 * place] * heat
                total = total + step[row, last + 2 + 2 * place] * slope
                for column, temperature in enumerate(own):
                    total = total + step[row, column] * temperature
                rows.append(total)
            after.append(rows[:last])
            means.append(rows[last] / group.block_s)
        return after, jnp.concatenate(means)

    slopes = jnp.diff(course, axis=0) / group.block_s
    _, joined = jax.lax.scan(advance, first, (course[:-1], slopes))
    is_there = jnp.arange(num)[:, None] < group.num_blocks
    joined = jnp.moveaxis(jnp.where(is_there[:, None], size * joined, 0.0), -1, 0)
    # the right singular vectors, strongest last
    _, turned = jnp.linalg.eigh(jnp.einsum("wbi,wbj->wij", joined, joined))
    columns = jnp.einsum("wbi,wic->bcw", joined, turned[:, :, -NUM_COLUMNS:][:, :, ::-1])
    missing = NUM_COLUMNS - columns.shape[1]
    return jnp.pad(columns, ((0, 0), (0, max(missing, 0)), (0, 0)))


def _courses(group: Group, num: int, heat_time_s: float) -> Float[Array, "edge knot lane"]:
    """Return courses of heat at the edges of the blocks, for a standard normal at each knot."""
    most = most_knots(num)
    knot = jnp.arange(most)
    spacing = group.block_s * group.num_blocks / (group.num_knots - 1.0)
    is_there = knot[:, None] < group.num_knots
    edges = jnp.arange(num + 1)[:, None] * group.block_s
    hats = 1.0 - jnp.abs(edges[:, None] / spacing - knot[:, None])
    hats = jnp.where(is_there, jnp.maximum(hats, 0.0), 0.0)
    # the Cholesky factor of exp(-|t - t'|/tau) on an even grid
    kept = jnp.exp(-spacing / heat_time_s)
    lag = (knot[:, None] - knot)[:, :, None]
    fresh = jnp.where((knot == 0)[:, None], 1.0, jnp.sqrt(1.0 - kept**2))
    factor = jnp.where(lag >= 0, kept ** jnp.maximum(lag, 0) * fresh, 0.0)
    factor = jnp.where(is_there, factor, 0.0)
    return jnp.einsum("ekw,klw->elw", hats, factor)


def _system(
    network: Any, heated: list[str], measured: str, group: Group
) -> Float[Array, "row row lane"]:
    """Return the matrix over a block of: temperatures, the measured one's integral, heats and
    their slopes.
    """
    nodes = list(network.nodes)
    rows: dict[tuple[int, int], Any] = {}
    for (near, far), resistance in network.resistance.items():
        for own, other in ((near, far), (far, near)):
            if own in nodes:
                i, rate = nodes.index(own), 1.0 / (resistance * network.capacitance[own])
                rows[i, i] = rows.get((i, i), 0.0) - rate
                if other in nodes:
                    j = nodes.index(other)
                    rows[i, j] = rows.get((i, j), 0.0) + rate
    last = len(nodes)
    rows[last, nodes.index(measured)] = 1.0
    for place, node in enumerate(heated):
        column = last + 1 + 2 * place
        rows[nodes.index(node), column] = 1.0 / network.capacitance[node]
        rows[column, column + 1] = 1.0
    size = last + 1 + 2 * len(heated)
    matrix = jnp.zeros((size, size, group.block_s.shape[0]))
    for key, value in rows.items():
        matrix = matrix.at[key].set(value)
    return matrix * group.block_s


def _exponential(matrix: Float[Array, "row row lane"]) -> Float[Array, "row row lane"]:
    """Return the exponentials of matrices: a series, squared."""

    def product(a, b):
        return jnp.einsum("ijw,jkw->ikw", a, b)

    small = matrix / 2.0**NUM_HALVINGS
    unit = jnp.broadcast_to(jnp.eye(matrix.shape[0])[:, :, None], matrix.shape)
    total = unit
    for order in range(ORDER, 0, -1):
        total = unit + product(small, total) / order
    return jax.lax.fori_loop(0, NUM_HALVINGS, lambda _, m: product(m, m), total)
