"""Block means of a bare network and their derivatives, for many machines side by side.

The numbers are those of `lptn.block_means`; the loop is another, because a batch that is mapped
over the general one runs five times slower. Machines (lanes) stand in the trailing axis of every
array. Three things make it fast:

- The step is affine in the temperatures, with coefficients that are polynomials of the squared
  current (`lptn.stepping.AffineTerms`), and so are its derivatives: they are worked out once for
  each network, and those that vanish by structure are left out of the loop.
- The parameters act through fewer quantities: the phase resistance and the error of the current
  through one slope of the copper loss. Only these quantities have a tangent in the loop.
- Gain and offset of the sensor act on the block means, not on the steps.

Tests of one padded shape are lanes beside each other too: a lane is a test of a machine, and those
of the first test come first.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from operator import add
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.extend.core import Literal
from jaxtyping import Array, Bool, Float

from lptn import CopperLosses
from lptn.stepping import affine_terms, horner

from ...inference.model import Model
from ...inference.problem import Structure

SLOPE = "slope of the copper loss"
"""Name of k over the squared current [W/(K A^2)], through which Rs0 and the current's error act."""

OF_SLOPE = ("Rs0", "current_gain")
OF_READING = ("sensor_gain", "sensor_offset")

Lane = Float[Array, " lane"]
Values = Mapping[str, Lane]


class Group(eqx.Module):
    """Tests of one padded shape, of each machine; a lane for each test of each machine.

    Attributes:
        tests: Indices of the tests; the lanes of the first come first.
        step: Length of a step [s], shape (lane,).
        current_squared: As `lptn.Inputs`, shape (block, step, lane).
        losses: Likewise.
        ambient: Likewise.
        second_sink: Likewise, None where the network has no use for it.
        shaft_power: Likewise.
        speed: Likewise.
        weight: As `Blocks.weight`, shape (block, step, lane); 0 in padding.
        position: As `Blocks.position`, likewise.
        sensed_ambient: Mean of the sink at the samples of each block [degC], shape (block, lane).
        measured: Mean reading of each block [degC], shape (block, lane).
        is_observed: Which blocks hold a reading, shape (block, lane).
        count: Readings of each block [1], shape (block, lane).
        rounding_variance: As `Observation.rounding_variance`, shape (block, lane).
        block_s: Length of a block [s], shape (lane,).
        num_blocks: Blocks without the padding [1], shape (lane,).
        num_knots: Knots of the unmodelled heat [1], shape (lane,).
        mean_losses: Mean of the loss channel [W], shape (lane,).
        mean_current_squared: Mean of the squared current [A^2], shape (lane,).
        fixed: Fixed values by name, shape (lane,) each.
    """

    tests: tuple[int, ...] = eqx.field(static=True)
    step: Lane
    current_squared: Float[Array, "block step lane"]
    losses: Float[Array, "block step lane"]
    ambient: Float[Array, "block step lane"]
    second_sink: Float[Array, "block step lane"] | None
    shaft_power: Float[Array, "block step lane"] | None
    speed: Float[Array, "block step lane"] | None
    weight: Float[Array, "block step lane"]
    position: Float[Array, "block step lane"]
    sensed_ambient: Float[Array, "block lane"]
    measured: Float[Array, "block lane"]
    is_observed: Bool[Array, "block lane"]
    count: Float[Array, "block lane"]
    rounding_variance: Float[Array, "block lane"]
    block_s: Lane
    num_blocks: Lane
    num_knots: Lane
    mean_losses: Lane
    mean_current_squared: Lane
    fixed: dict[str, Lane]

    def by_lane(self, values: Float[Array, "*axes machine"]) -> Float[Array, "*axes lane"]:
        """Return values of the machines for the lanes of their tests."""
        return jnp.concatenate([values] * len(self.tests), axis=-1)

    def by_test(self, values: Float[Array, "*axes lane"]) -> list[Float[Array, "*axes machine"]]:
        """Return values of the lanes for each test."""
        return jnp.split(values, len(self.tests), axis=-1)


class Machines(eqx.Module):
    """The numbers of as many problems of one structure as there are machines.

    Attributes:
        centre: Centres of the priors [their units], shape (parameter, machine).
        sd: Their standard deviations, shape (parameter, machine).
        groups: The tests.
    """

    centre: Float[Array, "parameter machine"]
    sd: Float[Array, "parameter machine"]
    groups: tuple[Group, ...]


class Means(NamedTuple):
    """Residuals of a group of tests and their derivatives.

    Attributes:
        residual: Measured minus modelled block means [K], shape (block, lane).
        jacobian: Their derivative [K per score], shape (block, parameter, lane).
    """

    residual: Float[Array, "block lane"]
    jacobian: Float[Array, "block parameter lane"]


