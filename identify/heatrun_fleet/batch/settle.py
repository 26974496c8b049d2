"""Noise and least squares in turns, for machines side by side, until the scores stand still.

The noise is told from the residuals, the parameters integrated out: the restricted likelihood is
that of `heatrun.fit.restricted`, mapped over lanes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from heatrun.fit.fit import NUM_ROUNDS, SETTLED, SIDE, is_corner, near_corner
from heatrun.fit.restricted import SCORE_LIMIT, STARTS_S, marginal
from heatrun.io.programs import compiled
from heatrun.model.discrepancy import MOST_COLUMNS, with_heat
from heatrun.model.noise import HEAT, LARGEST_SCORES, NOISE, Noise, from_scores
from heatrun.model.problem import Problem, Structure

from .march import Machines
from .residuals import Means, each, inner_products
from .search import (
    MOST_STEPS,
    Normal,
    Search,
    begun,
    descended,
    kept,
    linearise,
    search,
    units,
)

BEFORE_CORNERS = 25
"""Steps of a search after which a delay of next to nothing is held at none: it may be most probable
there, where no search ends."""

TOGETHER = 0.03
"""Noises nearer than this in all scores have come together [prior standard deviations]."""


CURVATURE = (600.0, 30.0, 300.0, 5.0)
"""Second derivatives that a search begins with [nat]: of some hundred blocks, per prior sd."""

LOW = np.full((len(LARGEST_SCORES), 1), -SCORE_LIMIT)
HIGH = np.array(LARGEST_SCORES)[:, None]


class Settled(NamedTuple):
    """Where the turns have ended."""

    z: Float[Array, "parameter machine"]  # Scores; those of the noise stand in `noise_z`.
    noise_z: Float[Array, "noise machine"]
    cost: Float[Array, " machine"]  # Half the sum of squares at the end [nat].
    shift: Float[Array, " machine"]  # Change of the scores in the last turn.
    has_ended: Bool[Array, " machine"]  # Whether all searches of the machine have converged.
    has_rival: Bool[Array, " machine"]  # Whether another noise is as probable.


class Linear(NamedTuple):
    """The linear model around a fit, on which the noise is estimated: scores, and residuals and
    Jacobian of each group of tests there.
    """

    z: Float[Array, "parameter lane"]
    means: list[Means]


def settle(
    structure: Structure,
    machines: Machines,
    z: Float[Array, "parameter machine"],
    problems: Sequence[Problem],
) -> tuple[Settled, Machines, list[Problem]]:
    """Return where noise and least squares come to rest from the optima for white noise, and the
    machines and their problems with unmodelled heat.
    """
    means, noise = linearise(structure, machines, z), None
    is_done = has_rival = jnp.zeros(z.shape[-1], dtype=bool)
    held = np.zeros(z.shape, dtype=bool)
    state: Settled | None = None
    heated = list(problems)
    for _ in range(NUM_ROUNDS):
        at = np.asarray(z)
        for lane in np.flatnonzero(~np.asarray(is_done)[: len(problems)]).tolist():
            heated[lane] = with_heat(problems[lane], at[:, lane])
        machines, linear = _with_heat(machines, heated), Linear(z, means)
        if noise is None:
            noise, has_rival = _first_noise(machines, linear)
        else:
            # the second derivative that the last turn has found still holds
            again = noise_begun(noise.z, noise.normal.curvature)
            noise = search_noise(machines, linear, again)
        found, held = _searched(structure, machines, z, from_scores(noise.z), held)
        shift = jnp.max(jnp.abs(found.z - z), axis=0)
        has_ended = found.has_ended & noise.has_ended
        now = Settled(found.z, noise.z, found.normal.cost, shift, has_ended, has_rival)
        if state is not None:
            now: Settled = kept(is_done, state, now)
        state, z = now, now.z
        means = linearise(structure, machines, z)
        is_done = (state.shift < SETTLED) | ~jnp.isfinite(state.shift)
        if bool(jnp.all(is_done)):
            break
    assert state is not None
    return state, machines, heated


def _with_heat(machines: Machines, heated: Sequence[Problem]) -> Machines:
    """Return the machines with the heat of their problems, the last one's in the empty places."""
    heat = [problem.heat for problem in heated]
    heat += heat[-1:] * (machines.priors.sd.shape[-1] - len(heat))
    columns = []
    for group in machines.groups:
        joined = np.zeros((group.sink.shape[0], MOST_COLUMNS, group.sink.shape[1]))
        lanes = [own[test] for test in group.tests for own in heat if own is not None]
        for lane, own in enumerate(lanes):
            joined[: own.shape[0], : own.shape[1], lane] = own
        columns.append(jnp.asarray(joined))
    return eqx.tree_at(lambda at: [group.rows.heat for group in at.groups], machines, columns)


