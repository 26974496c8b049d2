"""The fit of many machines: what `heatrun.fit.fit` does for one, in batches of one width.

Machines whose problems have one structure and tests of one padded shape share compiled programs, as
many machines at a time as a batch is wide; empty places are filled with copies of the last one.
Tests are padded to a few lengths with blocks that hold no reading. So nothing is compiled for a
number of machines, and memory is that of a batch. A machine that the batch has doubts about comes
back as `NotBatched`, for the fit of one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
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
    distinct,
    finished,
    implied_level,
    start_scores,
)
from heatrun.fit.fit_result import Fit
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
    """Why a machine was left to the full job, in a few words."""

    reason: str


class Key(NamedTuple):
    """What is compiled."""

    structure: Structure  # The model and what stands in which slot.
    # Padded number of blocks, steps per block, and the tests of that shape.
    groups: tuple[tuple[int, int, tuple[int, ...]], ...]
    channels: tuple[str, ...]  # Those of `CHANNELS` that enter.
    fixed: tuple[str, ...]  # Names of the fixed values.


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
    most_moments = max(test.moments.shape[1] for test in tests)
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
        moments=lanes([
            np.pad(m, ((0, 0), (0, most_moments - m.shape[1]))) for m in (t.moments for t in tests)
        ]),
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

TOO_FEW = "too few machines of its kind in the batch"

Found = Fit | NotBatched


def fit_batch(
    problems: Sequence[Problem], *, seed: int = 0, width: int = WIDTH, fewest: int = 1
) -> list[Found]:
    """Fit a model to the tests of each of many machines.

    Args:
        problems: Model and tests of each machine; as many as there is memory for.
        seed: As `heatrun.fit.fit.fit`.
        width: Machines in a compiled program.
        fewest: Machines of one kind from which on they are fitted together.

    Returns:
        In the order of the problems, the fit that `fit` returns for each, or why it was left to
        that.

    Raises:
        InputError: If compiled sums are wrong here.
    """
    refuse_wrong_sums()
    found: dict[int, Found] = {}
    kinds: dict[Key, list[int]] = defaultdict(list)
    for place, problem in enumerate(problems):
        if reason := why_not(problem):
            found[place] = NotBatched(reason)
        else:
            kinds[key_of(problem)].append(place)
    for key, places in kinds.items():
        if len(places) < fewest:
            found |= dict.fromkeys(places, NotBatched(TOO_FEW))
            continue
        levels = dict.fromkeys(places, ROUGH_K)
        while levels:
            again = {}
            for first in range(0, len(levels), width):
                part = dict(list(levels.items())[first : first + width])
                own = [problems[place] for place in part]
                for place, fit in zip(part, _fits(key, own, [*part.values()], seed, width),
                                      strict=True):  # fmt: skip
                    if isinstance(fit, Fit | NotBatched):
                        found[place] = fit
                    else:
                        again[place] = fit
            levels = again
    return [found[place] for place in range(len(problems))]


def _fits(
    key: Key, problems: Sequence[Problem], levels: Sequence[float], seed: int, width: int
) -> list[Found | float]:
    """Return the fit of each machine of a batch, or the white level [K] that its residuals ask to
    be searched with in place of its level.
    """
    num = len(problems)
    is_wanted = np.arange(width) < num
    padding = width - num
    machines = pack(key, [*problems, *[problems[-1]] * padding])
    nothing = jnp.zeros(width)
    level = jnp.asarray([*levels, *[levels[-1]] * padding])
    starts = start_scores(problems[0], NUM_STARTS, seed)
    optima = optima_from_starts(
        key.structure, machines, starts, Noise(nothing, nothing + 1.0, level, nothing), is_wanted
    )
    z = np.zeros((starts.shape[1], width))
    for lane, own in enumerate(optima):
        if own is not None:
            z[:, lane] = own.z[0]
    z[:, ~is_wanted] = z[:, num - 1, None]

    by_group = linearise(key.structure, machines, jnp.asarray(z))
    rough = _rows(key, problems, [means.residual for means in by_group])
    results: dict[int, Found | float] = {}
    for lane, (problem, own) in enumerate(zip(problems, optima, strict=False)):
        if own is None:
            results[lane] = NotBatched("no start led to a finite fit")
        elif not own.has_ended[0]:
            results[lane] = NotBatched("the search did not converge")
        elif levels[lane] == ROUGH_K and (k := implied_level(problem, rough[lane])) >= ROUGH_K:
            results[lane] = 1.5 * k
    if len(results) == num:
        return [results[lane] for lane in range(num)]

    settled = settle(key.structure, machines, jnp.asarray(z))
    state: Any = on_host(settled)  # from here on of NumPy arrays
    said: Any = on_host(final(key.structure, machines, settled))
    open_ones = {
        lane: own for lane, own in enumerate(optima) if own is not None and lane not in results
    }
    rivals = _rivals(key, machines, settled, open_ones)
    residual = _rows(key, problems, [means.residual for means in said.means])
    jacobian = _rows(key, problems, [means.jacobian for means in said.means])
    heat = _rows(key, problems, state.heat)
    white = _rows(key, problems, said.innovations)
    for lane, own in open_ones.items():
        problem = problems[lane]
        if reason := rivals.get(lane) or _doubt(problem, state, said, lane):
            results[lane] = NotBatched(reason)
            continue
        problem = replace(problem, heat=tuple(problem.split(heat[lane])), loggers={})
        results[lane] = _finished(
            problem, state, said, lane, own, residual[lane], jacobian[lane], white[lane],
            problem.rmse_K(rough[lane]),
        )  # fmt: skip
    return [results[lane] for lane in range(num)]


def _rows(key: Key, problems: Sequence[Problem], by_group: Sequence[jax.Array]) -> list[np.ndarray]:
    """Return the rows of all tests in a row, of each machine."""
    parts: list[dict[int, np.ndarray]] = [{} for _ in problems]
    for (_, _, tests), rows in zip(key.groups, by_group, strict=True):
        of_tests = np.split(np.moveaxis(np.asarray(rows), -1, 0), len(tests))
        for test, own in zip(tests, of_tests, strict=True):
            for lane, problem in enumerate(problems):
                parts[lane][test] = own[lane, : problem.tests[test].num_blocks]
    return [np.concatenate([own[test] for test in sorted(own)]) for own in parts]


def _doubt(problem: Problem, state: Any, said: Any, lane: int) -> str:
    """Return why the batch's fit of a machine is not to be trusted; empty where it is."""
    numbers = (
        state.z[:, lane], state.noise_z[:, lane], said.restricted.value[lane],
        said.restricted.covariance[..., lane], said.noise_precision[..., lane],
    )  # fmt: skip
    if not all(np.all(np.isfinite(each)) for each in numbers):
        return "the fit is not finite"
    if said.stiffness[lane] > STABLE:
        return "the fastest node is too fast for the steps"
    if not state.has_ended[lane]:
        return "the search did not converge"
    if state.has_rival[lane]:
        return "two noises are equally probable"
    if state.shift[lane] >= SETTLED:
        return "noise and parameters did not settle"
    step = min(float(np.min(test.inputs.step)) for test in problem.tests)
    for score, slot in zip(state.z[:, lane], problem.parameters.slots, strict=True):
        if slot.parameter.name == "load_timing":
            late_s = abs(float(slot.parameter.value(score)))
            if late_s > step:
                return f"a reading is {late_s:.2g} s late, its steps are of {step:.2g} s"
    return ""


