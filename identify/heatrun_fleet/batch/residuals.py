"""Residuals of many machines side by side, their derivatives by the scores, noise and heat.

They are freed of the noise's correlation, and of unmodelled heat, as `heatrun.model.noise` and
`heatrun.model.discrepancy` do it, lane by lane; the columns of the heat, the strongest directions
of the responses to a Gauss-Markov heat in each heated node, are the same up to their signs. Lanes
stand in the trailing axis.

Small symmetric matrices are swept, without a library of linear algebra: batches of factorisations
inside compiled code are shared among XLA's threads, which wait for one another where two of them
run at once (`heatrun.model.kernels.ALONE`). Sweeps have no such trouble, and run alike on every
device.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from heatrun.io.programs import compiled
from heatrun.model.discrepancy import MOST_COLUMNS, SPACING_S, num_columns
from heatrun.model.noise import HEAT, Noise, SensorRows, filter_rows
from heatrun.model.problem import Structure
from heatrun.record.samples import BLOCK_S
from lptn import CopperLosses

from .march import SLOPE, Group, Lane, Machines, late_means, march

OF_SLOPE = ("Rs0", "current_gain")
OF_READING = ("sensor_gain", "sensor_offset", "load_timing")


class Means(NamedTuple):
    """Measured minus modelled block means of a group of tests [K]; their derivative per score."""

    residual: Float[Array, "block lane"]
    jacobian: Float[Array, "block parameter lane"]


class Free(NamedTuple):
    """A free parameter: its place in the scores for each test, and its value's derivative by the
    score.
    """

    positions: tuple[int, ...]
    per_score: Lane


def values_of_group(
    structure: Structure, machines: Machines, z: Float[Array, "parameter machine"], group: Group
) -> tuple[dict[str, Lane], dict[str, Free]]:
    """Return the values of all parameters by name, and which are free; by lane."""
    found: dict[str, list[Any]] = {}
    for test in group.tests:
        for position, (name, transform, owner) in enumerate(structure.form):
            if owner is None or owner == test:
                sd, centre = machines.sd[position], machines.centre[position]
                shift = sd * z[position]
                value = centre * jnp.exp(shift) if transform == "log" else centre + shift
                per_score = sd * value if transform == "log" else sd
                found.setdefault(name, []).append((position, value, per_score))
    values, free = dict(group.fixed), {}
    for name, parts in found.items():
        positions, own, per_score = zip(*parts, strict=True)
        values[name] = jnp.concatenate(own)
        free[name] = Free(positions, jnp.concatenate(per_score))
    return values, free


def residuals_of_group(
    structure: Structure,
    machines: Machines,
    z: Float[Array, "parameter machine"],
    group: Group,
    worst: float,
) -> Means:
    """Return the residuals of a group of tests, and their Jacobian.

    The structure is a bare network, read by one sensor; `worst` is what a residual counts that is
    larger or not finite [K].
    """
    values, slots = values_of_group(structure, machines, z, group)
    losses = structure.model.losses(values)
    quantities = {name: v for name, v in values.items() if name not in (*OF_SLOPE, *OF_READING)}
    if "Rs0" in values:
        quantities[SLOPE] = losses.slope(jnp.asarray(1.0))
    free = sorted(name for name in quantities if name in slots)
    if any(name in slots for name in OF_SLOPE) and SLOPE in quantities:
        free = sorted([*free, SLOPE])

    gain, offset = values["sensor_gain"], values["sensor_offset"]
    seen = jnp.sum(group.weight, axis=1)
    late: dict[str, Array] = {}
    if "load_timing" in values:
        mean, slopes, sink, by_time, sink_by_time = late_means(
            structure.model, group, quantities, free, values["load_timing"]
        )
        late["load_timing"] = by_time + gain * (by_time - sink_by_time)
    else:
        (mean, slopes), sink = march(structure.model, group, quantities, free), group.sensed_ambient
    rise = mean - sink - values["ambient_offset"] * seen
    reading = mean + gain * rise + offset * seen

    by_name: dict[str, Array] = {"sensor_gain": rise, "sensor_offset": seen} | late
    for name in free:
        slope = (1.0 + gain) * slopes[name]
        if name == "ambient_offset":
            slope = slope - gain * seen
        for own, per_own in _acting_through(name, losses).items():
            by_name[own] = slope * per_own
    columns = [[jnp.zeros_like(part) for part in group.by_test(mean)]
               for _ in range(structure.num_parameters)]  # fmt: skip
    for name, (positions, per_score) in slots.items():
        parts = group.by_test(by_name[name] * per_score)
        for test, (position, part) in enumerate(zip(positions, parts, strict=True)):
            columns[position][test] = -part

    difference = jnp.where(group.is_observed, group.measured - reading, 0.0)
    is_sound = jnp.abs(difference) < worst
    jacobian = jnp.stack([jnp.concatenate(parts, axis=-1) for parts in columns], axis=1)
    jacobian = jnp.where((group.is_observed & is_sound)[:, None], jacobian, 0.0)
    return Means(jnp.where(is_sound, difference, worst), jacobian)


def _acting_through(name: str, losses: CopperLosses) -> dict[str, Any]:
    """Return the parameters that act through a quantity, with its derivative by each."""
    if name != SLOPE:
        return {name: 1.0}
    slope = losses.slope(jnp.asarray(1.0))
    return {"Rs0": slope / losses.Rs0, "current_gain": 2.0 * slope / (1.0 + losses.current_gain)}


def sweep(
    matrix: Float[Array, "row row lane"], num: int
) -> tuple[Float[Array, "row row lane"], Float[Array, " lane"]]:
    """Sweep a symmetric matrix on its first pivots, whose block A is positive definite.

    With A the swept block, B the one beside it and C the rest: minus the inverse of A stands where
    A was, inv(A) B where B was, and C - B' inv(A) B where C was; half the log determinant of A
    comes with it.

    Reference: J. H. Goodnight, A tutorial on the SWEEP operator, The American Statistician 33
        (1979) 149-158.
    """
    size = matrix.shape[0]

    def take(pivot, carry):
        swept, half_log_det = carry
        row = jax.lax.dynamic_index_in_dim(swept, pivot, 0, keepdims=False)
        d = jax.lax.dynamic_index_in_dim(row, pivot, 0, keepdims=False)
        is_pivot = (jnp.arange(size) == pivot)[:, None]
        scaled = row / d
        rest = swept - row[:, None] * scaled[None]
        edge = jnp.where(is_pivot, -1.0 / d, scaled)
        rest = jnp.where(is_pivot[:, None], edge[None], rest)
        rest = jnp.where(is_pivot[None], edge[:, None], rest)
        return rest, half_log_det + 0.5 * jnp.log(d)

    return jax.lax.fori_loop(0, num, take, (matrix, jnp.zeros(matrix.shape[-1])))


def solve(
    matrix: Float[Array, "row row lane"], right: Float[Array, "row lane"]
) -> Float[Array, "row lane"]:
    """Return the solutions of positive definite systems."""
    size = matrix.shape[0]
    corner = jnp.zeros((1, 1, matrix.shape[-1]))
    joined = jnp.concatenate([
        jnp.concatenate([matrix, right[:, None]], axis=1),
        jnp.concatenate([right[None], corner], axis=1),
    ])  # fmt: skip
    return sweep(joined, size)[0][:size, size]


def identity(size: int, num_lanes: int) -> Float[Array, "row row lane"]:
    """Return unit matrices."""
    return jnp.broadcast_to(jnp.eye(size)[:, :, None], (size, size, num_lanes))


def filtered(
    columns: Float[Array, "block column lane"], noise: Noise, group: Group
) -> tuple[Float[Array, "lane block column"], Float[Array, " lane"]]:
    """Return columns whitened by the noise of each lane, and half its log determinant."""
    sensor = SensorRows(
        is_observed=group.is_observed,
        count=group.count,
        known_variance=group.known_variance,
        block_s=group.block_s,
        noise_scale=jnp.ones_like(group.block_s),
    )
    return jax.vmap(filter_rows, in_axes=-1, out_axes=0)(columns, noise, sensor)


def weighted(
    columns: Float[Array, "block column lane"], noise: Noise, group: Group
) -> Float[Array, "lane block column"]:
    """Return columns whitened by the white part of the noise alone; arguments as `filtered`."""
    variance = noise.white**2 * (BLOCK_S / group.block_s) + group.known_variance
    white = jnp.where(group.is_observed[:, None], columns, 0.0) / jnp.sqrt(variance)[:, None]
    return jnp.moveaxis(white, -1, 0)


def products(white: Float[Array, "lane block column"]) -> Float[Array, "column column lane"]:
    """Return the inner products of columns."""
    return jnp.moveaxis(jnp.einsum("wbi,wbj->wij", white, white), 0, -1)


def scaled_heat(
    gram: Float[Array, "column column lane"], num_heat: int, heat: Float[Array, " lane"]
) -> Float[Array, "column column lane"]:
    """Return inner products with the columns of the heat, the first ones, scaled by its size."""
    factor = jnp.ones((gram.shape[0], heat.shape[0])).at[:num_heat].set(heat)
    return gram * factor[:, None] * factor[None]


def without_columns(
    gram: Float[Array, "column column lane"], num: int
) -> tuple[Float[Array, "column column lane"], Float[Array, " lane"]]:
    """Sweep the first columns, a standard normal for each of them, out of inner products; as
    `sweep`.
    """
    ones = (jnp.arange(gram.shape[0]) < num).astype(float)
    return sweep(gram + jnp.diag(ones)[:, :, None], num)


LONGEST_BLOCK_S = 24.0
"""Blocks are at most this long [s], or a test has more knots than there is room for."""

NUM_HALVINGS, ORDER = 10, 9
"""Of the step whose exponential is taken, and of its series: for a network whose fastest node takes
a fifth of a block, the series errs by 1e-17."""


def most_knots(num_blocks: int) -> int:
    """Return the room for knots in a test of a padded length [blocks]."""
    return math.ceil(num_blocks * LONGEST_BLOCK_S / SPACING_S) + 2


@compiled("structure")
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
    columns = jnp.einsum("wbi,wic->bcw", joined, turned[:, :, -MOST_COLUMNS:][:, :, ::-1])
    own = num_columns(group.num_knots)
    columns = jnp.where(jnp.arange(columns.shape[1])[:, None] < own, columns, 0.0)
    missing = MOST_COLUMNS - columns.shape[1]
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
    unit = identity(matrix.shape[0], matrix.shape[-1])
    total = unit
    for order in range(ORDER, 0, -1):
        total = unit + product(small, total) / order
    return jax.lax.fori_loop(0, NUM_HALVINGS, lambda _, m: product(m, m), total)
