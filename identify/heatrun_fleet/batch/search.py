"""Least squares of many machines side by side: Levenberg-Marquardt on whitened residuals.

Each lane has its own step and its own end; a lane that has ended stands still until the last one
has, or the steps are used up.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from heatrun.io.programs import compiled
from heatrun.model.noise import Noise
from heatrun.model.problem import WORST_RESIDUAL, Structure

from .march import Machines
from .residuals import (
    Means,
    filtered,
    identity,
    products,
    residuals_of_group,
    scaled_heat,
    solve,
    weighted,
    without_columns,
)

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

ROUNDING = 1e-10
"""Change of the cost that may be rounding alone, relative [1]."""

Heat = tuple[Float[Array, "block column lane"], ...]


class Normal(NamedTuple):
    """The normal equations at some scores, the prior included.

    Attributes:
        cost: Half the sum of squares [nat].
        gradient: Its gradient, shape (parameter, machine).
        curvature: Its Gauss-Newton curvature, shape (parameter, parameter, machine).
    """

    cost: Float[Array, " machine"]
    gradient: Float[Array, "parameter machine"]
    curvature: Float[Array, "parameter parameter machine"]


class Search(NamedTuple):
    """Where searches stand.

    Attributes:
        z: Scores, shape (parameter, machine).
        normal: The normal equations there.
        damping: Of the next step.
        has_ended: Whether a search has converged.
        num_steps: Steps taken.
    """

    z: Float[Array, "parameter machine"]
    normal: Normal
    damping: Float[Array, " machine"]
    has_ended: Bool[Array, " machine"]
    num_steps: Int[Array, " machine"]


def linearised(
    structure: Structure, machines: Machines, z: Float[Array, "parameter machine"]
) -> list[Means]:
    """Return residuals [K] and Jacobian of each group of tests."""
    return [
        residuals_of_group(structure, machines, z, group, WORST_RESIDUAL)
        for group in machines.groups
    ]


def normal_equations(
    structure: Structure,
    machines: Machines,
    z: Float[Array, "parameter machine"],
    noise: Noise,
    heat: Heat,
) -> Normal:
    """Return the normal equations of whitened residuals.

    Args:
        structure: What is compiled.
        machines: The numbers.
        z: Scores.
        noise: Noise of each machine, shape (machine,) each.
        heat: What unmodelled heat does to each group of tests, as `Observation.heat`; empty for
            noise that is white, without heat.
    """
    size, num_machines = z.shape
    total = jnp.zeros((1 + size, 1 + size, num_machines))
    for index, (means, group) in enumerate(
        zip(linearised(structure, machines, z), machines.groups, strict=True)
    ):
        columns = [group.moments, means.residual[:, None], means.jacobian]
        own, num_heat = jax.tree.map(group.by_lane, noise), 0
        if heat:
            num_heat = heat[index].shape[1]
            white, _ = filtered(jnp.concatenate([heat[index], *columns], axis=1), own, group)
        else:
            white = weighted(jnp.concatenate(columns, axis=1), own, group)
        num = num_heat + group.moments.shape[1]
        swept, _ = without_columns(scaled_heat(products(white), num_heat, own.heat), num)
        gram = swept[num:, num:]
        total = total + sum(group.by_test(gram))
    return Normal(
        cost=0.5 * (total[0, 0] + jnp.sum(z**2, axis=0)),
        gradient=total[1:, 0] + z,
        curvature=total[1:, 1:] + identity(size, num_machines),
    )


def begun(start: Float[Array, "parameter machine"]) -> Search:
    """Return searches that stand at their starts."""
    size, num_machines = start.shape
    return Search(
        z=start,
        # nothing is known yet: the first step is none, and is taken whatever it finds
        normal=Normal(
            jnp.full(num_machines, jnp.inf, dtype=float),
            jnp.zeros((size, num_machines)),
            identity(size, num_machines),
        ),
        damping=jnp.full(num_machines, DAMPING, dtype=float),
        has_ended=jnp.zeros(num_machines, dtype=bool),
        num_steps=jnp.zeros(num_machines, dtype=int),
    )


def _step(
    now: Normal, damping: Float[Array, " machine"], held: Bool[Array, "parameter machine"]
) -> Float[Array, "parameter machine"]:
    """Return the damped step, no longer than `LONGEST_STEP`; held scores stay.

    It is shortened and not damped more: a damped step goes down the steepest way and then creeps,
    a shortened one stays in the valley.
    """
    unit = jnp.eye(held.shape[0])[:, :, None]
    curvature = jnp.where(held[:, None] | held, unit, now.curvature)
    diagonal = jnp.einsum("iiw->iw", curvature)
    gradient = jnp.where(held, 0.0, now.gradient)
    step = -solve(curvature + (damping * diagonal)[:, None] * unit, gradient)
    length = jnp.max(jnp.abs(step), axis=0)
    return step * jnp.minimum(1.0, LONGEST_STEP / jnp.maximum(length, 1e-300))


@compiled("structure")
def search(
    structure: Structure,
    machines: Machines,
    state: Search,
    noise: Noise,
    heat: Heat,
    most: Int[Array, ""],
    held: Bool[Array, "parameter machine"],
) -> Search:
    """Go on with a search for each lane; arguments as `normal_equations`.

    Args:
        structure: Likewise.
        machines: Likewise.
        state: From `begun`, or from another call.
        noise: Likewise.
        heat: Likewise.
        most: Most steps, those of earlier calls included.
        held: Scores that stay as they are.
    """

    def unfinished(state: Search):
        return jnp.any(~state.has_ended & (state.num_steps < most))

    def advance(state: Search) -> Search:
        z, now, damping, has_ended, num_steps = state
        is_first = jnp.isinf(now.cost)
        step = _step(now, damping, held)
        foreseen = -jnp.sum(step * now.gradient, axis=0) - 0.5 * jnp.einsum(
            "iw,ijw,jw->w", step, now.curvature, step
        )
        ahead = normal_equations(structure, machines, z + step, noise, heat)
        gain = (now.cost - ahead.cost) / jnp.maximum(foreseen, 1e-300)
        # the gain of the last steps drowns in the rounding of the cost
        rounding = ROUNDING * (1.0 + now.cost)
        length = jnp.max(jnp.abs(step), axis=0)
        is_last = (foreseen < rounding) & (ahead.cost - now.cost < rounding) & (length < SHORT)
        is_within = jnp.max(jnp.abs(z + step), axis=0) < FARTHEST
        is_taken = (is_first | (is_within & (gain > POOR)) | is_last) & ~has_ended
        is_small = length < TOLERANCE
        z = jnp.where(is_taken, z + step, z)
        now = jax.tree.map(lambda new, old: jnp.where(is_taken, new, old), ahead, now)
        less = jnp.where((gain > GOOD) | is_last, LESS, 1.0)
        factor = jnp.where(is_taken, less, MORE)
        damping = jnp.where(has_ended | is_first, damping, damping * factor)
        has_ended |= (is_taken & is_small & ~is_first) | (damping > MOST)
        return Search(z, now, damping, has_ended, num_steps + ~has_ended)

    return jax.lax.while_loop(unfinished, advance, state)


@compiled("structure")
def linearise(
    structure: Structure, machines: Machines, z: Float[Array, "parameter machine"]
) -> list[Means]:
    """As `linearised`, compiled."""
    return linearised(structure, machines, z)