class Free(NamedTuple):
    """A free parameter as the tests of a group see it.

    Attributes:
        positions: Its place in the scores, for each test.
        per_score: Derivative of its value by the score, shape (lane,).
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

    Args:
        structure: What is compiled: a bare network without time shift, read by one sensor.
        machines: The numbers.
        z: Scores.
        group: The tests.
        worst: What a residual counts that is larger or not finite [K].
    """
    values, slots = values_of_group(structure, machines, z, group)
    losses = structure.model.losses(values)
    quantities = {name: v for name, v in values.items() if name not in (*OF_SLOPE, *OF_READING)}
    if "Rs0" in values:
        quantities[SLOPE] = losses.slope(jnp.asarray(1.0))
    free = sorted(name for name in quantities if name in slots)
    if any(name in slots for name in OF_SLOPE) and SLOPE in quantities:
        free = sorted([*free, SLOPE])

    mean, slopes = _march(structure.model, group, quantities, free)
    gain, offset = values["sensor_gain"], values["sensor_offset"]
    seen = jnp.sum(group.weight, axis=1)
    rise = mean - group.sensed_ambient - values["ambient_offset"] * seen
    reading = mean + gain * rise + offset * seen

    by_name: dict[str, Array] = {}
    for name in free:
        slope = (1.0 + gain) * slopes[name]
        if name == "ambient_offset":
            slope = slope - gain * seen
        for own, per_own in _acting_through(name, losses).items():
            by_name[own] = slope * per_own
    by_name |= dict(zip(OF_READING, (rise, seen), strict=True))
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


Term = tuple[str, ...]
"""A quantity and what it is multiplied with: ("state", row, column), ("drive", row, name), or
("start", node); its power of the squared current follows as a digit."""


def _terms(model: Model, quantities: Values, step: Lane) -> dict[Term, Array]:
    """Return the coefficients of the march by what they stand for; structural zeros are absent."""
    known = dict(quantities)
    slope = known.pop(SLOPE, None)
    if slope is not None:
        span = model.coefficient + model.reference_temperature
        known |= {"Rs0": slope * span / model.phases}  # without an error of the current
    network = model.network(known)
    losses = model.losses(known)
    terms = affine_terms(network, losses, step)
    most = 0 if slope is None else 3
    factors = [1.0 if slope is None or power == 0 else slope**power for power in range(4)]
    found: dict[Term, Any] = {}
    for power, matrix in enumerate(terms.powers[: most + 1]):
        for (row, column), value in matrix.items():
            found["state", row, column, str(power)] = value * factors[power]
    for power, matrix in enumerate(terms.spread[: most + 1]):
        for (row, column), value in matrix.items():
            for name, vector in terms.put_in.items():
                if column in vector:
                    key = "drive", row, name, str(power)
                    added = value * vector[column] * factors[power]
                    found[key] = found[key] + added if key in found else added
    for node, start in model.start(known).items():
        found["start", node] = start + model.coefficient
    return {key: jnp.broadcast_to(jnp.asarray(v, dtype=float), step.shape)
            for key, v in found.items()}  # fmt: skip


def _dependence(model: Model, names: tuple[str, ...], num_lanes: int) -> dict[Term, set[str]]:
    """Return the quantities that each coefficient depends on by structure."""
    lane = jax.ShapeDtypeStruct((num_lanes,), jnp.float64)

    keys: list[Term] = []

    def named(*args):
        *rest, step = args
        found = _terms(model, dict(zip(names, rest, strict=True)), step)
        keys.extend(found)
        return list(found.values())

    jaxpr = jax.make_jaxpr(named)(*[lane] * (len(names) + 1)).jaxpr
    reach: dict[Any, set[str]] = {
        var: {name} for var, name in zip(jaxpr.invars, (*names, ""), strict=True)
    }
    for equation in jaxpr.eqns:
        inputs = [reach.get(v, set()) for v in equation.invars if not isinstance(v, Literal)]
        joined = set[str]().union(*inputs)
        reach |= dict.fromkeys(equation.outvars, joined)
    outputs = [set() if isinstance(v, Literal) else reach.get(v, set()) for v in jaxpr.outvars]
    return dict(zip(keys, outputs, strict=True))


def _tangents(
    model: Model,
    quantities: Values,
    free: list[str],
    step: Lane,
    dependence: Mapping[Term, set[str]],
) -> dict[str, dict[Term, Array]]:
    """Return the derivatives of the coefficients by quantity; structural zeros are absent."""
    own = {name: quantities[name] for name in free}

    def at(moved: dict[str, Lane]) -> dict[Term, Array]:
        return _terms(model, {**quantities, **moved}, step)

    def push(direction):
        ones = {name: jnp.broadcast_to(direction[i], step.shape) for i, name in enumerate(free)}
        return jax.jvp(at, (own,), (ones,))[1]

    # all at once: one direction after the other would be as many times the code to compile
    slopes = jax.vmap(push)(jnp.eye(len(free)))
    return {
        name: {key: slope[i] for key, slope in slopes.items() if name in dependence[key]}
        for i, name in enumerate(free)
    }


