"""Draws from around the optima of a fit, and their importance weights under the posterior.

The quick posterior follows the model where it bends (`rto.Rto`), weighted by the true density, the
largest weights smoothed by a Pareto law whose shape is the guard. The ensemble sampler starts from
cheaper draws of the linear models (`proposal.Proposal`), so that hardly any burn-in is needed; they
may miss a tail that no guard sees, which the walkers find.
"""

from __future__ import annotations

import numpy as np

from ..fit.fit_result import Fit
from .proposal import Drawn, Proposal
from .rounds import sample_rto
from .weighted import Weighted, evaluate, truncated

NUM_ADAPTATIONS = 5
"""Most rounds in which the proposal is moved to the importance samples of the round before; one
that is sound gains little (`duty_90min`: effective sizes of 11, 14, 11, 13 % of the draws)."""


def importance_sample(fit: Fit, *, seed: int = 0) -> Weighted:
    """Draw from a posterior by following the model, and weigh by the density.

    Args:
        fit: Optima and covariance.
        seed: Of the draws.

    Reference: A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, Pareto Smoothed Importance
        Sampling, Journal of Machine Learning Research 25 (2024) 72.
    """
    followed = _followed(fit, np.random.default_rng(seed))
    if followed is not None and followed.is_sound:
        return followed
    linear = linear_sample(fit, seed=seed)
    return linear if followed is None or linear.is_sound else followed


def starting_sample(fit: Fit, *, seed: int = 0) -> Weighted:
    """Return draws to start walkers from: those of the linear models where they are sound."""
    cheap = linear_sample(fit, seed=seed)
    if cheap.is_sound:
        return cheap
    found = _followed(fit, np.random.default_rng([seed, 3]))
    return cheap if found is None else found


def linear_sample(fit: Fit, *, num_draws: int = 4096, seed: int = 0) -> Weighted:
    """Draw from the linear models around the optima and weigh by the posterior.

    Args:
        fit: Optima and covariance.
        num_draws: Number of draws.
        seed: Of the draws.
    """
    rng = np.random.default_rng(seed)
    proposal = Proposal.around(fit, rng)
    drawn = proposal.draw(num_draws, rng)
    best = _weigh(fit, proposal, drawn)
    proposal = proposal.adapted(drawn, truncated(best.weights), rng)
    for _ in range(NUM_ADAPTATIONS):
        if best.is_sound:
            break
        drawn = proposal.draw(num_draws, rng)
        weighted = _weigh(fit, proposal, drawn)
        proposal = proposal.adapted(drawn, truncated(weighted.weights), rng)
        if weighted.effective_size > best.effective_size:
            best = weighted
    return best


def _followed(fit: Fit, rng: np.random.Generator) -> Weighted | None:
    return sample_rto(fit, Proposal.around(fit, rng).kernels, rng)


def _weigh(fit: Fit, proposal: Proposal, drawn: Drawn) -> Weighted:
    return Weighted.of(drawn.vectors, evaluate(fit, drawn.vectors), drawn.log_density, proposal)
