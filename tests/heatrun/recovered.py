"""Whether a fit has found what its record was made with."""

from collections.abc import Mapping

import numpy as np

from heatrun.fit.fit_result import Fit


def in_sds(found: Fit, name: str, true: float) -> float:
    """Return how far a parameter is off, in its standard deviations."""
    place = found.problem.parameters.index(name)
    return float((found.z[place] - found.slots[place].parameter.score(true)) / sd(found, name))


def sd(found: Fit, name: str) -> float:
    """Return a parameter's standard deviation over that of its prior."""
    place = found.problem.parameters.index(name)
    return float(np.sqrt(found.covariance[place, place]))


def holds(found: Fit, truth: Mapping[str, float], sds: float = 3.0) -> None:
    for name, true in truth.items():
        assert abs(in_sds(found, name, true)) < sds, name


def log_sd(found: Fit, name: str) -> float:
    """Return the standard deviation of the logarithm of a parameter of the network [1]."""
    return sd(found, name) * found.slots[found.problem.parameters.index(name)].parameter.sd