def _march(
    model: Model, rows: Group, quantities: Values, free: list[str]
) -> tuple[Float[Array, "block lane"], dict[str, Float[Array, "block lane"]]]:
    """Return block means of the measured node [degC] and their derivatives by quantity."""
    step = rows.step
    terms = _terms(model, quantities, step)
    dependence = _dependence(model, tuple(quantities), step.shape[0])
    node = model.form.measured_node
    nodes = model.form.nodes

    tangents = _tangents(model, quantities, free, step, dependence)

    channels = {
        "ambient": rows.ambient, "losses": rows.losses, "second_sink": rows.second_sink,
        "shaft_power": rows.shaft_power, "speed_rad": rows.speed,
    }  # fmt: skip
    used = {key[2] for key in terms if key[0] == "drive"} - {"", "shaft_offset"}
    drive = {name: channels[name] for name in used if channels[name] is not None}
    if rows.shaft_power is None:
        terms, tangents = _without(terms, "shaft_offset"), {
            name: _without(each, "shaft_offset") for name, each in tangents.items()
        }  # fmt: skip
    xs = (rows.current_squared, drive, rows.weight, rows.position)

    def started(of: Mapping[Term, Array]) -> dict[str, Array]:
        zero = jnp.zeros_like(step)
        return {each: of.get(("start", each), zero) for each in nodes}

    first = started(terms), {name: started(each) for name, each in tangents.items()}

    # one array for all coefficients: as operands of the loop each takes its time to compile
    packed, unpacked = _packed(terms, tangents)

    def advance(before, x):
        (state, moved), totals = before
        square, inputs, weight, position = x
        terms, tangents = unpacked(packed)
        matrix = _polynomials(terms, "state", square)
        after = _linear(matrix, _polynomials(terms, "drive", square), state, inputs, nodes)
        moved_after = {}
        for name, tangent in tangents.items():
            own = _linear(
                _polynomials(tangent, "state", square), _polynomials(tangent, "drive", square),
                state, inputs, nodes,
            )  # fmt: skip
            carried = _linear(matrix, {}, moved[name], inputs, nodes)
            moved_after[name] = {each: own[each] + carried[each] for each in nodes}
        ends = [(state[node], after[node])]
        ends += [(moved[name][node], moved_after[name][node]) for name in tangents]
        totals = [
            total + weight * (a + position * (b - a))
            for total, (a, b) in zip(totals, ends, strict=True)
        ]
        return ((after, moved_after), totals), None

    def block(before, x):
        nothing = [jnp.zeros_like(step) for _ in range(1 + len(tangents))]
        (after, totals), _ = jax.lax.scan(advance, (before, nothing), x)
        return after, totals

    _, means = jax.lax.scan(block, first, xs)
    seen = jnp.sum(rows.weight, axis=1)
    return means[0] - model.coefficient * seen, dict(zip(tangents, means[1:], strict=True))


def _packed(*trees: Any) -> tuple[Float[Array, "coefficient lane"], Any]:
    """Return the leaves of some trees in one array, and what makes trees of such an array."""
    leaves, form = jax.tree.flatten(trees)

    def unpacked(packed: Array) -> Any:
        return jax.tree.unflatten(form, [packed[i] for i in range(len(leaves))])

    return jnp.stack(leaves), unpacked


def _without(terms: Mapping[Term, Array], drive: str) -> dict[Term, Array]:
    return {key: v for key, v in terms.items() if key[0] != "drive" or key[2] != drive}


def _polynomials(terms: Mapping[Term, Array], kind: str, square: Lane) -> dict[Term, Array]:
    """Return the coefficients of a kind at a squared current, by row and column or drive."""
    powers: dict[Term, dict[int, Array]] = {}
    for key, value in terms.items():
        if key[0] == kind:
            powers.setdefault(key[1:3], {})[int(key[3])] = value
    return {
        key: horner([of.get(power) for power in range(max(of) + 1)], square)
        for key, of in powers.items()
    }


def _linear(
    matrix: Mapping[Term, Array],
    forces: Mapping[Term, Array],
    state: Mapping[str, Array],
    inputs: Mapping[str, Array],
    nodes: tuple[str, ...],
) -> dict[str, Any]:
    """Return the product of a matrix with a state, plus what the drive adds."""
    parts: dict[str, list[Any]] = {node: [] for node in nodes}
    for (row, column), value in matrix.items():
        parts[row].append(value * state[column])
    for (row, name), value in forces.items():
        if name in inputs:
            parts[row].append(value * inputs[name])
        elif name in ("", "shaft_offset"):
            parts[row].append(value)
    return {node: reduce(add, each) if each else 0.0 for node, each in parts.items()}
