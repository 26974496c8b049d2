"""The noise of many machines from their residuals, the parameters integrated out.

The restricted likelihood is that of `heatrun.fit.restricted`; here its gradient is written out.
Heat and parameters are both standard normals that act through columns X of the residuals: with the
precision A = X'X + 1 and u its most probable value, the gradient by a parameter of the noise is
that of the whitened columns Y contracted with Y C, where C = (inv(A) + u u', -u; -u', 1).
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from heatrun.fit.restricted import SCORE_LIMIT
from heatrun.io.programs import compiled
from heatrun.model.noise import LARGEST_SCORES, NOISE, from_scores

from .march import Machines
from .residuals import (
    Means,
    filtered,
    identity,
    products,
    scaled_heat,
    solve,
    sweep,
    without_columns,
)
from .search import Heat

TOLERANCE = 1e-8
"""Largest slope of a search that has ended [nat per prior standard deviation]."""

LONGEST_STEP = 1.5
"""Of a search [prior standard deviations]."""

NUM_FILTER = 3
"""Parameters of the noise that the filter takes; the last one is the size of the heat."""


class Linear(NamedTuple):
    """The linear model around a fit, on which the noise is estimated: scores, residuals and
    Jacobian of each group of tests there, and what unmodelled heat does to each.
    """

    z: Float[Array, "parameter lane"]
    means: list[Means]
    heat: Heat


class Restricted(NamedTuple):
    """The restricted likelihood of a noise."""

    value: Float[Array, " lane"]  # Minus its logarithm, prior included, up to a constant [nat].
    slope: Float[Array, "noise lane"]  # Its derivative by the scores of the noise.
    squares: Float[Array, " lane"]  # Squared whitened residuals, heat integrated out [1].
    # Half the log determinant of the covariance of noise and heat.
    half_log_det: Float[Array, " lane"]
    covariance: Float[Array, "parameter parameter lane"]  # Of the parameters.


def restricted(
    machines: Machines, linear: Linear, noise_z: Float[Array, "noise lane"]
) -> Restricted:
    """Return the restricted likelihood of the noise of each machine and its slope."""
    size, num_lanes = linear.z.shape
    directions = jnp.eye(len(NOISE))[:NUM_FILTER]

    total, half_log_det = jnp.zeros((1 + size, 1 + size, num_lanes)), jnp.zeros(num_lanes)
    parts = []
    for means, heat, group in zip(linear.means, linear.heat, machines.groups, strict=True):
        num_heat, num = heat.shape[1], heat.shape[1] + group.moments.shape[1]
        columns = jnp.concatenate(
            [heat, group.moments, means.residual[:, None], means.jacobian], axis=1
        )
        own = group.by_lane(noise_z)

        def whitened(noise_z, columns=columns, group=group):
            return filtered(columns, from_scores(noise_z), group)

        def push(direction, whitened=whitened, own=own):
            return jax.jvp(whitened, (own,), (jnp.broadcast_to(direction[:, None], own.shape),))

        (white, log_sd), (white_slope, log_sd_slope) = jax.vmap(push, out_axes=(None, 0))(
            directions
        )
        factor = from_scores(own).heat
        gram = scaled_heat(products(white), num_heat, factor)
        swept, of_heat = without_columns(gram, num)
        total = total + sum(group.by_test(swept[num:, num:]))
        half_log_det = half_log_det + sum(group.by_test(log_sd + of_heat))
        parts.append((group, num_heat, factor, white, white_slope, log_sd_slope, gram, swept))

    # of the parameters, whose prior pulls from z to zero; they come before the residual
    order = jnp.roll(jnp.arange(1 + size), -1)
    total = total[order][:, order]
    squares = total[size, size]
    gradient = total[:size, size] + linear.z
    system = total.at[:size, :size].add(identity(size, num_lanes))
    system = system.at[:size, size].set(gradient).at[size, :size].set(gradient)
    system = system.at[size, size].add(jnp.sum(linear.z**2, axis=0))
    done, of_parameters = sweep(system, size)
    covariance, best = -done[:size, :size], done[:size, size]
    prior = 0.5 * jnp.sum(noise_z**2, axis=0)
    value = 0.5 * done[size, size] + half_log_det + of_parameters + prior

    slope = noise_z
    spread = covariance + best[:, None] * best[None]
    outer = jnp.concatenate([
        jnp.concatenate([jnp.ones((1, 1, num_lanes)), -best[None]], axis=1),
        jnp.concatenate([-best[:, None], spread], axis=1),
    ])  # fmt: skip
    for group, num_heat, factor, white, white_slope, log_sd_slope, gram, swept in parts:
        weight = _contraction(swept, group.by_lane(outer), gram.shape[0] - 1 - size)
        scaled = jnp.moveaxis(scaled_heat(weight, num_heat, factor), -1, 0)
        pulled = jnp.einsum("wbi,wij->wbj", white, scaled)
        of_filter = jnp.einsum("wbj,nwbj->nw", pulled, white_slope) + log_sd_slope
        # the columns of the heat grow with its logarithm
        of_heat = HEAT_SD * jnp.einsum("ijw,ijw->w", gram[:num_heat], weight[:num_heat])
        slope = slope + sum(group.by_test(jnp.concatenate([of_filter, of_heat[None]])))
    return Restricted(value, slope, squares, half_log_det, covariance)


HEAT_SD = NOISE[NUM_FILTER].sd


def _contraction(
    swept: Float[Array, "column column lane"], outer: Float[Array, "rest rest lane"], num: int
) -> Float[Array, "column column lane"]:
    """Return C of a test: heat and moments of load steps first, then the residual and the
    parameters, as its columns are. The first `num` columns of the inner products are swept out;
    `outer` is C of the others.
    """
    own, beside = -swept[:num, :num], swept[:num, num:]
    crossed = -jnp.einsum("hiw,ijw->hjw", beside, outer)
    of_heat = own - jnp.einsum("hjw,gjw->hgw", crossed, beside)
    top = jnp.concatenate([of_heat, crossed], axis=1)
    return jnp.concatenate([top, jnp.concatenate([jnp.swapaxes(crossed, 0, 1), outer], axis=1)])


class NoiseSearch(NamedTuple):
    """Where searches of the noise stand: minus the log likelihood there [nat], its slope, what is
    known of the second derivative, and the longest step [prior standard deviations].
    """

    noise_z: Float[Array, "noise lane"]
    value: Float[Array, " lane"]
    slope: Float[Array, "noise lane"]
    curvature: Float[Array, "noise noise lane"]
    radius: Float[Array, " lane"]
    has_ended: Bool[Array, " lane"]
    num_steps: Int[Array, " lane"]


def begun(start: Float[Array, "noise lane"]) -> NoiseSearch:
    """Return searches that stand at their starts, moved within the limits."""
    size, num_lanes = start.shape
    low, high = _limits()
    return NoiseSearch(
        noise_z=jnp.clip(start, low, high),
        value=jnp.full(num_lanes, jnp.inf, dtype=float),
        slope=jnp.zeros((size, num_lanes)),
        curvature=jnp.asarray(CURVATURE)[:, None, None] * identity(size, num_lanes),
        radius=jnp.full(num_lanes, LONGEST_STEP, dtype=float),
        has_ended=jnp.zeros(num_lanes, dtype=bool),
        num_steps=jnp.zeros(num_lanes, dtype=int),
    )


CURVATURE = (600.0, 30.0, 300.0, 5.0)
"""Second derivatives that a search begins with [nat]: of some hundred blocks, per prior sd."""


def _limits() -> tuple[Float[Array, "noise 1"], Float[Array, "noise 1"]]:
    high = jnp.asarray(LARGEST_SCORES)[:, None]
    return jnp.full_like(high, -SCORE_LIMIT), high


@compiled()
def search_noise(
    machines: Machines, linear: Linear, state: NoiseSearch, most: Int[Array, ""]
) -> NoiseSearch:
    """Go on with a search for the noise of each machine: quasi-Newton steps within the limits, at
    most so many, those of earlier calls included.
    """
    low, high = _limits()

    def unfinished(state: NoiseSearch):
        return jnp.any(~state.has_ended & (state.num_steps < most))

    def advance(state: NoiseSearch) -> NoiseSearch:
        at, slope, has_ended = state.noise_z, state.slope, state.has_ended
        is_first = jnp.isinf(state.value)
        step = _bounded_step(at, slope, state.curvature, low, high)
        length = jnp.max(jnp.abs(step), axis=0)
        step = step * jnp.minimum(1.0, state.radius / jnp.maximum(length, 1e-300))
        ahead = jnp.where(is_first | has_ended, at, jnp.clip(at + step, low, high))
        found = restricted(machines, linear, ahead)
        step = ahead - at
        foreseen = -jnp.sum(step * slope, axis=0) - 0.5 * jnp.einsum(
            "iw,ijw,jw->w", step, state.curvature, step
        )
        rounding = 1e-11 * (1.0 + jnp.abs(state.value))
        gain = state.value - found.value
        is_last = (jnp.abs(foreseen) < rounding) & (jnp.abs(gain) < 10.0 * rounding)
        is_taken = (is_first | (gain > 0.05 * foreseen) | is_last) & ~has_ended
        is_taken &= jnp.isfinite(found.value)
        curvature = _updated(state.curvature, step, found.slope - slope, ~is_first & ~has_ended)
        length = jnp.max(jnp.abs(step), axis=0)
        radius = jnp.where(
            is_taken, jnp.where(gain > 0.5 * foreseen, 2.0 * state.radius, state.radius),
            jnp.where(is_first, state.radius, 0.3 * length),
        )  # fmt: skip
        noise_z = jnp.where(is_taken, ahead, at)
        value = jnp.where(is_taken, found.value, state.value)
        slope = jnp.where(is_taken, found.slope, slope)
        is_free = _is_free(noise_z, slope, low, high)
        steepest = jnp.max(jnp.abs(jnp.where(is_free, slope, 0.0)), axis=0)
        ended = has_ended | (steepest < TOLERANCE) | (radius < 1e-13)
        return NoiseSearch(
            noise_z, value, slope, curvature, jnp.minimum(radius, LONGEST_STEP), ended,
            state.num_steps + ~has_ended,
        )  # fmt: skip

    return jax.lax.while_loop(unfinished, advance, state)


def _is_free(at, slope, low, high) -> Bool[Array, "noise lane"]:
    """Return which scores are not held at a limit that the slope drives them beyond."""
    return ~(((at <= low) & (slope > 0.0)) | ((at >= high) & (slope < 0.0)))


def _bounded_step(at, slope, curvature, low, high) -> Float[Array, "noise lane"]:
    """Return the quasi-Newton step of the scores that are free."""
    is_free = _is_free(at, slope, low, high)
    both = is_free[:, None] & is_free[None]
    unit = identity(at.shape[0], at.shape[1])
    return -solve(jnp.where(both, curvature, unit), jnp.where(is_free, slope, 0.0))


def _updated(curvature, step, change, is_wanted) -> Float[Array, "noise noise lane"]:
    """Return the second derivative with what a step has shown of it (BFGS, damped by Powell).

    Reference: J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed., procedure 18.2.
    """
    pushed = jnp.einsum("ijw,jw->iw", curvature, step)
    inner, seen = jnp.sum(step * pushed, axis=0), jnp.sum(step * change, axis=0)
    is_enough = seen >= 0.2 * inner
    theta = jnp.where(is_enough, 1.0, 0.8 * inner / jnp.where(is_enough, 1.0, inner - seen))
    change = theta * change + (1.0 - theta) * pushed
    seen = jnp.sum(step * change, axis=0)
    is_wanted = is_wanted & (inner > 1e-28) & (seen > 1e-28)
    inner, seen = jnp.where(is_wanted, inner, 1.0), jnp.where(is_wanted, seen, 1.0)
    after = (
        curvature - pushed[:, None] * pushed[None] / inner + change[:, None] * change[None] / seen
    )
    return jnp.where(is_wanted, after, curvature)


@compiled()
def noise_precision(
    machines: Machines, linear: Linear, noise_z: Float[Array, "noise lane"]
) -> Float[Array, "noise noise lane"]:
    """Return the second derivative of minus the restricted likelihood, by differences.

    As `heatrun.fit.restricted.noise_precision`, whose width it shares.
    """
    width = 1e-4
    shifts = width * jnp.concatenate([jnp.eye(len(NOISE)), -jnp.eye(len(NOISE))])

    def slope(shift):
        return restricted(machines, linear, noise_z + shift[:, None]).slope

    slopes = jax.lax.map(slope, shifts)
    return (slopes[: len(NOISE)] - slopes[len(NOISE) :]) / (2 * width)
