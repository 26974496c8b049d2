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
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

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
from heatrun.io.programs import refuse_wrong_sums
from heatrun.model.noise import Noise, from_scores
from heatrun.model.parameters import Parameter
from heatrun.model.problem import Problem, Structure
from heatrun.posterior.driven import too_stiff
from heatrun.record.blocks import Blocks
from heatrun.record.observation import Observation
from lptn.inputs import SIGNALS

from .march import Group, Machines, sink_means
from .search import Optima, begun, continued, on_host, optima_from_starts
from .settle import settle

Tree = TypeVar("Tree")

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
    groups = []
    for size, _, indices in key.groups:
        tests = [_rows(key, problem.tests[i], size) for i in indices for problem in problems]
        most = max(test.moments.shape[1] for test in tests)
        rows = _lanes([
            replace(t, moments=np.pad(t.moments, ((0, 0), (0, most - t.moments.shape[1]))))
            for t in tests
        ])  # fmt: skip
        groups.append(Group(indices, rows, sink_means(rows)))
    return Machines(_lanes([problem.parameters.priors() for problem in problems]), tuple(groups))


def _rows(key: Key, test: Blocks, size: int) -> Observation:
    """Return a test of a padded length, with those inputs that enter."""
    unused = {name: None for name in SIGNALS[3:] if name not in key.channels}
    return replace(test.observation(), inputs=replace(test.inputs, **unused)).padded(size)


def _lanes(trees: Sequence[Tree]) -> Tree:
    return jax.tree.map(lambda *leaves: jnp.asarray(np.stack(leaves, axis=-1)), *trees)


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

    rough = {lane: problems[lane].linearised(own.z[0])[0]
             for lane, own in enumerate(optima) if own is not None}  # fmt: skip
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

    settled, machines, heated = settle(key.structure, machines, jnp.asarray(z), problems)
    state: Any = on_host(settled)  # from here on of NumPy arrays
    open_ones = {
        lane: own for lane, own in enumerate(optima) if own is not None and lane not in results
    }
    rivals = _rivals(key, machines, state, open_ones)
    is_stiff = _too_stiff(key.structure, machines, state.z)
    for lane, own in open_ones.items():
        problem = heated[lane]
        if reason := rivals.get(lane) or _doubt(problem, state, lane, is_stiff):
            results[lane] = NotBatched(reason)
            continue
        at, noise_z = (np.array(each[:, lane]) for each in (state.z, state.noise_z))
        is_same = own.cost - own.cost[0] < SAME_OPTIMUM * max(1.0, 1e-3 * own.cost[0])
        found = finished(
            problem, at, noise_z, *problem.linearised(at), at[None],
            is_converged=True,
            stats={
                "num_starts": NUM_STARTS,
                "num_at_best": int(np.sum(own.num_starts[is_same])),
                "num_steps": own.num_steps,
                "rmse_white_K": problem.rmse_K(rough[lane]),
            },
        )  # fmt: skip
        is_sound = np.isfinite(found.log_evidence) and np.all(np.isfinite(found.covariance))
        results[lane] = found if is_sound else NotBatched("the fit is not finite")
    return [results[lane] for lane in range(num)]


def _too_stiff(
    structure: Structure, machines: Machines, z: Float[np.ndarray, "parameter machine"]
) -> Bool[np.ndarray, " machine"]:
    """Return which machines have a node that is too fast for the steps of their tests."""
    steps = [jnp.stack(group.by_test(group.rows.inputs.step)) for group in machines.groups]
    values = on_host(machines.priors).values(structure.form, z, 0)
    return too_stiff(structure.model, values, np.max([np.max(x, axis=0) for x in steps], axis=0))


def _doubt(problem: Problem, state: Any, lane: int, is_stiff: np.ndarray) -> str:
    """Return why the batch's fit of a machine is not to be trusted; empty where it is."""
    if not all(np.all(np.isfinite(each[:, lane])) for each in (state.z, state.noise_z)):
        return "the fit is not finite"
    if is_stiff[lane]:
        return "the fastest node is too fast for the steps"
    if not state.has_ended[lane]:
        return "the search did not converge"
    if state.has_rival[lane]:
        return "two noises are equally probable"
    if state.shift[lane] >= SETTLED:
        return "noise and parameters did not settle"
    for score, slot in zip(state.z[:, lane], problem.parameters.slots, strict=True):
        if slot.parameter.name == "load_timing":
            late_s = abs(float(slot.parameter.value(score)))
            step = min(float(test.inputs.step) for test in problem.tests)
            if late_s > step:
                return f"a reading is {late_s:.2g} s late, its steps are of {step:.2g} s"
    return ""


def _rivals(
    key: Key, machines: Machines, state: Any, optima: Mapping[int, Optima]
) -> dict[int, str]:
    """Return the machines for which another optimum is as good under the final noise, and why."""
    z, cost = state.z, state.cost
    places, starts = [], []
    for lane, own in optima.items():
        others = distinct([z[:, lane], *own.z])[1:]
        places += [lane] * len(others)
        starts += others
    if not places:
        return {}
    begin = on_host(begun(jnp.asarray(np.stack(starts, axis=-1))))
    noise = from_scores(state.noise_z)
    found, stands_for = continued(key.structure, machines, begin, np.array(places), noise)
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
