"""The prior of the next machine of a type: what its sisters say before its first test."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from .law import OUTLIER_SCALE
from .sampling import Population


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
