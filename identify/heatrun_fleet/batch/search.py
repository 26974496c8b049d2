"""Least squares of many machines side by side, from one start and from many.

Levenberg-Marquardt on whitened residuals. Each lane has its own step and its own end; a lane that
has ended stands still until the last one has, or the steps are used up. The search for the noise is
the same, with a curvature that it learns on the way.

Each of many starts is a batch of the machines' searches for a few steps. By then most of a
machine's searches have come together; of those that have, one goes on. All that with few, long
steps of the march; what is left at the end is searched again with the steps as they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from heatrun.fit.fit import HOPELESS, MAX_STEPS
from heatrun.io.programs import compiled
from heatrun.model.noise import Noise
from heatrun.model.problem import Structure
from heatrun.record.observation import Observation
from lptn.inputs import SIGNALS
from lptn.stepping import eliminate

from .march import Machines
from .residuals import Means, each, inner_products, residuals_of_group

TOLERANCE = 1e-9
"""Largest step of a search that has ended, in prior standard deviations."""

DAMPING = 0.01
"""Damping of the first step, over the diagonal of the curvature [1]."""

LONGEST_STEP = 1.5
"""In any score [prior standard deviations]: a linear model of a network holds no farther."""

GOOD, POOR = 0.75, 0.05
"""Gain over the one foreseen from which the damping is lessened, and below which a step is taken
back [1]."""

LESS, MORE, MOST = 0.1, 6.0, 1e12
"""Factors of the damping, and where a search has no way on."""

FARTHEST = 12.0
"""Scores beyond which no search goes [prior standard deviations]: where a network no longer answers
to its parameters there is no way back."""

SHORT = 1e-4
"""Steps that may be the last ones [prior standard deviations]."""

MOST_STEPS = 60
"""Steps of a search for parameters or noise that starts near its end, or from a fair guess."""

ROUNDING = 1e-10
"""Change of the cost that may be rounding alone, relative [1]."""


class Normal(NamedTuple):
    """What is made least at some scores, such as half the sum of squares with the prior, its
    gradient and what is known of its curvature [nat].
    """

    cost: Float[Array, " machine"]
    gradient: Float[Array, "score machine"]
    curvature: Float[Array, "score score machine"]


class Search(NamedTuple):
    """Where searches stand, with the damping of the next step and the steps taken."""

    z: Float[Array, "score machine"]
    normal: Normal
    damping: Float[Array, " machine"]
    has_ended: Bool[Array, " machine"]
    num_steps: Int[Array, " machine"]


@compiled("structure")
def linearise(
    structure: Structure, machines: Machines, z: Float[Array, "parameter machine"]
) -> list[Means]:
    """Return residuals [K] and Jacobian of each group of tests."""
    return [residuals_of_group(structure, machines, z, group) for group in machines.groups]


def normal_equations(
    structure: Structure, machines: Machines, z: Float[Array, "parameter machine"], noise: Noise
) -> Normal:
    """Return the normal equations of whitened residuals under the noise of each machine."""
    products, _ = inner_products(machines, linearise(structure, machines, z), noise)
    return Normal(
        cost=0.5 * (products[0, 0] + jnp.sum(z**2, axis=0)),
        gradient=products[1:, 0] + z,
        curvature=products[1:, 1:] + units(z),
    )


def units(z: Float[Array, "row lane"]) -> Float[Array, "row row lane"]:
    """Return unit matrices."""
    return jnp.broadcast_to(jnp.eye(z.shape[0])[:, :, None], (*z.shape[:1], *z.shape))


def begun(
    start: Float[Array, "score machine"],
    curvature: Float[Array, "score score machine"] | None = None,
) -> Search:
    """Return searches that stand at their starts, with what is known of the curvature there."""
    num_machines = start.shape[1]
    return Search(
        z=start,
        # nothing is known yet: the first step is none, and is taken whatever it finds
        normal=Normal(
            jnp.full(num_machines, jnp.inf, dtype=float),
            jnp.zeros_like(start),
            units(start) if curvature is None else curvature,
        ),
        damping=jnp.full(num_machines, DAMPING, dtype=float),
        has_ended=jnp.zeros(num_machines, dtype=bool),
        num_steps=jnp.zeros(num_machines, dtype=int),
    )


def _step(
    now: Normal, damping: Float[Array, " machine"], held: Bool[Array, "score machine"]
) -> Float[Array, "score machine"]:
    """Return the damped step, no longer than `LONGEST_STEP`; held scores stay.

    It is shortened and not damped more: a damped step goes down the steepest way and then creeps,
    a shortened one stays in the valley.
    """
    unit = jnp.eye(held.shape[0])[:, :, None]
    curvature = jnp.where(held[:, None] | held, unit, now.curvature)
    diagonal = jnp.einsum("iiw->iw", curvature)
    gradient = jnp.where(held, 0.0, now.gradient)
    damped = curvature + (damping * diagonal)[:, None] * unit
    step = -each(eliminate)(damped, gradient[:, None])[:, 0]
    length = jnp.max(jnp.abs(step), axis=0)
    return step * jnp.minimum(1.0, LONGEST_STEP / jnp.maximum(length, 1e-300))


Look = Callable[[Float[Array, "score machine"], Normal, Float[Array, "score machine"]], Normal]
"""Returns what is found at some scores, given what was known before a step, and the step."""


def descended(
    state: Search,
    most: Int[Array, ""],
    look: Look,
    held: Bool[Array, "score machine"],
    low: Float[Any, "score 1"] | float = -FARTHEST,
    high: Float[Any, "score 1"] | float = FARTHEST,
) -> Search:
    """Go on with a search for each lane, within limits.

    There are at most so many steps, those of earlier calls included; held scores stay as they are.
    """

    def unfinished(state: Search):
        return jnp.any(~state.has_ended & (state.num_steps < most))

    def advance(state: Search) -> Search:
        z, now, damping, has_ended, num_steps = state
        is_first = jnp.isinf(now.cost)
        # beyond its limit no score goes, wherever the slope leads
        stays = ((z <= low) & (now.gradient > 0.0)) | ((z >= high) & (now.gradient < 0.0))
        step = jnp.clip(z + _step(now, damping, held | stays), low, high) - z
        foreseen = -jnp.sum(step * now.gradient, axis=0) - 0.5 * jnp.einsum(
            "iw,ijw,jw->w", step, now.curvature, step
        )
        ahead = look(z + step, now, step)
        gain = (now.cost - ahead.cost) / jnp.maximum(foreseen, 1e-300)
        # the gain of the last steps drowns in the rounding of the cost
        rounding = ROUNDING * (1.0 + jnp.abs(now.cost))
        length = jnp.max(jnp.abs(step), axis=0)
        is_last = (foreseen < rounding) & (ahead.cost - now.cost < rounding) & (length < SHORT)
        is_taken = (is_first | (gain > POOR) | is_last) & ~has_ended & jnp.isfinite(ahead.cost)
        z = jnp.where(is_taken, z + step, z)
        now = jax.tree.map(lambda new, old: jnp.where(is_taken, new, old), ahead, now)
        less = jnp.where((gain > GOOD) | is_last, LESS, 1.0)
        factor = jnp.where(is_taken, less, MORE)
        damping = jnp.where(has_ended | is_first, damping, damping * factor)
        has_ended |= (is_taken & (length < TOLERANCE) & ~is_first) | (damping > MOST)
        return Search(z, now, damping, has_ended, num_steps + ~has_ended)

    return jax.lax.while_loop(unfinished, advance, state)


@compiled("structure")
def search(
    structure: Structure,
    machines: Machines,
    state: Search,
    noise: Noise,
    most: Int[Array, ""],
    held: Bool[Array, "parameter machine"],
) -> Search:
    """Go on with searches of least squares; arguments as `normal_equations` and `descended`."""
    return descended(
        state, most, lambda z, *_: normal_equations(structure, machines, z, noise), held
    )


NUM_STEPS = 2
"""Steps of a coarse block; three where its number of steps is odd."""


@compiled()
def coarse(machines: Machines) -> Machines:
    """Return the machines with inputs that hold for several steps, as their mean."""
    groups = (replace(group, rows=_coarse(group.rows)) for group in machines.groups)
    return replace(machines, groups=tuple(groups))


def _coarse(rows: Observation) -> Observation:
    num_blocks, steps, lanes = rows.weight.shape
    num = next((each for each in (NUM_STEPS, 3) if steps % each == 0), steps)
    joined = steps // num

    def parts(values: Array) -> Array:
        return values.reshape(num_blocks, num, joined, lanes)

    def mean(values: Float[Array, "time lane"]) -> Float[Array, "time lane"]:
        return jnp.mean(parts(values), axis=2).reshape(-1, lanes)

    weight = parts(rows.weight)
    total = jnp.sum(weight, axis=2)
    place = (jnp.arange(joined)[:, None] + parts(rows.position)) / joined
    position = jnp.sum(weight * place, axis=2) / jnp.where(total > 0.0, total, math.inf)
    names = [name for name in SIGNALS if getattr(rows.inputs, name) is not None]
    means = [mean(getattr(rows.inputs, name)) for name in names]
    return eqx.tree_at(
        lambda at: [
            at.weight,
            at.position,
            at.inputs.step,
            *(getattr(at.inputs, n) for n in names),
        ],
        rows,
        [total, position, rows.inputs.step * joined, *means],
    )


Tree = TypeVar("Tree")


@compiled("num")
def picked(tree: Tree, places: Int[Array, " picked"], num: int) -> Tree:
    """Return arrays of so many machines, or of their tests, with some of the machines alone."""

    def one(values: Array) -> Array:
        num_tests = values.shape[-1] // num
        own = jnp.concatenate([places + test * num for test in range(num_tests)])
        return jnp.take(values, own, axis=-1)

    return jax.tree.map(one, tree)


@compiled()
def kept(is_kept: Array, old: Tree, new: Tree) -> Tree:
    """Return the old arrays in the machines where they are kept, the new ones in the others."""

    def one(before: Array, after: Array) -> Array:
        own = jnp.concatenate([is_kept] * (before.shape[-1] // is_kept.shape[0]))
        return jnp.where(own, before, after)

    return jax.tree.map(one, old, new)


def on_host(tree: Any) -> Any:
    """Return arrays as NumPy arrays."""
    return jax.tree.map(np.asarray, tree)


FIRST_STEPS, MORE_STEPS = 7, 5
"""Steps of each start before those that have come together are told, for the first time and each
time after."""

TOGETHER = 0.1
"""Searches nearer than this in all scores have come together [prior standard deviations]. The
curvature of the prior alone brings them to one optimum from there."""

COARSE_STEPS = 30
"""Most steps of a search with the long steps of the march: it need not end there."""

LOST_STEPS, LOST = 20, (4.0, 50.0)
"""Steps from which on a search is lost whose cost is still above so many times the machine's best,
and so much more [1, nat]: it has left the region in which the network answers to its parameters."""


class Optima(NamedTuple):
    """The optima of one machine, the best first: scores, half sums of squares [nat], whether each
    search has converged, starts that came to each, and steps to the best.
    """

    z: Float[np.ndarray, "optimum parameter"]
    cost: Float[np.ndarray, " optimum"]
    has_ended: np.ndarray
    num_starts: np.ndarray
    num_steps: int


def optima_from_starts(
    structure: Structure,
    machines: Machines,
    starts: Float[np.ndarray, "start parameter"],
    noise: Noise,
    is_wanted: np.ndarray,
) -> list[Optima | None]:
    """Return the optima of each machine that is no padding; None where no start leads to a finite
    fit.
    """
    width = machines.priors.sd.shape[-1]
    rough = coarse(machines)
    states = []
    none = jnp.zeros((starts.shape[1], width), dtype=bool)
    for start in starts:
        lanes = begun(jnp.asarray(np.repeat(start[:, None], width, axis=1)))
        states.append(search(structure, rough, lanes, noise, jnp.asarray(FIRST_STEPS), none))
    # trailing axes: machine, start
    joined: Any = jax.tree.map(lambda *parts: np.stack([*map(np.asarray, parts)], -1), *states)
    apart = [
        _together(joined.z[:, lane].T, joined.normal.cost[lane]) if is_wanted[lane] else []
        for lane in range(width)
    ]
    flat = [(lane, group) for lane, groups in enumerate(apart) for group in groups]
    places = np.array([[lane, group[0]] for lane, group in flat]).reshape(-1, 2)
    best = jax.tree.map(lambda values: values[..., places[:, 0], places[:, 1]], joined)
    near, came_to = continued(structure, rough, best, places[:, 0], noise, COARSE_STEPS)
    is_lost = _are_lost(near, _lowest(near.normal.cost, places[:, 0]))
    kept = np.unique(came_to[~is_lost[came_to]])
    exact = on_host(begun(jnp.asarray(near.z[:, kept])))
    done, stands_for = continued(structure, machines, exact, places[kept, 0], noise)
    num_starts = np.zeros(kept.size, dtype=int)
    for (_, group), near_by in zip(flat, came_to, strict=True):
        if not is_lost[near_by]:
            num_starts[stands_for[np.searchsorted(kept, near_by)]] += len(group)
    places = places[kept]
    results: list[Optima | None] = []
    for lane in range(width):
        own = np.flatnonzero((places[:, 0] == lane) & (num_starts > 0))
        own = own[np.isfinite(done.normal.cost[own]) & (done.normal.cost[own] < HOPELESS)]
        if not own.size:
            results.append(None)
            continue
        own = own[np.argsort(done.normal.cost[own])]
        is_near = _is_near(done.normal.cost[own], done.normal.cost[own[0]])
        own = own[done.has_ended[own] | is_near]
        results.append(
            Optima(done.z[:, own].T, done.normal.cost[own], done.has_ended[own], num_starts[own],
                   int(done.num_steps[own[0]]))
        )  # fmt: skip
    return results


def _together(z: Float[np.ndarray, "start parameter"], cost: np.ndarray) -> list[list[int]]:
    """Return groups of searches that have come together, the best of each first."""
    groups: list[list[int]] = []
    for index in np.argsort(cost, kind="stable"):
        if not np.isfinite(cost[index]):
            continue
        for group in groups:
            if np.max(np.abs(z[index] - z[group[0]])) < TOGETHER:
                group.append(int(index))
                break
        else:
            groups.append([int(index)])
    return groups


def continued(
    structure: Structure,
    machines: Machines,
    state: Any,
    lanes: np.ndarray,
    noise: Noise,
    most_steps: int = MAX_STEPS,
) -> tuple[Any, Int[np.ndarray, " search"]]:
    """Go on with searches to their end, as many at once as there are machines.

    The `state` is a `Search` on the host, with a lane for each search; `lanes` says of which
    machine each is. With the searches comes for each the one that has gone on for it since they
    came together.
    """
    width = machines.priors.sd.shape[-1]
    state = jax.tree.map(np.array, state)
    stands_for = np.arange(lanes.size)
    none = jnp.zeros((state.z.shape[0], width), dtype=bool)
    most = int(np.max(state.num_steps, initial=0))
    while (open_ones := _open(state, stands_for, lanes)).size and most < most_steps:
        most = min(most_steps, most + MORE_STEPS)
        for first in range(0, open_ones.size, width):
            part = open_ones[first : first + width]
            filled = np.concatenate([part, np.repeat(part[-1:], width - part.size)])
            own_state = jax.tree.map(lambda v, filled=filled: jnp.asarray(v[..., filled]), state)
            own = picked((machines, noise), jnp.asarray(lanes[filled]), width)
            after = search(structure, own[0], own_state, own[1], jnp.asarray(most), none)
            for own, found in zip(
                jax.tree.leaves(state), jax.tree.leaves(on_host(after)), strict=True
            ):
                own[..., part] = found[..., : part.size]
        for lane in np.unique(lanes[open_ones]):
            own = np.flatnonzero((lanes == lane) & (stands_for == np.arange(lanes.size)))
            for group in _together(state.z[:, own].T, state.normal.cost[own]):
                stands_for[np.isin(stands_for, own[group])] = own[group[0]]
    return state, stands_for


def _open(state: Any, stands_for: np.ndarray, lanes: np.ndarray) -> np.ndarray:
    """Return the searches that go on: not at their end, not lost, and for themselves."""
    lowest = _lowest(state.normal.cost, lanes)
    is_lost = (state.num_steps >= LOST_STEPS) & _are_lost(state, lowest)
    return np.flatnonzero(~state.has_ended & ~is_lost & (stands_for == np.arange(lanes.size)))


def _lowest(cost: np.ndarray, lanes: np.ndarray) -> np.ndarray:
    """Return for each search the lowest cost that one of its machine has."""
    lowest = np.full(np.max(lanes, initial=-1) + 1, np.inf)
    np.fmin.at(lowest, lanes, cost)
    return lowest[lanes]


def _is_near(cost: np.ndarray, lowest: np.ndarray) -> np.ndarray:
    return cost <= LOST[0] * lowest + LOST[1]


def _are_lost(state: Any, lowest: np.ndarray) -> np.ndarray:
    """Return which searches stand far above the best of their machine, without an end there."""
    return ~state.has_ended & ~_is_near(state.normal.cost, lowest)
