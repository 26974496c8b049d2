"""The noise of many machines from their residuals, the parameters integrated out.

The restricted likelihood is that of `heatrun.fit.restricted`, mapped over lanes. A search for the
noise of each machine goes on for all of them at once.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from heatrun.fit.restricted import SCORE_LIMIT, marginal
from heatrun.io.programs import compiled
from heatrun.model.noise import LARGEST_SCORES, from_scores

from .march import Machines
from .residuals import Means, each, inner_products
from .search import MOST_STEPS, Normal, Search, begun, descended, units


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


CURVATURE = (600.0, 30.0, 300.0, 5.0)
"""Second derivatives that a search begins with [nat]: of some hundred blocks, per prior sd."""

LOW = np.full((len(LARGEST_SCORES), 1), -SCORE_LIMIT)
HIGH = np.array(LARGEST_SCORES)[:, None]


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
