"""The march of a bare network and its derivatives, for many machines side by side.

The numbers are those of `lptn.simulate`; the loop is another, because a batch that is mapped
over the general one runs five times slower. Three things make it fast:

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

import jax
import jax.numpy as jnp
from jax.extend.core import Literal
from jaxtyping import Array, Float

from heatrun.inference.model import Model
from lptn.stepping import affine_terms, horner

from .machines import Group, Lane

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
    """A march that is ready to be made: of temperatures and their derivatives by quantity.

    Attributes:
        names: The quantities.
        first: The state at the start.
        advance: Returns the state a step later, for a state and the inputs of the step.
        inputs: Of all steps, shape (block, step, lane) each.
        read: Returns the measured node's temperature above the copper's zero of resistance [K], and
            its derivative by each quantity.
    """

    names: tuple[str, ...]
    first: Any
    advance: Callable[[Any, Any], Any]
    inputs: Any
    read: Callable[[Any], list[Lane]]


def moving(model: Model, rows: Group, quantities: Values, free: list[str]) -> Moving:
    """Return the march through tests.

    Args:
        model: A bare network.
        rows: The tests.
        quantities: What the parameters act through, by name, for each lane.
        free: Names of those that derivatives are wanted by.
    """
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

    return Moving(tuple(tangents), first, advance, (rows.current_squared, drive), read)


def march(
    model: Model, rows: Group, quantities: Values, free: list[str]
) -> tuple[Float[Array, "block lane"], dict[str, Float[Array, "block lane"]]]:
    """Return block means of the measured node [degC] and their derivatives by quantity.

    Args:
        model: As `moving`.
        rows: Likewise.
        quantities: Likewise.
        free: Likewise.
    """
    march = moving(model, rows, quantities, free)

    def advance(before, x):
        state, totals = before
        inputs, weight, position = x
        after = march.advance(state, inputs)
        ends = zip(totals, march.read(state), march.read(after), strict=True)
        return (after, [t + weight * (a + position * (b - a)) for t, a, b in ends]), None

    def block(before, x):
        nothing = [jnp.zeros_like(rows.step) for _ in range(1 + len(march.names))]
        (after, totals), _ = jax.lax.scan(advance, (before, nothing), x)
        return after, totals

    _, means = jax.lax.scan(block, march.first, (march.inputs, rows.weight, rows.position))
    seen = jnp.sum(rows.weight, axis=1)
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
