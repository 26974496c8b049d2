"""The fit of many machines: what `heatrun.fit.fit` does for one, in batches of one width.

Machines whose problems have one structure and tests of one padded shape share compiled programs, as
many machines at a time as a batch is wide; empty places are filled with copies of the last one.
Tests are padded to a few lengths with blocks that hold no reading. So nothing is compiled for a
number of machines, and memory is that of a batch. A machine that the batch has doubts about comes
back as `NotBatched`, for the fit of one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from heatrun.fit.fit import (
    DISTINCT,
    NUM_STARTS,
    RIVAL,
    ROUGH_K,
    SAME_OPTIMUM,
    SETTLED,
    implied_level,
    low_frequency_excess,
    misfit_findings,
    start_scores,
)
from heatrun.fit.fit_result import RESULT, Fit
from heatrun.fit.restricted import laplace
from heatrun.io.programs import compiled, refuse_wrong_sums
from heatrun.model.discrepancy import num_knots
from heatrun.model.noise import Noise, from_scores
from heatrun.model.parameters import Parameter
from heatrun.model.problem import Problem, Structure
from heatrun.posterior.driven import STABLE
from heatrun.record.blocks import Blocks

from .march import Group, Machines
from .residuals import most_knots
from .search import Optima, begun, continued, linearise, on_host, optima_from_starts
from .settle import Settled, final, settle

BUCKETS = (96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048, 3072, 4096)
"""Lengths [blocks] that tests are padded to: at most a third is padding from 128 on. The longest
holds 22 hours of blocks of 20 s."""

MUCH_SHORTER = 2
"""Times that a test fits into the longest one of its machine, for a shape of its own."""

CHANNELS = ("second_sink", "shaft_power", "speed")


class NotBatched(NamedTuple):
    """Why a machine was left to the full job.

    Attributes:
        reason: In a few words.
    """

    reason: str


class Key(NamedTuple):
    """What is compiled.

    Attributes:
        structure: The model and what stands in which slot.
        groups: Padded number of blocks, steps per block, and the tests of that shape.
        channels: Those of `CHANNELS` that enter.
        fixed: Names of the fixed values.
    """

    structure: Structure
    groups: tuple[tuple[int, int, tuple[int, ...]], ...]
    channels: tuple[str, ...]
    fixed: tuple[str, ...]


def why_not(problem: Problem) -> str:
    """Return why a problem is none for the batch; empty where it is one."""
    model, names = problem.model, {name for name, _, _ in problem.structure.form}
    if model.effects or model.form.by_speed:
        return "the network has effects"
    if model.change_sd:
        return "its parameters change from test to test"
    if any(test.fitted for test in problem.tests):
        return "bodies beside the winding were measured"
    if len({logger for test in problem.tests for logger in test.loggers}) > 1:
        return "its tests were recorded with unlike loggers"
    if any(test.told for test in problem.tests):
        return "the inputs of a test tell its instruments"
    if any(np.ndim(test.inputs.step) for test in problem.tests):
        return "the steps of a test are unequal"
    if any(test.num_blocks > BUCKETS[-1] for test in problem.tests):
        return f"a test has more than {BUCKETS[-1]} blocks"
    if any(num_knots(t.duration_s) > most_knots(bucket(t.num_blocks)) for t in problem.tests):
        return "its blocks are long"
    if not names:
        return "nothing is to be estimated"
    if len({(frozenset(own), _fixed(own)) for own in problem.parameters.by_test}) > 1:
        return "its tests have unlike parameters"
    if any(not np.any(test.is_observed) for test in problem.tests):
        return "a test holds no reading"
    return ""


def key_of(problem: Problem) -> Key:
    """Return what is compiled for a problem."""
    names = {name for of_test in problem.parameters.by_test for name in of_test}
    channels = []
    if problem.model.form.second_sink:
        channels.append("second_sink")
    if names & {"shaft_power_gain", "shaft_power_offset"}:
        channels.append("shaft_power")
    if "torque_offset" in names:
        channels.append("speed")
    shapes = _shapes(problem.tests)
    groups = tuple(
        (*shape, tuple(i for i, own in enumerate(shapes) if own == shape))
        for shape in dict.fromkeys(shapes)
    )
    return Key(problem.structure, groups, tuple(channels), _fixed(problem.parameters.by_test[0]))


def _fixed(parameters: Mapping[str, Parameter]) -> tuple[str, ...]:
    return tuple(name for name, parameter in parameters.items() if parameter.fixed is not None)


def _shapes(tests: Sequence[Blocks]) -> list[tuple[int, int]]:
    """Return padded number of blocks and steps per block of each test.

    Tests that are not much shorter than the longest are padded to its length: each further shape
    takes as long to compile as the first.
    """
    longest: dict[int, int] = {}
    for test in tests:
        steps = test.weight.shape[1]
        longest[steps] = max(longest.get(steps, 0), bucket(test.num_blocks))
    shapes = []
    for test in tests:
        steps = test.weight.shape[1]
        is_short = MUCH_SHORTER * bucket(test.num_blocks) < longest[steps]
        shapes.append((bucket(test.num_blocks) if is_short else longest[steps], steps))
    return shapes


def bucket(num_blocks: int) -> int:
    """Return the padded length of a test [blocks]."""
    return next(size for size in BUCKETS if size >= num_blocks)


def pack(key: Key, problems: Sequence[Problem]) -> Machines:
    """Return the numbers of problems of one key, a lane for each."""
    slots = [problem.parameters.slots for problem in problems]
    return Machines(
        centre=jnp.asarray([[s.parameter.centre for s in each] for each in slots]).T,
        sd=jnp.asarray([[s.parameter.sd for s in each] for each in slots]).T,
        groups=tuple(_pack_group(key, problems, *group) for group in key.groups),
    )


def _pack_group(
    key: Key, problems: Sequence[Problem], size: int, steps: int, indices: tuple[int, ...]
) -> Group:
    tests = [problem.tests[index] for index in indices for problem in problems]

    def lanes(rows: Sequence[np.ndarray]) -> jnp.ndarray:
        joined = np.zeros((len(rows), size, *np.shape(rows[0])[1:]), dtype=rows[0].dtype)
        for lane, each in enumerate(rows):
            joined[lane, : each.shape[0]] = each
        return _lanes_last(joined)

    def of_steps(name: str) -> jnp.ndarray:
        return lanes([np.asarray(getattr(t.inputs, name)).reshape(-1, steps) for t in tests])

    def numbers(values: Sequence[float]) -> jnp.ndarray:
        return jnp.asarray(np.array(values, dtype=float))

    channels = {name: of_steps(name) if name in key.channels else None for name in CHANNELS}
    fixed = {
        name: numbers([
            p.parameters.by_test[index][name].fixed or 0.0 for index in indices for p in problems
        ])
        for name in key.fixed
    }  # fmt: skip
    return Group(
        tests=indices,
        step=numbers([float(test.inputs.step) for test in tests]),
        current_squared=of_steps("current_squared"),
        losses=of_steps("losses"),
        ambient=of_steps("ambient"),
        weight=lanes([test.weight for test in tests]),
        position=lanes([test.position for test in tests]),
        sensed_ambient=lanes([sensed_ambient(test) for test in tests]),
        measured=lanes([np.nan_to_num(test.measured) for test in tests]),
        is_observed=lanes([test.is_observed for test in tests]),
        count=lanes([np.asarray(test.count, dtype=float) for test in tests]),
        known_variance=lanes([test.known_variance for test in tests]),
        moments=lanes(_moments(tests)),
        block_s=numbers([test.block_s for test in tests]),
        num_blocks=numbers([test.num_blocks for test in tests]),
        num_knots=numbers([num_knots(test.duration_s) for test in tests]),
        mean_losses=numbers([float(np.mean(np.asarray(t.inputs.losses))) for t in tests]),
        mean_current_squared=numbers([
            float(np.mean(np.asarray(t.inputs.current_squared))) for t in tests
        ]),
        fixed=fixed,
        **channels,
    )  # fmt: skip


def _moments(tests: Sequence[Blocks]) -> list[np.ndarray]:
    """Return `Blocks.moments` of tests, with as many columns for each; 0 where there is none."""
    most = max(test.moments.shape[1] for test in tests)
    return [np.pad(m, ((0, 0), (0, most - m.shape[1]))) for m in (t.moments for t in tests)]


@compiled()
def _lanes_last(rows: Array) -> Array:
    return jnp.moveaxis(rows, 0, -1)


def sensed_ambient(test: Blocks) -> np.ndarray:
    """Return the mean of the sink over the samples of each block [degC], shape (block,).

    It runs straight between the edges of the steps, where it is the mean of its neighbours.
    """
    values = np.asarray(test.inputs.ambient)
    inner = 0.5 * (values[1:] + values[:-1])
    edges = np.concatenate([values[:1], inner, values[-1:]])
    before, after = edges[:-1].reshape(test.weight.shape), edges[1:].reshape(test.weight.shape)
    return np.sum(test.weight * (before + test.position * (after - before)), axis=1)


WIDTH = 32
"""Machines in a batch: their numbers in a step of the march fill the processor's first caches. A
device with thousands of lanes wants thousands."""

Found = Fit | NotBatched


class _Level(NamedTuple):
    """The white level [K] that the residuals of a machine ask to be searched with."""

    level: float


class _Job(NamedTuple):
    """A machine that waits for its batch.

    Attributes:
        place: Its place among the problems.
        problem: Model and tests.
        level: White level of the search from many starts [K].
    """

    place: int
    problem: Problem
    level: float


def fit_batch(
    problems: Sequence[Problem],
    *,
    num_starts: int = NUM_STARTS,
    seed: int = 0,
    width: int = WIDTH,
) -> list[Found]:
    """Fit a model to the tests of each of many machines.

    Args:
        problems: Model and tests of each machine; as many as there is memory for.
        num_starts: As `heatrun.fit.fit.fit`.
        seed: Likewise.
        width: Machines in a batch.

    Returns:
        In the order of the problems, the fit that `fit` returns for each, or why it was left to
        that.
    """
    found: list[Found | None] = [None] * len(problems)
    for place, result in fits(enumerate(problems), num_starts=num_starts, seed=seed, width=width):
        found[place] = result
    assert all(result is not None for result in found)
    return [result for result in found if result is not None]


def fits(
    problems: Iterable[tuple[int, Problem]],
    *,
    num_starts: int = NUM_STARTS,
    seed: int = 0,
    width: int = WIDTH,
) -> Iterator[tuple[int, Found]]:
    """Yield fits as their batches are done, with their places; arguments as `fit_batch`.

    Problems are taken one at a time, and none is held beyond its batch; what is held is at most a
    batch that is not yet full for each kind of problem.
    """
    refuse_wrong_sums()
    waiting: dict[tuple[Key, bool], list[_Job]] = {}

    def done(kind: tuple[Key, bool]) -> Iterator[tuple[int, Found]]:
        jobs = waiting.pop(kind)
        for job, result in zip(
            jobs, _fit_jobs(kind[0], jobs, num_starts, seed, width), strict=True
        ):
            if isinstance(result, _Level):
                again = kind[0], True
                waiting.setdefault(again, []).append(job._replace(level=result.level))
                if len(waiting[again]) == width:
                    yield from done(again)
            else:
                yield job.place, result

    for place, problem in problems:
        if reason := why_not(problem):
            yield place, NotBatched(reason)
            continue
        kind = key_of(problem), False
        waiting.setdefault(kind, []).append(_Job(place, problem, ROUGH_K))
        if len(waiting[kind]) == width:
            yield from done(kind)
    while waiting:
        yield from done(next(iter(waiting)))


def _fit_jobs(
    key: Key, jobs: Sequence[_Job], num_starts: int, seed: int, width: int
) -> list[Found | _Level]:
    """Return the fit of each machine of a batch, or the white level [K] that it asks for."""
    filled = [*jobs, *[jobs[-1]] * (width - len(jobs))]
    machines = pack(key, [job.problem for job in filled])
    levels = jnp.asarray([job.level for job in filled])
    nothing = jnp.zeros(width)
    white = Noise(nothing, nothing + 1.0, levels, nothing)
    starts = start_scores(jobs[0].problem, num_starts, seed)
    is_wanted = np.arange(width) < len(jobs)
    optima = optima_from_starts(key.structure, machines, starts, white, is_wanted)
    z = np.zeros((starts.shape[1], width))
    for lane, own in enumerate(optima):
        if own is not None:
            z[:, lane] = own.z[0]
    z[:, ~is_wanted] = z[:, len(jobs) - 1, None]

    by_group = linearise(key.structure, machines, jnp.asarray(z))
    rough = _rows(key, jobs, [means.residual for means in by_group])
    rmse_white = [job.problem.rmse_K(rows) for job, rows in zip(jobs, rough, strict=True)]
    results: dict[int, Found | _Level] = {}
    for lane, (job, own) in enumerate(zip(jobs, optima, strict=False)):
        if own is None:
            results[lane] = NotBatched("no start led to a finite fit")
        elif not own.has_ended[0]:
            results[lane] = NotBatched("the search did not converge")
        elif job.level == ROUGH_K and (level := implied_level(job.problem, rough[lane])) >= ROUGH_K:
            results[lane] = _Level(1.5 * level)
    if len(results) == len(jobs):
        return [results[lane] for lane in range(len(jobs))]

    state = settle(key.structure, machines, jnp.asarray(z))
    said = final(key.structure, machines, state)
    rivals = _rivals(key, machines, state, optima, [lane not in results for lane in range(width)])
    at = on_host(state)
    host = _OfMachines.of(key, jobs, at, on_host(said))
    for lane, job in enumerate(jobs):
        if lane in results:
            continue
        reason = rivals.get(lane) or _doubt(at, host.said, lane) or _late(job.problem, at.z, lane)
        own = optima[lane]
        assert own is not None
        results[lane] = (
            NotBatched(reason)
            if reason
            else host.fit(job.problem, lane, own, num_starts, rmse_white[lane])
        )
    return [results[lane] for lane in range(len(jobs))]


def _rows(key: Key, jobs: Sequence[_Job], by_group: Sequence[jax.Array]) -> list[np.ndarray]:
    """Return the rows of all tests in a row, of each machine."""
    parts: dict[tuple[int, int], np.ndarray] = {}
    for (_, _, tests), rows in zip(key.groups, by_group, strict=True):
        own = np.moveaxis(np.asarray(rows), -1, 0)
        width = own.shape[0] // len(tests)
        for place, test in enumerate(tests):
            for lane, job in enumerate(jobs):
                num = job.problem.tests[test].num_blocks
                parts[lane, test] = own[place * width + lane, :num]
    num_tests = sum(len(tests) for _, _, tests in key.groups)
    return [
        np.concatenate([parts[lane, test] for test in range(num_tests)])
        for lane in range(len(jobs))
    ]


def _doubt(state: Any, said: Any, lane: int) -> str:
    """Return why the batch's fit of a machine is not to be trusted; empty where it is."""
    numbers = (
        state.z[:, lane], state.noise_z[:, lane], said.restricted.value[lane],
        said.restricted.covariance[..., lane], said.noise_precision[..., lane],
    )  # fmt: skip
    if not all(np.all(np.isfinite(np.asarray(each))) for each in numbers):
        return "the fit is not finite"
    if said.stiffness[lane] > STABLE:
        return "the fastest node is too fast for the steps"
    if not state.has_ended[lane]:
        return "the search did not converge"
    if state.has_rival[lane]:
        return "two noises are equally probable"
    if state.shift[lane] >= SETTLED:
        return "noise and parameters did not settle"
    return ""


