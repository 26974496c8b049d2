"""Draws with importance weights, and when they can be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from jaxtyping import Float, Int
from scipy.special import logsumexp

from ..batches import in_batches
from ..fitting.fit_result import Fit
from ..problem import log_posterior_batch
from .diagnostics import pareto_smoothed

PARETO_LIMIT = 0.7
"""Largest Pareto k at which importance sampling can be trusted (Vehtari et al., 2024)."""

LEAST_EFFECTIVE = 400
"""Smallest effective sample size at which importance sampling can be trusted."""

BATCH = 32
"""Draws evaluated at once, half an ensemble: more of them fall out of the cache."""


class AbstractDrawn(Protocol):
    """Draws with the log density of what they were drawn from [nat]."""

    @property
    def vectors(self) -> Float[np.ndarray, "draw all"]:
        """Scores of parameters and noise."""
        ...

    @property
    def log_density(self) -> Float[np.ndarray, " draw"]:
        """Of the proposal [nat]."""
        ...


class AbstractProposal(Protocol):
    """A density that can be drawn from."""

    def draw(self, num: int, rng: np.random.Generator) -> AbstractDrawn:
        """Return draws."""
        ...

    def log_density(self, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
        """Return the log density of vectors from elsewhere [nat]."""
        ...


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
    proposal: AbstractProposal

    @classmethod
    def of(
        cls,
        vectors: Float[np.ndarray, "draw all"],
        log_density: Float[np.ndarray, " draw"],
        proposed: Float[np.ndarray, " draw"],
        proposal: AbstractProposal,
    ) -> Weighted:
        """Return draws with their weights.

        Args:
            vectors: The draws.
            log_density: Their log posterior; -inf where it is nothing [nat].
            proposed: Their log density under the proposal [nat].
            proposal: Where they were drawn from.
        """
        log_weight = log_density - proposed
        log_weight = np.where(np.isfinite(log_weight), log_weight, -np.inf)
        smoothed = pareto_smoothed(log_weight)
        return cls(
            vectors=vectors,
            log_density=log_density,
            weights=np.exp(smoothed.log_weight),
            pareto_k=smoothed.pareto_k,
            log_evidence=float(np.asarray(logsumexp(log_weight))) - float(np.log(log_weight.size)),
            proposal=proposal,
        )

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


def truncated(weights: Float[np.ndarray, " draw"]) -> Float[np.ndarray, " draw"]:
    """Return weights of which none exceeds the mean times the root of their number, normalised.

    Reference: E. L. Ionides, Truncated Importance Sampling, Journal of Computational and Graphical
        Statistics 17 (2008) 295-311.
    """
    cut = np.minimum(weights, weights.size**-0.5)
    return cut / np.sum(cut)


def evaluate(fit: Fit, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
    """Return the log posterior of many vectors."""
    structure, data = fit.problem.structure, fit.problem.data
    return in_batches(partial(log_posterior_batch, structure, data), vectors, BATCH)
