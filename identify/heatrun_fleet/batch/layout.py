"""Which problems may share a compiled program, and their numbers side by side.

Tests are padded to a few lengths with blocks that hold no reading. A program is compiled for a
structure and the padded shapes of its tests, and for nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from heatrun.io.programs import compiled
from heatrun.model.discrepancy import num_knots
from heatrun.model.parameters import Parameter
from heatrun.model.problem import Problem, Structure
from heatrun.record.blocks import Blocks

from .march import Group, Machines
from .residuals import most_knots

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