def _searched(
    structure: Structure,
    machines: Machines,
    z: Float[Array, "parameter machine"],
    noise: Noise,
    held: Bool[np.ndarray, "parameter machine"],
) -> tuple[Search, Bool[np.ndarray, "parameter machine"]]:
    """Return the searches from some scores, and which delays are at their corners; `held` are those
    that the last turn has left there.
    """

    def ahead(state: Search, most: int, held: np.ndarray) -> Search:
        return search(structure, machines, state, noise, jnp.asarray(most), jnp.asarray(held))

    found = ahead(begun(z), BEFORE_CORNERS, held)
    ended = np.asarray(found.has_ended)
    near = near_corner(structure.form, np.asarray(found.z)) & ~ended & ~held
    if np.any(near):
        held, is_new = held | near, jnp.asarray(near.any(axis=0))
        at = begun(jnp.where(jnp.asarray(near), 0.0, found.z))
        found = ahead(kept(is_new, at, found), MOST_STEPS, held)
    if np.any(held):
        # the first step is none: the slopes on the two sides, and no more
        before, after = (
            np.asarray(ahead(begun(found.z + side * held), 1, held).normal.gradient)
            for side in (-SIDE, SIDE)
        )
        stays = is_corner(before, after, held)
        held = held & stays
        found = found._replace(has_ended=found.has_ended & jnp.asarray(stays))
    if not np.all(np.asarray(found.has_ended)):
        found = ahead(found, MOST_STEPS, held)
    return found, held


def _first_noise(machines: Machines, linear: Linear) -> tuple[Search, Bool[Array, " machine"]]:
    """Return the most probable noise, and whether another is as probable.

    Where the likelihood has two maxima, so has that of the residuals as they are, which costs next
    to nothing: its maxima are what the searches begin from. A machine that has one does not feel
    that its neighbours are searched again.
    """
    bare = Linear(
        linear.z[:0], [Means(means.residual, means.jacobian[:, :0]) for means in linear.means]
    )
    none = eqx.tree_at(
        lambda at: [group.rows.heat for group in at.groups],
        machines,
        [group.rows.heat[:, :0] for group in machines.groups],
    )
    tried = [
        search_noise(none, bare, noise_begun(start))
        for start in _noise_starts(machines, linear.means)
    ]
    first, is_alone = _best(tried)
    of_first = _with_parameters(machines, linear, first)
    has_rival = jnp.zeros_like(is_alone)
    is_alone |= ~jnp.isfinite(first.normal.cost)
    if bool(jnp.all(is_alone)):
        return of_first, has_rival
    others = [_with_parameters(machines, linear, each) for each in tried]
    best, _ = _best([of_first, *others])
    for other in others:
        is_far = jnp.max(jnp.abs(other.z - best.z), axis=0) > TOGETHER
        has_rival |= is_far & (other.normal.cost - best.normal.cost < RIVAL)
    return kept(is_alone, of_first, best), has_rival & ~is_alone


def _with_parameters(machines: Machines, linear: Linear, found: Search) -> Search:
    """Return the noise with the parameters integrated out, searched from that without them."""
    place = NOISE.index(HEAT)
    curvature = found.normal.curvature.at[place, place].set(HEAT_CURVATURE)
    return search_noise(machines, linear, noise_begun(found.z, curvature))


RIVAL = 1e-3
"""Log likelihoods nearer than this may change places with the last digits [nat]."""

HEAT_CURVATURE = 5.0
"""Second derivative by the size of the heat that a search begins with [nat]."""


