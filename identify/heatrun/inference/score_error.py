"""How sure a mean log score is, where neighbouring blocks err alike.

The scores of a test's blocks are no independent draws: an error that lasts ten minutes spoils all
blocks within. The standard error of their mean is that of an autocorrelated series: it is freed of
an autoregression of first order, the rest is summed with the weights of Bartlett, and the
autoregression is put back (prewhitening).

Reference: D. W. K. Andrews, J. C. Monahan, An improved heteroskedasticity and autocorrelation
    consistent covariance matrix estimator, Econometrica 60 (1992) 953; W. K. Newey, K. D. West,
    Econometrica 55 (1987) 703; M. G. Kendall, Biometrika 41 (1954) 403 (bias of the
    autocorrelation).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import norm

from ..results.values import Role
from .predict import Prediction

FEWEST = 10
"""Blocks below which a standard error cannot be estimated."""

DECIDED = 2.0
"""Standard errors that a difference of scores must be from zero to decide [1]: 95 %."""


@dataclass(frozen=True)
class ScoreDifference:
    """Mean log score per block of one network less that of another, over the held-out tests.

    Attributes:
        difference: Network with more nodes minus the other, mean over the tests [nat].
        standard_error: Of it, from the differences block by block [nat].
    """

    difference: float
    standard_error: float

    @property
    def is_decided(self) -> bool:
        """Whether it is more than two standard errors from zero."""
        return abs(self.difference) > DECIDED * self.standard_error


def block_scores(prediction: Prediction) -> Float[np.ndarray, " observed"]:
    """Return the log density of each measured block mean under its predicted normal [nat]."""
    seen = prediction.test.is_observed
    return norm.logpdf(prediction.residual[seen], scale=prediction.sd[seen])


def standard_error(series: Float[np.ndarray, " observed"]) -> float | None:
    """Return the standard error of the mean of a correlated series, None for less than ten values.

    Args:
        series: Values in their order, in any unit.

    Returns:
        In the unit of the series. What stays alike over the whole series has its standard
        deviation as standard error, at most.
    """
    num = series.size
    if num < FEWEST or not np.all(np.isfinite(series)):
        return None
    x = series - series.mean()
    square = float(x @ x)
    if square == 0.0:
        return 0.0
    phi = float(x[1:] @ x[:-1]) / square
    phi = min(phi + (1.0 + 3.0 * phi) / num, 1.0 - 2.0 / num)
    fresh = x[1:] - phi * x[:-1]
    lags = math.floor(4.0 * (num / 100.0) ** (2.0 / 9.0))
    # Bartlett's weights keep the sum positive
    variance = float(fresh @ fresh) / fresh.size
    for lag in range(1, lags + 1):
        share = 1.0 - lag / (lags + 1.0)
        variance += 2.0 * share * float(fresh[lag:] @ fresh[:-lag]) / fresh.size
    return math.sqrt(max(variance, 0.0) / num) / (1.0 - phi)


def score_difference(
    small: Sequence[Prediction], large: Sequence[Prediction], roles: Sequence[Role]
) -> ScoreDifference | None:
    """Return the difference of two networks' scores; None without a held-out test of ten blocks.

    Args:
        small: Predictions of the network with fewer nodes, one per test.
        large: Those of the other one, in the same order.
        roles: `"calibration"` or `"holdout"`, one per test.
    """
    means, errors = [], []
    for one, two, role in zip(small, large, roles, strict=True):
        if role != "holdout" or not (one.is_there and two.is_there):
            continue
        series = block_scores(two) - block_scores(one)
        error = standard_error(series)
        if error is None:
            return None
        means.append(float(series.mean()))
        errors.append(error)
    if not means:
        return None
    return ScoreDifference(float(np.mean(means)), float(np.linalg.norm(errors)) / len(errors))
