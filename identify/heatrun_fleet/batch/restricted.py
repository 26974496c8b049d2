"""The noise of many machines from their residuals, the parameters integrated out.

The restricted likelihood is that of `heatrun.fit.restricted`, mapped over lanes. A search for the
noise of each machine goes on for all of them at once.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from heatrun.fit.restricted import SCORE_LIMIT, marginal
from heatrun.io.programs import compiled
from heatrun.model.noise import LARGEST_SCORES, from_scores
from lptn.stepping import eliminate

from .march import Machines
from .residuals import Means, each, inner_products
from .search import units

TOLERANCE = 1e-8
"""Largest slope of a search that has ended [nat per prior standard deviation]."""

LONGEST_STEP = 1.5
"""Of a search [prior standard deviations]."""


class Linear(NamedTuple):
    """The linear model around a fit, on which the noise is estimated: scores, and residuals and
    Jacobian of each group of tests there.
    """

    z: Float[Array, "parameter lane"]
    means: list[Means]


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
    num_lanes = start.shape[1]
    low, high = _limits()
    return NoiseSearch(
        noise_z=jnp.clip(start, low, high),
        value=jnp.full(num_lanes, jnp.inf, dtype=float),
        slope=jnp.zeros_like(start),
        curvature=jnp.asarray(CURVATURE)[:, None, None] * units(start),
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
        ahead_value, ahead_slope = restricted(machines, linear, ahead)
        step = ahead - at
        foreseen = -jnp.sum(step * slope, axis=0) - 0.5 * jnp.einsum(
            "iw,ijw,jw->w", step, state.curvature, step
        )
        rounding = 1e-11 * (1.0 + jnp.abs(state.value))
        gain = state.value - ahead_value
        is_last = (jnp.abs(foreseen) < rounding) & (jnp.abs(gain) < 10.0 * rounding)
        is_taken = (is_first | (gain > 0.05 * foreseen) | is_last) & ~has_ended
        is_taken &= jnp.isfinite(ahead_value)
        curvature = _updated(state.curvature, step, ahead_slope - slope, ~is_first & ~has_ended)
        length = jnp.max(jnp.abs(step), axis=0)
        radius = jnp.where(
            is_taken, jnp.where(gain > 0.5 * foreseen, 2.0 * state.radius, state.radius),
            jnp.where(is_first, state.radius, 0.3 * length),
        )  # fmt: skip
        noise_z = jnp.where(is_taken, ahead, at)
        value = jnp.where(is_taken, ahead_value, state.value)
        slope = jnp.where(is_taken, ahead_slope, slope)
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
    held = jnp.where(both, curvature, units(at))
    return -each(eliminate)(held, jnp.where(is_free, slope, 0.0)[:, None])[:, 0]


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
