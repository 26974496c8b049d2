"""The prior of the next machine of a type: what its sisters say before its first test."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from .law import OUTLIER_SCALE
from .sampling import Population

DRAWS_PER_LAW = 20
"""Machines that are drawn from each draw of the law."""


def next_machine(
    population: Population,
) -> tuple[Float[np.ndarray, " parameter"], Float[np.ndarray, "parameter parameter"]]:
    """Return mean and covariance of the parameters of one more machine, all left open.

    In the space in which the parameters are normal; covariates at their mean over the machines. It
    may be an outlier, too, by the share that was found.
    """
    laws = population.laws
    mean = np.asarray(laws.mean)
    factor = np.asarray(laws.factor)
    within = factor @ np.swapaxes(factor, -1, -2)
    if population.hyper.has_outliers:
        share = np.asarray(laws.outlier_share)
        within = within * (1.0 + share * (OUTLIER_SCALE**2 - 1.0))[:, None, None]
    return mean.mean(axis=0), within.mean(axis=0) + np.atleast_2d(np.cov(mean.T))


def next_interval(population: Population, *, seed: int = 0) -> Float[np.ndarray, "2 parameter"]:
    """Return the 95 % interval of each parameter of one more machine; as `next_machine`.

    Of draws of it: a law with few machines that are something else has longer tails than the normal
    law of its mean and covariance, and a narrower middle.

    Args:
        population: Draws of its law.
        seed: Random seed.
    """
    laws, rng = population.laws, np.random.default_rng([seed, 18])
    mean, factor = np.asarray(laws.mean), np.asarray(laws.factor)
    num = mean.shape[0] * DRAWS_PER_LAW
    mean, factor = (np.repeat(each, DRAWS_PER_LAW, axis=0) for each in (mean, factor))
    share = np.repeat(np.asarray(laws.outlier_share), DRAWS_PER_LAW)
    is_other = population.hyper.has_outliers & (rng.uniform(size=num) < share)
    width = np.where(is_other, OUTLIER_SCALE, 1.0)[:, None]
    drawn = np.einsum("nij,nj->ni", factor, rng.standard_normal(mean.shape))
    return np.quantile(mean + width * drawn, [0.025, 0.975], axis=0)
