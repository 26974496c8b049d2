"""The march of a bare network and its derivatives, for many machines side by side.

Machines (lanes) stand in the trailing axis of all arrays. Tests of one padded shape are lanes
beside each other too: a lane is a test of a machine, and those of the first test come first.

The numbers are those of `lptn.block_means`; the loop is another. Of 32 machines with two tests of
two hours each, residuals and Jacobian take 0.16 ms a machine here. The general march mapped over
machines takes 0.38 to 0.5 ms with directions outside machines, 0.5 the other way round, 0.5 one
machine after the other; where readings may be late 0.3 ms here, and 3.1, 3.4 and 1.1 there. As a
custom derivative of the general march this loop takes 0.26 to 0.33 ms mapped, and of one machine
1.4 times what the general one does, so neither does the other's work. (One core, in turns.) All
that comes after the residuals, noise, unmodelled heat and the spread, is the code of one machine.
Three things make it fast:

- The step is affine in the temperatures, with coefficients that are polynomials of the squared
  current (`lptn.stepping.AffineTerms`), and so are its derivatives: they are worked out once for
  each network, and those that vanish by structure are left out of the loop.
- The parameters act through fewer quantities: the phase resistance and the error of the current
  through one slope of the copper loss. Only these quantities have a tangent in the loop.
- Gain and offset of the sensor act on the block means, not on the steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce
from operator import add
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.extend.core import Literal
from jaxtyping import Array, Float

from heatrun.io.programs import compiled
from heatrun.model.model import Model
from heatrun.model.problem import Priors
from heatrun.record.observation import Observation
from lptn import Inputs
from lptn.stepping import affine_terms, horner

Lane = Float[Array, " lane"]


class Group(eqx.Module):
    """Tests of one padded shape, of each machine; a lane for each test of each machine."""

    # Indices of the tests; the lanes of the first come first.
    tests: tuple[int, ...] = eqx.field(static=True)
    rows: Observation  # All its arrays with a lane behind their own axes.
    sink: Float[Array, "block lane"]  # Mean of the sink at the samples of each block [degC].

    def of_steps(self, name: str) -> Float[Array, "block step lane"] | None:
        """Return an input of the steps, by its name in `Inputs`; None where there is none."""
        values = getattr(self.rows.inputs, name)
        return None if values is None else values.reshape(self.rows.weight.shape)

    def by_lane(self, values: Float[Array, "*axes machine"]) -> Float[Array, "*axes lane"]:
        """Return values of the machines for the lanes of their tests."""
        return jnp.concatenate([values] * len(self.tests), axis=-1)

    def by_test(self, values: Float[Array, "*axes lane"]) -> list[Float[Array, "*axes machine"]]:
        """Return values of the lanes for each test."""
        return jnp.split(values, len(self.tests), axis=-1)


class Machines(eqx.Module):
    """The numbers of many problems of one structure, as `heatrun.model.problem.Data` has those of
    one, with an axis of the machines behind all others.
    """

    priors: Priors
    groups: tuple[Group, ...]


SLOPE = "slope of the copper loss"
"""Name of k over the squared current [W/(K A^2)], through which Rs0 and the current's error act."""

Values = Mapping[str, Lane]

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


class Moving(NamedTuple):
    """A march that is ready to be made: of temperatures and their derivatives by quantity."""

    names: tuple[str, ...]  # The quantities.
    first: Any  # The state at the start.
    # Returns the state a step later, for a state and the inputs of the step.
    advance: Callable[[Any, Any], Any]
    inputs: Any  # Of all steps.
    # Returns the measured node's temperature above the copper's zero of resistance [K], and its
    # derivative by each quantity.
    read: Callable[[Any], list[Lane]]


def moving(model: Model, group: Group, quantities: Values, free: list[str]) -> Moving:
    """Return the march of a bare network through tests.

    The parameters act through the quantities; derivatives are wanted by those that are free.
    """
    step = group.rows.inputs.step
    terms = _terms(model, quantities, step)
    dependence = _dependence(model, tuple(quantities), step.shape[0])
    node = model.form.measured_node
    nodes = model.form.nodes

    tangents = _tangents(model, quantities, free, step, dependence)

    used = {key[2] for key in terms if key[0] == "drive"} - {"", "shaft_offset"}
    found = {name: group.of_steps(name.removesuffix("_rad")) for name in used}
    drive = {name: values for name, values in found.items() if values is not None}
    if group.rows.inputs.shaft_power is None:
        terms, tangents = _without(terms, "shaft_offset"), {
            name: _without(each, "shaft_offset") for name, each in tangents.items()
        }  # fmt: skip

    def started(of: Mapping[Term, Array]) -> dict[str, Array]:
        zero = jnp.zeros_like(step)
        return {each: of.get(("start", each), zero) for each in nodes}

    first = started(terms), {name: started(each) for name, each in tangents.items()}

    # one array for all coefficients: as operands of the loop each takes its time to compile
    packed, unpacked = _packed(terms, tangents)

    def advance(before, x):
        state, moved = before
        square, inputs = x
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
        return after, moved_after

    def read(state):
        temperature, moved = state
        return [temperature[node], *(moved[name][node] for name in tangents)]

    return Moving(tuple(tangents), first, advance, (group.of_steps("current_squared"), drive), read)