def _best(found: list[Search]) -> tuple[Search, Bool[Array, " machine"]]:
    """Return the best of some searches, and whether all have come together there."""
    stacked = jax.tree.map(lambda *parts: jnp.stack(parts, axis=-1), *found)
    place = jnp.argmin(stacked.normal.cost, axis=-1)

    def taken(values: Array) -> Array:
        places = jnp.broadcast_to(place, values.shape[:-1])[..., None]
        return jnp.take_along_axis(values, places, axis=-1)[..., 0]

    best = jax.tree.map(taken, stacked)
    apart = jnp.max(jnp.abs(stacked.z - best.z[..., None]), axis=(0, 2))
    return best, apart < TOGETHER


@compiled()
def _noise_starts(machines: Machines, means: list[Means]) -> list[Float[Array, "noise machine"]]:
    """Return scores at the level of the residuals; as `heatrun.fit.restricted` has them."""
    count, total, square = 0.0, 0.0, 0.0
    for of_group, group in zip(means, machines.groups, strict=True):
        count = count + sum(group.by_test(jnp.sum(group.rows.is_observed, axis=0)))
        total = total + sum(group.by_test(jnp.sum(of_group.residual, axis=0)))
        square = square + sum(group.by_test(jnp.sum(of_group.residual**2, axis=0)))
    spread = jnp.sqrt(jnp.maximum(square / count - (total / count) ** 2, 0.0)) + 1e-6

    def score(place: int, value: Array) -> Array:
        return jnp.log(value / NOISE[place].centre) / NOISE[place].sd

    ones = jnp.ones_like(spread)
    return [
        jnp.stack([score(0, spread), score(1, time * ones), score(2, spread), 0.0 * ones])
        for time in STARTS_S
    ]


def restricted(
    machines: Machines, linear: Linear, noise_z: Float[Array, "noise lane"]
) -> tuple[Float[Array, " lane"], Float[Array, "noise lane"]]:
    """Return minus the restricted likelihood of the noise of each machine [nat], and its slope."""

    def value(noise_z: Float[Array, "noise lane"]) -> tuple[Float[Array, ""], Array]:
        products, log_sd = inner_products(machines, linear.means, from_scores(noise_z))
        found = -each(marginal)(products, log_sd, noise_z, linear.z)
        return jnp.sum(found), found  # no machine's value depends on another's noise

    slope, found = jax.grad(value, has_aux=True)(noise_z)
    return found, slope


def noise_begun(start: Float[Array, "noise lane"], curvature: Array | None = None) -> Search:
    """Return searches that stand at their starts, moved within the limits."""
    usual = jnp.asarray(CURVATURE)[:, None, None] * units(start)
    return begun(jnp.clip(start, LOW, HIGH), usual if curvature is None else curvature)


@compiled()
def search_noise(machines: Machines, linear: Linear, state: Search) -> Search:
    """Go on with a search for the noise of each machine: quasi-Newton steps within the limits."""

    def look(noise_z: Array, before: Normal, step: Array) -> Normal:
        value, slope = restricted(machines, linear, noise_z)
        return Normal(value, slope, _updated(before.curvature, step, slope - before.gradient))

    none = jnp.zeros(state.z.shape, dtype=bool)
    return descended(state, jnp.asarray(MOST_STEPS), look, none, LOW, HIGH)


def _updated(curvature, step, change) -> Float[Array, "noise noise lane"]:
    """Return the second derivative with what a step has shown of it (BFGS, damped by Powell).

    Reference: J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed., procedure 18.2.
    """
    pushed = jnp.einsum("ijw,jw->iw", curvature, step)
    inner, seen = jnp.sum(step * pushed, axis=0), jnp.sum(step * change, axis=0)
    is_enough = seen >= 0.2 * inner
    theta = jnp.where(is_enough, 1.0, 0.8 * inner / jnp.where(is_enough, 1.0, inner - seen))
    change = theta * change + (1.0 - theta) * pushed
    seen = jnp.sum(step * change, axis=0)
    is_wanted = (inner > 1e-28) & (seen > 1e-28)
    inner, seen = jnp.where(is_wanted, inner, 1.0), jnp.where(is_wanted, seen, 1.0)
    after = (
        curvature - pushed[:, None] * pushed[None] / inner + change[:, None] * change[None] / seen
    )
    return jnp.where(is_wanted, after, curvature)
