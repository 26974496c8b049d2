"""The law of a population: normal over machines, with outliers, and the density of its parameters.

The parameters of a machine are normal about a mean that may depend on covariates (supplier, date),
with a covariance that all machines share. A few machines are something else: theirs is the same law
`OUTLIER_SCALE` times as wide. The parameters of a machine are integrated out in closed form.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from heatrun.model.noise import eliminated

MOST_CANCELLED = 1e12
"""Size of terms that cancel, of which rounding leaves 1e-3 nat; a spread a million times that of
what is known of a machine."""

OUTLIER_SCALE = 8.0
"""Spread of machines that do not fit over that of those that do [1]."""

OUTLIER_SHARE = 0.03
"""Share of outliers, median of its prior [1]; 0.4 to 19 % in 95 % (logistic normal)."""

OUTLIER_SD = 1.0
"""Standard deviation of its logit [1]."""

LKJ = 2.0
"""Exponent of the prior of the correlations: 1 is uniform, more draws them to zero.

Reference: D. Lewandowski, D. Kurowicka, H. Joe, Generating random correlation matrices based on
    vines and extended onion method, Journal of Multivariate Analysis 100 (2009) 1989-2001.
"""


class Hyperprior(eqx.Module):
    """What is assumed of a population before its machines are seen."""

    # Centre of the normal prior of the population's mean, shape (parameter,).
    mean: Float[np.ndarray, " parameter"]
    mean_sd: Float[np.ndarray, " parameter"]  # Its standard deviation, shape (parameter,).
    # Standard deviation of the coefficients of the covariates, shape (parameter,).
    effect_sd: Float[np.ndarray, " parameter"]
    # Scale of the half-Cauchy prior of the standard deviation over machines, shape (parameter,);
    # half of it lies below, and its tail excludes no spread.
    spread: Float[np.ndarray, " parameter"]
    # Whether some machines may be something else.
    has_outliers: bool = eqx.field(static=True, default=True)


class Law(NamedTuple):
    """A population, or many draws of it along leading axes."""

    mean: Array  # Shape (..., parameter).
    effects: Array  # Coefficients of the covariates, shape (..., covariate, parameter).
    # Lower Cholesky factor of the covariance over machines, shape (..., parameter, parameter).
    factor: Array
    outlier_share: Array  # Shape (...).

    @property
    def sd(self) -> Array:
        """Standard deviation over machines, shape (..., parameter)."""
        return jnp.sqrt(jnp.sum(self.factor**2, axis=-1))

    @property
    def correlation(self) -> Array:
        """Correlations over machines, shape (..., parameter, parameter)."""
        scaled = self.factor / self.sd[..., None]
        return scaled @ jnp.swapaxes(scaled, -1, -2)


def num_scores(size: int, num_covariates: int) -> int:
    """Return the number of scores of a law of so many parameters and covariates."""
    return 2 * size + num_covariates * size + size * (size - 1) // 2 + 1


def unpack(
    scores: Float[Array, " score"], hyper: Hyperprior, num_covariates: int
) -> tuple[Law, Float[Array, ""]]:
    """Return the law of scores, and the log density of its prior over the scores [nat].

    The scores are unbounded: mean and coefficients in units of their prior, log spread in units of
    its scale, partial correlations, logit of the share of outliers.
    """
    size = hyper.mean.size
    cuts = np.cumsum([size, num_covariates * size, size, size * (size - 1) // 2])
    of_mean, of_effects, of_spread, of_partial, of_share = jnp.split(scores, cuts)
    mean = jnp.asarray(hyper.mean) + hyper.mean_sd * of_mean
    effects = of_effects.reshape(num_covariates, size) * hyper.effect_sd
    ratio = jnp.exp(of_spread)
    correlation, log_prior = _correlation(of_partial, size)
    share = jax.nn.sigmoid(jnp.log(OUTLIER_SHARE / (1 - OUTLIER_SHARE)) + OUTLIER_SD * of_share[0])
    log_prior -= 0.5 * jnp.sum(of_mean**2) + 0.5 * jnp.sum(of_effects**2)
    log_prior -= 0.5 * of_share[0] ** 2
    log_prior += jnp.sum(of_spread - jnp.log1p(ratio**2))  # half-Cauchy, by the logarithm
    factor = (jnp.asarray(hyper.spread) * ratio)[:, None] * correlation
    return Law(mean, effects, factor, share), log_prior


def _correlation(
    partial: Float[Array, " pair"], size: int
) -> tuple[Float[Array, "parameter parameter"], Float[Array, ""]]:
    """Return the Cholesky factor of a correlation matrix, and the log density of its prior."""
    rows, log_prior, first = [], jnp.zeros(()), 0
    for row in range(size):
        left, entries = jnp.ones(()), []
        for _ in range(row):
            r = jnp.tanh(partial[first])
            entries.append(r * jnp.sqrt(left))
            log_prior += jnp.log1p(-(r**2)) + 0.5 * jnp.log(left)
            left = left * (1.0 - r**2)
            first += 1
        if row:
            log_prior += 0.5 * (size - row - 1 + 2.0 * LKJ - 2.0) * jnp.log(left)
        rows.append(jnp.stack([*entries, jnp.sqrt(left), *[jnp.zeros(())] * (size - row - 1)]))
    return jnp.stack(rows), log_prior


def log_marginals(
    law: Law,
    design: Float[Array, "machine covariate"],
    information: Float[Array, "machine parameter"],
    precision: Float[Array, "machine parameter parameter"],
    *,
    has_outliers: bool,
) -> tuple[Float[Array, " machine"], Float[Array, " machine"]]:
    """Return each machine's log marginal likelihood as one of the population, and as an outlier.

    With the share of each; the outliers' is minus infinity where there are none.
    """
    centre = law.mean + design @ law.effects

    def one(factor: Array) -> Array:
        return jax.vmap(lambda c, h, L: log_marginal(c, factor, h, L))(
            centre, information, precision
        )

    usual = one(law.factor)
    if not has_outliers:
        return usual, jnp.full_like(usual, -jnp.inf)
    other = one(OUTLIER_SCALE * law.factor)
    return usual + jnp.log1p(-law.outlier_share), other + jnp.log(law.outlier_share)


def log_marginal(
    centre: Float[Array, " parameter"],
    factor: Float[Array, "parameter parameter"],
    information: Float[Array, " parameter"],
    precision: Float[Array, "parameter parameter"],
) -> Float[Array, ""]:
    r"""Return $\log\int N(x; m, CC^T) \exp(h^T x - x^T L x / 2)\,dx$ for any L without negative
    eigenvalues.

    Minus infinity where the law is so wide, or so far from the machine, that rounding leaves
    nothing of it.
    """
    pull = factor.T @ (information - precision @ centre)
    inner = factor.T @ precision @ factor
    rest, half_log_det = _eliminated(inner, pull[:, None])
    at_centre = information @ centre - 0.5 * centre @ precision @ centre
    gained = -0.5 * rest[0, 0]
    # beyond, the identity beside `inner` and the difference of the two terms are noise: a draw in
    # the far tail of a proposal once had a density 20 000 nat above the mode
    largest = jnp.maximum(jnp.max(jnp.diag(inner)), jnp.abs(at_centre) + gained)
    return jnp.where(largest < MOST_CANCELLED, at_centre + gained - half_log_det, -jnp.inf)


def given_machine(
    centre: Float[Array, " parameter"],
    factor: Float[Array, "parameter parameter"],
    information: Float[Array, " parameter"],
    precision: Float[Array, "parameter parameter"],
) -> tuple[Float[Array, " parameter"], Float[Array, "parameter parameter"]]:
    """Return mean and covariance of a machine under a law."""
    pull = factor.T @ (information - precision @ centre)
    beside = jnp.concatenate([pull[:, None], factor.T], axis=1)
    rest, _ = _eliminated(factor.T @ precision @ factor, beside)
    return centre - rest[0, 1:], -rest[1:, 1:]


def _eliminated(inner: Array, beside: Array) -> tuple[Array, Array]:
    """Return -B' inv(I + A) B of such columns, and half the log determinant of I + A."""
    nothing = jnp.zeros((beside.shape[1],) * 2)
    return eliminated(jnp.block([[inner, beside], [beside.T, nothing]]), inner.shape[0])