def march(
    model: Model, group: Group, quantities: Values, free: list[str]
) -> tuple[Float[Array, "block lane"], dict[str, Float[Array, "block lane"]]]:
    """Return block means of the measured node [degC] and their derivatives by quantity."""
    march = moving(model, group, quantities, free)

    def advance(before, x):
        state, totals = before
        inputs, weight, position = x
        after = march.advance(state, inputs)
        ends = zip(totals, march.read(state), march.read(after), strict=True)
        return (after, [t + weight * (a + position * (b - a)) for t, a, b in ends]), None

    def block(before, x):
        nothing = [jnp.zeros_like(group.rows.inputs.step) for _ in range(1 + len(march.names))]
        (after, totals), _ = jax.lax.scan(advance, (before, nothing), x)
        return after, totals

    _, means = jax.lax.scan(
        block, march.first, (march.inputs, group.rows.weight, group.rows.position)
    )
    seen = jnp.sum(group.rows.weight, axis=1)
    return means[0] - model.coefficient * seen, dict(zip(march.names, means[1:], strict=True))


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


SIDE_S = 1e-9
"""Puts no shift on the side from which `lptn.effects.TimeShift` has its slope [s]."""


class _Shift(NamedTuple):
    """How much of its neighbours an edge takes on [1], and the length of a step [s]."""

    back: Lane
    ahead: Lane
    step: Lane

    @classmethod
    def of(cls, late_s: Lane, step: Lane) -> _Shift:
        """Return that of readings so late [s]."""
        steps = (late_s + SIDE_S) / step
        return cls(jnp.maximum(steps, 0.0), jnp.maximum(-steps, 0.0), step)

    def edge(self, before: Array, now: Array, after: Array) -> Array:
        """Return what is read in place of an edge."""
        return now + self.back * (before - now) + self.ahead * (after - now)

    def by_time(self, before: Array, now: Array, after: Array) -> Array:
        """Return the derivative of that by the time."""
        return jnp.where(self.ahead > 0.0, now - after, before - now) / self.step


def late_means(
    model: Model, group: Group, quantities: Values, free: list[str], late_s: Lane
) -> tuple[Array, dict[str, Array], Array, Array, Array]:
    """Return block means of tests whose readings are late and their derivatives by quantity, as
    `march`, those of the sink [degC], and the derivatives of both by the time [K/s].

    A logger of the load that is too slow to tell when a step came moves the whole reading by a time
    of its own in each test, straight between the edges of the steps. Here it moves by a step at
    most: then a shifted edge needs its two neighbours alone, and the march is still made once. If
    it is later than a step of the march, the straight line is prolonged.
    """
    march = moving(model, group, quantities, free)
    shift = _Shift.of(late_s, group.rows.inputs.step)
    # an edge is read when the one after it is known: one step is made before the first is read
    once = jax.tree.map(lambda values: values[0, 0], march.inputs)
    following = jax.tree.map(_one_ahead, march.inputs)
    second = march.advance(march.first, once)
    begin, then = march.read(march.first), march.read(second)

    def edges(before, now, after):
        own = [shift.edge(*each) for each in zip(before, now, after, strict=True)]
        return [*own, shift.by_time(before[0], now[0], after[0])]

    def advance(before, x):
        state, last, read, totals = before
        inputs, weight, position = x
        after = march.advance(state, inputs)
        now = march.read(state)
        here = edges(last, now, march.read(after))
        ends = zip(totals, read, here, strict=True)
        totals = [t + weight * (a + position * (b - a)) for t, a, b in ends]
        return (after, now, here, totals), None

    def block(before, x):
        nothing = [jnp.zeros_like(group.rows.inputs.step) for _ in range(2 + len(march.names))]
        (*after, totals), _ = jax.lax.scan(advance, (*before, nothing), x)
        return tuple(after), totals

    start = second, begin, edges(begin, begin, then)
    xs = following, group.rows.weight, group.rows.position
    found: Any = jax.lax.scan(block, start, xs)[1]
    temperature, *slopes, by_time = found
    sink, sink_by_time = _sink(group, shift)
    temperature = temperature - model.coefficient * jnp.sum(group.rows.weight, axis=1)
    of_names = dict(zip(march.names, slopes, strict=True))
    return temperature, of_names, sink, by_time, sink_by_time


def _sink(group: Group, shift: _Shift) -> tuple[Array, Array]:
    """Return block means of the sink read late [degC], and their derivatives by the time."""
    edges = _sink_at_edges(group.rows)
    back = jnp.concatenate([edges[:1], edges[:-1]])
    ahead = jnp.concatenate([edges[1:], edges[-1:]])
    return (
        _means(shift.edge(back, edges, ahead), group.rows),
        _means(shift.by_time(back, edges, ahead), group.rows),
    )


def _sink_at_edges(rows: Observation) -> Float[Array, "edge lane"]:
    return jax.vmap(Inputs.ambient_at_edges, in_axes=-1, out_axes=-1)(rows.inputs)


@compiled()
def sink_means(rows: Observation) -> Float[Array, "block lane"]:
    """Return the mean of the sink at the samples of each block [degC]."""
    return _means(_sink_at_edges(rows), rows)


def _means(edges: Float[Array, "edge lane"], rows: Observation) -> Float[Array, "block lane"]:
    before, after = (each.reshape(rows.weight.shape) for each in (edges[:-1], edges[1:]))
    return jnp.sum(rows.weight * (before + rows.position * (after - before)), axis=1)


def _one_ahead(values: Float[Array, "block step lane"]) -> Float[Array, "block step lane"]:
    """Return the inputs of the next step in place of each; the last one stays."""
    steps = values.reshape(-1, values.shape[-1])
    return jnp.concatenate([steps[1:], steps[-1:]]).reshape(values.shape)
