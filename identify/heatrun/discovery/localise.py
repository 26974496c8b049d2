"""Where simulation and measurement disagree: missing heat over time, estimated with the rest.

The heat that the model lacks in winding and stator, and an error of the reading, are latent
Gauss-Markov courses. They are estimated jointly with the network's parameters: a network that
has already absorbed half of a cause would put the blame on the wrong node. How strong each course
is, and over how long it holds, is decided by the evidence; a course that the data do not call for
comes out as zero.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from lptn import Inputs, Trace
from lptn.effects import SensorEffect, extended
from lptn.march import heat_effects
from lptn.network import lagged
from lptn.stepping import heat_balance, rates

from ..effects.engine import Engine, Refit
from ..io.programs import compiled
from ..model.model import Model, Values
from ..record.blocks import Blocks

SENSOR = "sensor"
"""Name that an error of the reading goes by, beside the names of the nodes."""


@dataclass(frozen=True)
class Response:
    """Derivatives of the block means of one test."""

    # Times at which the heat is given; between them it runs straight [s], shape (knot,).
    knots: Float[np.ndarray, " knot"]
    # By node: derivative of the block means by the heat at each knot [K/W], shape (block, knot), of
    # the winding and then of each body that is fitted; for `SENSOR` by the error of the winding's
    # reading [K/K].
    columns: dict[str, Float[np.ndarray, "block knot"]]
    rise: Float[np.ndarray, " block"]  # Winding above the sink, mean over each block [K].


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


@compiled("model", is_seldom=True)
def _linear_jit(model: Model, values: Values, inputs: Inputs):
    trace: Trace = model.simulate(values, inputs)
    effects = model.built_effects(values)
    network = extended(model.network(values), effects)
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
    A: np.ndarray, step: float, heated: dict[str, int], capacity: dict[str, float], hats: np.ndarray
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


SPACING_S = 120.0
"""Time between knots [s]: about the fast time constant of a winding, under which no thermometer
resolves heat."""

MOST_KNOTS = 90
"""Knots of one test; longer tests get wider spacing."""

STRENGTHS_W = (0.003, 0.01, 0.03, 0.1)
"""Strengths of missing heat that are tried, in parts of the largest loss [1]."""

STRENGTHS_K = (0.1, 0.3, 1.0)
"""Strengths of an error of the reading that are tried [K]."""

TIMES_S = (300.0, 1200.0)
"""Correlation times that are tried [s]."""

SPAN_SD = 2.0
"""A span runs as long as its heat is this many standard deviations from none [1]."""

CLEAR_SD = 3.3
"""And counts if its mean is this many away: 0.1 % two-sided, for some fifty spans per test."""


OCCAM = 3.0
"""Log Bayes factor from which on a course counts as called for [nat]."""


@dataclass(frozen=True)
class Course:
    """What is missing at one node over one test."""

    test: int  # Index of the test.
    node: str  # Node, or `"sensor"`.
    time_s: Float[np.ndarray, " knot"]  # Times of the knots [s].
    mean: Float[np.ndarray, " knot"]  # Missing heat [W], or error of the reading [K].
    sd: Float[np.ndarray, " knot"]  # Its standard deviation.
    covariance: Float[np.ndarray, "knot knot"]  # Of the knots.

    @property
    def unit(self) -> str:
        """Unit of the course."""
        return "K" if self.node == SENSOR else "W"


@dataclass(frozen=True)
class Span:
    """A stretch of time in which something is missing."""

    test: str  # Name of the test.
    from_s: float  # Its begin [s].
    to_s: float  # Its end [s].
    node: str  # Node, or `"sensor"`.
    missing: float  # Mean missing heat [W], or error of the reading [K].
    interval_95: tuple[float, float]  # Its 95 % interval.


@dataclass(frozen=True)
class Where:
    """What is missing, where and when."""

    courses: list[Course]  # By test and node.
    spans: list[Span]  # The significant ones, by test and time.
    log_evidence: dict[str, float]  # Of each set of nodes, relative to none [nat].
    node: tuple[str, ...]  # Set of nodes that the evidence favours; empty if nothing is missing.
    # Correlation of the missing heat with what drives it, by node and driver [1].
    dependence: dict[str, dict[str, float]]


def localise(engine: Engine, present: Refit, model: Model) -> Where:
    """Return where a model lacks heat or reads wrongly."""
    responses = []
    for index, test in enumerate(engine.tests):
        numbers, _ = engine.values(present.z, index)
        values = {name: jnp.asarray(number) for name, number in numbers.items()}
        spacing = max(SPACING_S, test.duration_s / MOST_KNOTS)
        responses.append(respond(model, values, test, spacing))
    solve = _Solver(engine, present, responses)
    best, table = _most_evident(solve, engine)
    courses = solve.courses(best) if best else []
    spans = [span for course in courses for span in _spans(course, engine.tests[course.test].name)]
    spans.sort(key=lambda span: (span.test, span.from_s))
    dependence = _dependence(engine, courses, responses)
    return Where(courses, spans, table, tuple(node for node, _, _ in best), dependence)


Setting = tuple[str, float, float]
"""Node, strength [W or K], correlation time [s]."""


class _Solver:
    """The linear problem in parameters and courses, whitened once."""

    def __init__(self, engine: Engine, present: Refit, responses: list[Response]) -> None:
        self.responses = responses
        self.nodes = list(responses[0].columns)
        noise = present.noise
        self.r = engine.whiten(noise, present.residual)
        self.A = engine.whiten(noise, present.jacobian)
        self.z = present.z[list(present.free)]
        self.columns = {
            node: engine.whiten(noise, _block_diagonal([r.columns[node] for r in responses]))
            for node in self.nodes
        }

    def evidence(self, settings: tuple[Setting, ...]) -> float:
        """Return the log evidence [nat], up to a constant that all settings share."""
        chol, rhs, _ = self._system(settings)
        half = np.linalg.solve(chol, rhs)
        return float(0.5 * half @ half - np.sum(np.log(np.diag(chol))))

    def courses(self, settings: tuple[Setting, ...]) -> list[Course]:
        """Return the courses at their posterior."""
        chol, rhs, roots = self._system(settings)
        inverse = np.linalg.inv(chol)
        covariance = inverse.T @ inverse
        mean = covariance @ rhs
        result, first = [], self.A.shape[1]
        for (node, _, _), parts in zip(settings, roots, strict=True):
            for test, root in enumerate(parts):
                span = slice(first, first + root.shape[0])
                spread = root @ covariance[span, span] @ root.T
                result.append(
                    Course(
                        test, node, self.responses[test].knots, root @ mean[span],
                        np.sqrt(np.diag(spread)), spread,
                    )
                )  # fmt: skip
                first += root.shape[0]
        return result

    def _system(self, settings):
        """Return Cholesky factor of the precision, right side, and prior roots."""
        columns, roots = [self.A], []
        for node, strength, time in settings:
            parts = [_root(response.knots, strength, time) for response in self.responses]
            columns.append(self.columns[node] @ _block_diagonal(parts))
            roots.append(parts)
        H = np.concatenate(columns, axis=1)
        # the residual falls with the modelled reading: r + A dz - H q is to vanish
        H[:, : self.z.size] *= -1.0
        rhs = H.T @ self.r
        rhs[: self.z.size] -= self.z
        return np.linalg.cholesky(H.T @ H + np.eye(H.shape[1])), rhs, roots


def _most_evident(solve: _Solver, engine: Engine) -> tuple[tuple[Setting, ...], dict[str, float]]:
    """Return the best setting, and the best evidence of each set of nodes over none."""
    largest = max(float(np.max(np.abs(test.inputs.losses))) for test in engine.tests)
    choices: dict[str, list[Setting]] = {}
    for node in solve.nodes:
        strengths = STRENGTHS_K if node == SENSOR else tuple(s * largest for s in STRENGTHS_W)
        choices[node] = [(node, s, t) for s in strengths for t in TIMES_S]
    none = solve.evidence(())
    table: dict[str, float] = {}
    best: tuple[tuple[Setting, ...], float] = ((), 0.0)
    alone: dict[str, Setting] = {}
    for node, options in choices.items():
        found = max(options, key=lambda option: solve.evidence((option,)))
        alone[node] = found
        table[node] = solve.evidence((found,)) - none
        if table[node] > best[1]:
            best = ((found,), table[node])
    for one, two in itertools.combinations(choices, 2):
        pairs = [(a, alone[two]) for a in choices[one]] + [(alone[one], b) for b in choices[two]]
        found = max(pairs, key=solve.evidence)
        value = solve.evidence(found) - none
        table[f"{one}+{two}"] = value
        if value > best[1] + OCCAM:
            best = (found, value)
    return (best[0] if best[1] > OCCAM else ()), table


def _root(knots: np.ndarray, strength: float, time: float) -> np.ndarray:
    """Return the Cholesky factor of a Gauss-Markov course at the knots."""
    phi = float(np.exp(-(knots[1] - knots[0]) / time))
    lag = np.subtract.outer(np.arange(knots.size), np.arange(knots.size))
    root = np.where(lag >= 0, np.sqrt(1.0 - phi**2) * phi ** np.maximum(lag, 0), 0.0)
    root[:, 0] = phi ** np.arange(knots.size)
    return strength * root


def _block_diagonal(parts: list[np.ndarray]) -> np.ndarray:
    rows, columns = sum(p.shape[0] for p in parts), sum(p.shape[1] for p in parts)
    result = np.zeros((rows, columns))
    row = column = 0
    for part in parts:
        result[row : row + part.shape[0], column : column + part.shape[1]] = part
        row, column = row + part.shape[0], column + part.shape[1]
    return result


def _spans(course: Course, test: str) -> list[Span]:
    """Return the significant stretches of a course."""
    level = course.mean / np.maximum(course.sd, 1e-300)
    result, start = [], 0
    num = level.size
    while start < num:
        if abs(level[start]) < SPAN_SD:
            start += 1
            continue
        end = start
        while end + 1 < num and level[end + 1] * level[start] > 0 and abs(level[end + 1]) > SPAN_SD:
            end += 1
        weights = np.zeros(num)
        weights[start : end + 1] = 1.0 / (end + 1 - start)
        mean = float(weights @ course.mean)
        sd = float(np.sqrt(weights @ course.covariance @ weights))
        if abs(mean) > CLEAR_SD * sd:
            half = 0.5 * float(course.time_s[1] - course.time_s[0])
            result.append(
                Span(
                    test,
                    max(0.0, float(course.time_s[start]) - half),
                    min(float(course.time_s[-1]), float(course.time_s[end]) + half),
                    course.node, mean, (mean - 1.96 * sd, mean + 1.96 * sd),
                )
            )  # fmt: skip
        start = end + 1
    return result


def _dependence(
    engine: Engine, courses: list[Course], responses: list[Response]
) -> dict[str, dict[str, float]]:
    """Return correlations of the missing heat with speed, current, rise and time."""
    result: dict[str, dict[str, float]] = {}
    for node in dict.fromkeys(course.node for course in courses):
        drivers: dict[str, list[np.ndarray]] = {}
        values = []
        for course in courses:
            if course.node != node:
                continue
            test = engine.tests[course.test]
            middle = float(test.inputs.step) * (np.arange(test.inputs.num_time) + 0.5)
            blocks = test.block_s * (np.arange(test.num_blocks) + 0.5)
            values.append(course.mean)
            series = {
                "current_squared": (middle, np.asarray(test.inputs.current_squared)),
                "rise": (blocks, responses[course.test].rise),
                "time": (middle, middle),
            }
            if test.inputs.speed is not None:
                series["speed"] = (middle, np.abs(np.asarray(test.inputs.speed)))
            width = float(course.time_s[1] - course.time_s[0])
            for name, (time, driver) in series.items():
                drivers.setdefault(name, []).append(_around(course.time_s, width, time, driver))
        y = np.concatenate(values)
        result[node] = {}
        for name, parts in drivers.items():
            x = np.concatenate(parts)
            if len(parts) == len(values) and np.std(x) > 0 and np.std(y) > 0:
                result[node][name] = float(np.corrcoef(x, y)[0, 1])
    return result


def _around(knots: np.ndarray, width: float, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the means of a series around each knot."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    low = np.searchsorted(time, knots - 0.5 * width)
    high = np.maximum(np.searchsorted(time, knots + 0.5 * width), low + 1)
    high = np.minimum(high, time.size)
    low = np.minimum(low, high - 1)
    return (total[high] - total[low]) / (high - low)