def _rivals(
    key: Key, machines: Machines, state: Settled, optima: Mapping[int, Optima]
) -> dict[int, str]:
    """Return the machines for which another optimum is as good under the final noise, and why."""
    z, cost = np.asarray(state.z), np.asarray(state.cost)
    places, starts = [], []
    for lane, own in optima.items():
        others = distinct([z[:, lane], *own.z])[1:]
        places += [lane] * len(others)
        starts += others
    if not places:
        return {}
    begin = on_host(begun(jnp.asarray(np.stack(starts, axis=-1))))
    noise = from_scores(state.noise_z)
    found, stands_for = continued(
        key.structure, machines, begin, np.array(places), noise, state.heat
    )
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


def _finished(
    problem: Problem, state: Any, said: Any, lane: int, optima: Optima, residual: np.ndarray,
    jacobian: np.ndarray, innovations: np.ndarray, rmse_white_K: float,
) -> Fit:  # fmt: skip
    """Return the fit of one machine of a batch, with its own unmodelled heat in the problem."""
    z, noise_z = (np.array(each[:, lane]) for each in (state.z, state.noise_z))
    found = said.restricted
    width = laplace(
        z, noise_z, found.covariance[..., lane], said.noise_precision[..., lane],
        float(found.squares[lane]), float(found.half_log_det[lane]),
        int(np.sum(problem.is_observed)),
    )  # fmt: skip
    white = [
        rows[test.is_observed]
        for rows, test in zip(problem.split(innovations), problem.tests, strict=True)
    ]
    is_same = optima.cost - optima.cost[0] < SAME_OPTIMUM * max(1.0, 1e-3 * optima.cost[0])
    return finished(
        problem, z, noise_z, residual, jacobian, z[None], is_converged=True, known=(white, width),
        stats={
            "num_starts": NUM_STARTS,
            "num_at_best": int(np.sum(optima.num_starts[is_same])),
            "num_steps": optima.num_steps,
            "rmse_white_K": rmse_white_K,
        },
    )  # fmt: skip
