"""Log densities of the draws of a run, for prior sensitivity and leave-one-out cross-validation.

`arviz.loo(run.idata, var_name="winding")` predicts windows of some minutes that are left out, and
`arviz.psens(run.idata)` (0.23) or `arviz.psense_summary(run.idata)` (1.x) tells which parameters
the priors hold and which the data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..model.discrepancy import left_out, windows
from ..posterior.posterior import Posterior

LEFT_OUT = (
    "Log density [nat] of a window of block means given all others and the draw, shape "
    "(chain, draw, window): exact for correlated noise, so loo over it is leave-one-window-out. Of "
    "the network alone, also where the posterior is averaged over effects that it may miss."
)
DEPENDENCE = (
    "Log likelihood of all block means less the sum over the windows [nat]: what windows have in "
    "common, as they share their noise. Both variables together are the log likelihood of a draw."
)
PRIOR = (
    "Log density of each parameter's prior [nat], of its standard score: of the logarithm of the "
    "value where the prior is lognormal."
)


@dataclass(frozen=True)
class Densities:
    """Log densities of draws [nat].

    Attributes:
        prior: Of the score of each parameter and of the noise.
        winding: Of each window given all other readings.
        dependence: Log likelihood less the sum of these.
        windows: Test and times of each window, in words.
    """

    prior: Float[np.ndarray, "chain draw all"]
    winding: Float[np.ndarray, "chain draw window"]
    dependence: Float[np.ndarray, "chain draw"]
    windows: tuple[str, ...]


def densities(posterior: Posterior) -> Densities:
    """Return the log densities of the draws of a posterior.

    Where it is averaged over effects that the network may miss, of the draws of the network alone.
    """
    posterior = posterior.alone or posterior
    problem = posterior.fit.problem
    cut = windows(problem)
    shape = posterior.vectors.shape
    winding = left_out(problem, cut, posterior.flat).reshape(*shape[:2], -1)
    prior = -0.5 * posterior.vectors**2 - 0.5 * np.log(2 * np.pi)
    likelihood = posterior.log_density - prior.sum(axis=-1)
    names = [
        f"{problem.tests[test].name}, {low:.0f} to {high:.0f} s"
        for test, low, high in zip(cut.test, cut.from_s, cut.to_s, strict=True)
    ]
    # half the size, and 1e-6 nat is nothing
    halved = winding.astype(np.float32)
    return Densities(prior, halved, likelihood - halved.sum(axis=-1, dtype=float), tuple(names))
