"""Draws from around the optima of a fit, and their importance weights under the posterior.

The quick posterior: draws from `proposal.Proposal`, weighted by the true density, the largest
weights smoothed by a Pareto law whose shape is the guard. It is also where the ensemble sampler
starts, so that hardly any burn-in is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float, Int
from scipy.special import logsumexp

from ..batches import in_batches
from ..fitting.fit_result import Fit
from ..problem import log_posterior_batch
from .diagnostics import pareto_smoothed
from .proposal import Drawn, Proposal

NUM_ADAPTATIONS = 5
"""Most rounds in which the proposal is moved to the importance samples of the round before."""

ENOUGH = 0.15
"""Effective sample size over draws at which no further round is worth its time [1]."""

MORE = 4
"""Factor on the number of draws where the rounds do not satisfy the guard."""

PARETO_LIMIT = 0.7
"""Largest Pareto k at which importance sampling can be trusted (Vehtari et al., 2024)."""

LEAST_EFFECTIVE = 400
"""Smallest effective sample size at which importance sampling can be trusted."""

BATCH = 32
"""Draws evaluated at once, half an ensemble: more of them fall out of the cache."""


@dataclass(frozen=True)
class Weighted:
    """Draws with weights.

    Attributes:
        vectors: Scores of parameters and noise, shape (draw, all).
        log_density: Unnormalised log posterior, shape (draw,).
        weights: Normalised importance weights, their tail Pareto-smoothed, shape (draw,).
        pareto_k: Shape of the Pareto fit to the largest weights [1].
        log_evidence: Estimate of the log marginal likelihood, of the weights as they came: they
            are without bias [nat].
        proposal: Where they were drawn from.
    """

    vectors: Float[np.ndarray, "draw all"]
    log_density: Float[np.ndarray, " draw"]
    weights: Float[np.ndarray, " draw"]
    pareto_k: float
    log_evidence: float
    proposal: Proposal

    @property
    def effective_size(self) -> float:
        """Kish's effective sample size."""
        return float(1.0 / np.sum(self.weights**2))

    @property
    def is_sound(self) -> bool:
        """Whether the weights can be trusted."""
        return self.pareto_k < PARETO_LIMIT and self.effective_size > LEAST_EFFECTIVE

    def pick(self, num: int, rng: np.random.Generator) -> Int[np.ndarray, " num"]:
        """Return the positions of rows drawn with their weights."""
        return rng.choice(self.weights.size, size=num, p=self.weights)

    def resample(self, num: int, rng: np.random.Generator) -> Float[np.ndarray, "num all"]:
        """Return rows drawn with their weights."""
        return self.vectors[self.pick(num, rng)]


def importance_sample(fit: Fit, *, num_draws: int = 4096, seed: int = 0) -> Weighted:
    """Draw from around the optima and weigh by the posterior.

    Args:
        fit: Optima and covariance.
        num_draws: Number of draws.
        seed: Of the draws.

    Reference: A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, Pareto Smoothed Importance
        Sampling, Journal of Machine Learning Research 25 (2024) 72.
    """
    rng = np.random.default_rng(seed)
    proposal = Proposal.around(fit, rng)
    drawn = proposal.draw(num_draws, rng)
    best = _weigh(fit, proposal, drawn)
    proposal = beyond = proposal.adapted(drawn, truncated(best.weights), rng)
    for _ in range(NUM_ADAPTATIONS):
        if best.is_sound and best.effective_size > ENOUGH * num_draws:
            break
        drawn = proposal.draw(num_draws, rng)
        weighted = _weigh(fit, proposal, drawn)
        proposal = proposal.adapted(drawn, truncated(weighted.weights), rng)
        if weighted.effective_size > best.effective_size:
            best, beyond = weighted, proposal
    if best.is_sound:
        return best
    # still several times cheaper than the ensembles that would follow
    return _weigh(fit, beyond, beyond.draw(MORE * num_draws, rng))


def truncated(weights: Float[np.ndarray, " draw"]) -> Float[np.ndarray, " draw"]:
    """Return weights of which none exceeds the mean times the root of their number, normalised.

    Reference: E. L. Ionides, Truncated Importance Sampling, Journal of Computational and Graphical
        Statistics 17 (2008) 295-311.
    """
    cut = np.minimum(weights, weights.size**-0.5)
    return cut / np.sum(cut)


def _weigh(fit: Fit, proposal: Proposal, drawn: Drawn) -> Weighted:
    log_density = evaluate(fit, drawn.vectors)
    log_weight = log_density - drawn.log_density
    log_weight = np.where(np.isfinite(log_weight), log_weight, -np.inf)
    total = float(np.asarray(logsumexp(log_weight)))
    smoothed = pareto_smoothed(log_weight)
    return Weighted(
        vectors=drawn.vectors,
        log_density=log_density,
        weights=np.exp(smoothed.log_weight),
        pareto_k=smoothed.pareto_k,
        log_evidence=total - float(np.log(log_weight.size)),
        proposal=proposal,
    )


def evaluate(fit: Fit, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
    """Return the log posterior of many vectors."""
    structure, data = fit.problem.structure, fit.problem.data
    return in_batches(partial(log_posterior_batch, structure, data), vectors, BATCH)