def _late(problem: Problem, z: np.ndarray, lane: int) -> str:
    """Return why a reading is too late for the march; empty where it is not."""
    for place, slot in enumerate(problem.parameters.slots):
        if slot.parameter.name == "load_timing":
            late_s = abs(float(slot.parameter.value(z[place, lane])))
            step = min(float(np.min(test.inputs.step)) for test in problem.tests)
            if late_s > step:
                return f"a reading is {late_s:.2g} s late, its steps are of {step:.2g} s"
    return ""


def _rivals(
    key: Key,
    machines: Machines,
    state: Settled,
    optima: Sequence[Optima | None],
    is_open: Sequence[bool],
) -> dict[int, str]:
    """Return the machines for which another optimum is as good under the final noise, and why."""
    z, cost = np.asarray(state.z), np.asarray(state.cost)
    places, starts = [], []
    for lane, own in enumerate(optima):
        if own is None or not is_open[lane]:
            continue
        kept = [z[:, lane]]
        for other in own.z:
            if all(np.max(np.abs(other - each)) > DISTINCT for each in kept):
                kept.append(other)
                places.append(lane)
                starts.append(other)
    if not places:
        return {}
    begin = on_host(begun(jnp.asarray(np.stack(starts, axis=-1))))
    lanes = np.array(places)
    noise = from_scores(state.noise_z)
    found, stands_for = continued(key.structure, machines, begin, lanes, noise, state.heat)
    reasons = {}
    for index, lane in enumerate(places):
        if stands_for[index] != index:
            continue
        own = found.normal.cost[index]
        is_far = np.max(np.abs(found.z[:, index] - z[:, lane])) > DISTINCT
        if own < cost[lane] - SAME_OPTIMUM:
            reasons[lane] = "another optimum is better under the final noise"
        elif is_far and own < cost[lane] + RIVAL:
            reasons.setdefault(lane, "several optima")
    return reasons


