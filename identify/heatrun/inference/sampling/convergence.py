"""Is an ensemble long enough? Autocorrelation, effective sample size and R-hat of affine ensembles.

The walkers of one ensemble move with each other, so none of them is a chain, and a split R-hat
over walkers says little. Here two ensembles run apart: each is one chain of ensemble means, and
their disagreement in units of what their autocorrelation allows is the verdict.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from .diagnostics import split_rhat

ESS_WANTED = 800.0
"""Effective sample size (ESS); the error of a mean is then 4 % of a standard deviation."""

TIMES_WANTED = 25.0
"""Length of each ensemble in autocorrelation times; two ensembles make the customary 50."""

RHAT_LIMIT = 1.02
"""Largest R-hat between the two ensembles and their halves."""


@dataclass(frozen=True)
class Convergence:
    """The verdict on an ensemble.

    Attributes:
        num_steps: Steps of each ensemble after burn-in.
        autocorrelation: Longest integrated autocorrelation time [steps].
        effective_size: Smallest effective sample size (ESS).
        rhat: Largest R-hat [1].
    """

    num_steps: int
    autocorrelation: float
    effective_size: float
    rhat: float

    @property
    def is_enough(self) -> bool:
        """Whether all three criteria hold."""
        return (
            self.effective_size >= ESS_WANTED
            and self.num_steps >= TIMES_WANTED * self.autocorrelation
            and self.rhat <= RHAT_LIMIT
        )

    def sentence(self) -> str:
        """Return the verdict in words."""
        figures = (
            f"ESS {self.effective_size:.0f}, R-hat {self.rhat:.3f}, {self.num_steps} steps of "
            f"autocorrelation time {self.autocorrelation:.0f}"
        )
        if self.is_enough:
            return f"MCMC converged ({figures})."
        return (
            f"MCMC has not converged ({figures}; required: effective sample size (ESS) "
            f"{ESS_WANTED:.0f}, R-hat {RHAT_LIMIT}, {TIMES_WANTED:.0f} autocorrelation times): the "
            "intervals are indicative."
        )


def judge(chains: Float[np.ndarray, "ensemble step walker parameter"]) -> Convergence:
    """Judge ensembles that ran apart.

    Args:
        chains: Positions after burn-in.

    Reference: J. Goodman, J. Weare, Ensemble samplers with affine invariance, Communications in
        Applied Mathematics and Computational Science 5 (2010) 65-80, section 5.
    """
    from emcee.autocorr import integrated_time  # as in `posterior`: only who samples needs it

    _, num_steps, num_walkers, _ = chains.shape
    with np.errstate(invalid="ignore"):  # a walker that never moved: 0/0, taken for all its steps
        times = np.mean([integrated_time(chain, quiet=True, tol=0) for chain in chains], axis=0)
    times = np.maximum(np.where(np.isfinite(times), times, num_steps), 1.0)
    draws = chains.shape[0] * num_steps * num_walkers / times
    return Convergence(
        num_steps=num_steps,
        autocorrelation=float(np.max(times)),
        effective_size=float(np.min(draws)),
        # a chain is an ensemble: all its walkers, step by step
        rhat=float(np.max(split_rhat(chains.reshape(chains.shape[0], -1, chains.shape[-1])))),
    )
