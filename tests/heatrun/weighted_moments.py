"""Mean and standard deviation of weighted draws, and how far they lie from those of walkers."""

from typing import NamedTuple

import numpy as np

from heatrun.posterior.posterior import Posterior
from heatrun.posterior.weighted import Weighted


class Moments(NamedTuple):
    """Of weighted draws, by score."""

    mean: np.ndarray  # Mean.
    sd: np.ndarray  # Standard deviation.
    error: np.ndarray  # Standard error of the self-normalised mean.


def moments(weighted: Weighted) -> Moments:
    mean = weighted.weights @ weighted.vectors
    shift = weighted.vectors - mean
    sd = np.sqrt(weighted.weights @ shift**2)
    return Moments(mean, sd, np.sqrt(weighted.weights**2 @ shift**2))


def gap_in_errors(weighted: Weighted, ensemble: Posterior) -> np.ndarray:
    """Return the difference of the means over the standard error of both."""
    mean, sd, by_weights = moments(weighted)
    by_steps = sd / np.sqrt(ensemble.convergence.effective_size)
    return (mean - ensemble.flat.mean(axis=0)) / np.hypot(by_weights, by_steps)