class _OfMachines(NamedTuple):
    """What was found of the machines of a batch, on the host."""

    state: Any  # `Settled` and `Final`, of NumPy arrays
    said: Any
    residual: list[np.ndarray]
    jacobian: list[np.ndarray]
    heat: list[np.ndarray]
    innovations: list[np.ndarray]

    @classmethod
    def of(cls, key: Key, jobs: Sequence[_Job], state: Any, said: Any) -> _OfMachines:
        """Return it."""
        residual = _rows(key, jobs, [means.residual for means in said.means])
        jacobian = _rows(key, jobs, [means.jacobian for means in said.means])
        heat = _rows(key, jobs, state.heat)
        return cls(state, said, residual, jacobian, heat, _rows(key, jobs, said.innovations))

    def fit(
        self, problem: Problem, lane: int, optima: Optima, num_starts: int, rmse_white: float
    ) -> Fit:
        """Return the fit of one machine."""
        z, noise_z = (np.array(each[:, lane]) for each in (self.state.z, self.state.noise_z))
        found = self.said.restricted
        num_read = int(np.sum(problem.is_observed))
        spread = laplace(
            z, noise_z, np.asarray(found.covariance[..., lane]),
            np.asarray(self.said.noise_precision[..., lane]),
            float(found.squares[lane]), float(found.half_log_det[lane]), num_read,
        )  # fmt: skip
        white = [
            rows[test.is_observed]
            for rows, test in zip(problem.split(self.innovations[lane]), problem.tests, strict=True)
        ]
        lengths = [test.block_s for test in problem.tests]
        excess, is_flagged = low_frequency_excess(white, lengths)
        problem = replace(problem, heat=tuple(problem.split(self.heat[lane])), loggers={})
        rmse = problem.rmse_K(self.residual[lane])
        is_same = optima.cost - optima.cost[0] < SAME_OPTIMUM * max(1.0, 1e-3 * optima.cost[0])
        return Fit(
            problem=problem,
            z=z,
            noise_z=noise_z,
            covariance=spread.covariance,
            covariance_type_a=spread.type_a,
            residual=problem.split(self.residual[lane]),
            jacobian=problem.split(self.jacobian[lane]),
            log_evidence=spread.log_evidence,
            result=RESULT.converged,
            modes=z[None],
            findings=tuple(misfit_findings(problem, noise_z, rmse, excess, is_flagged)),
            stats={
                "num_starts": num_starts,
                "num_at_best": int(np.sum(optima.num_starts[is_same])),
                "num_steps": optima.num_steps,
                "rmse_white_K": rmse_white,
                "low_frequency_excess": excess,
            },
        )
