"""Limits of a data sheet: where so many machines lie, at such a confidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import norm

from .sampling import Population


@dataclass(frozen=True)
class Limits:
    """Tolerance limits of each parameter, in the space in which the parameters are normal.

    Attributes:
        two_sided: Interval that holds the content, shape (2, parameter).
        lower: Limit that the content lies above, shape (parameter,).
        upper: Limit that the content lies below, shape (parameter,).
    """

    two_sided: Float[np.ndarray, "2 parameter"]
    lower: Float[np.ndarray, " parameter"]
    upper: Float[np.ndarray, " parameter"]


def tolerance_limits(
    population: Population, *, content: float = 0.95, confidence: float = 0.95
) -> Limits:
    """Return the limits that hold a share of the machines of the type, outliers left aside.

    Args:
        population: Draws of its law; covariates at their mean over the machines.
        content: Share of the machines [1].
        confidence: Probability that the limits hold it [1].

    Reference: K. Krishnamoorthy, T. Mathew, Statistical Tolerance Regions, Wiley, 2009, chapter 11
        (Bayesian tolerance intervals).
    """
    mean, sd = np.asarray(population.laws.mean), np.asarray(population.laws.sd)
    above = norm.ppf(content)
    return Limits(
        two_sided=_two_sided(mean, sd, content, confidence),
        lower=np.quantile(mean - above * sd, 1.0 - confidence, axis=0),
        upper=np.quantile(mean + above * sd, confidence, axis=0),
    )


def _two_sided(mean: np.ndarray, sd: np.ndarray, content: float, confidence: float) -> np.ndarray:
    """Return the shortest interval about the mean that holds the content at the confidence."""
    middle = mean.mean(axis=0)
    low, high = np.zeros_like(middle), 40.0 * sd.mean(axis=0) + 10.0 * mean.std(axis=0)
    for _ in range(60):
        half = 0.5 * (low + high)
        held = norm.cdf((middle + half - mean) / sd) - norm.cdf((middle - half - mean) / sd)
        is_wide = np.mean(held >= content, axis=0) >= confidence
        low, high = np.where(is_wide, low, half), np.where(is_wide, half, high)
    return np.stack([middle - high, middle + high])
