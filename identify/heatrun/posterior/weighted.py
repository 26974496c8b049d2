"""Draws with importance weights, when they can be trusted, and draws of equal weight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from jaxtyping import Float, Int
from scipy.special import logsumexp

from ..fit.fit_result import Fit
from ..model.draws import side_by_side
from ..model.kernels import in_batches
from ..model.problem import log_posterior_batch


@dataclass(frozen=True)
class Smoothed:
    """Importance weights whose largest are replaced by the quantiles of a law fitted to them."""

    # Their logarithms, normalised; -inf for a weight of zero, shape (draw,).
    log_weight: Float[np.ndarray, " draw"]
    # Shape of the generalised Pareto law of the largest weights [1]; infinite where there is no
    # tail to fit, as with equal weights, which stay as they are.
    pareto_k: float


def pareto_smoothed(log_weight: Float[np.ndarray, " draw"]) -> Smoothed:
    """Return weights with a Pareto-smoothed tail: hardly biased, and of far smaller variance.

    Args:
        log_weight: Logarithms of importance weights, up to a constant; -inf for a weight of zero.
            Where all are zero they come back as they are.

    Reference: A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, Pareto Smoothed Importance
        Sampling, Journal of Machine Learning Research 25 (2024) 72.
    """
    if not np.any(np.isfinite(log_weight)):
        return Smoothed(log_weight, float("inf"))
    raw = log_weight - logsumexp(log_weight)
    if np.unique(log_weight[np.isfinite(log_weight)]).size < 2:
        return Smoothed(raw, float("inf"))
    weight = np.exp(log_weight - np.max(log_weight))
    order = np.argsort(weight)
    num_tail = _num_tail(weight.size)
    cut = max(weight[order[-num_tail - 1]], np.finfo(float).tiny)
    tail = order[weight[order] > cut]
    shape, scale = _pareto(weight[tail] - cut) if tail.size > FEWEST_IN_TAIL else (math.nan, 0.0)
    if not (math.isfinite(shape) and scale > 0.0):
        return Smoothed(raw, float("inf"))
    rest = np.log1p(-(np.arange(tail.size) + 0.5) / tail.size)
    with np.errstate(over="ignore"):  # cut at the largest weight all the same
        above = -rest if abs(shape) < np.finfo(float).eps else np.expm1(-shape * rest) / shape
    smoothed = log_weight - np.max(log_weight)
    smoothed[tail] = np.minimum(np.log(cut + scale * above), 0.0)
    return Smoothed(smoothed - logsumexp(smoothed), float(shape))


def _num_tail(num_draws: int) -> int:
    return math.ceil(min(0.2 * num_draws, 3.0 * math.sqrt(num_draws)))


FEWEST_IN_TAIL = 4
"""Weights from which no law of the largest can be told [1]."""


def _pareto(excess: Float[np.ndarray, " tail"]) -> tuple[float, float]:
    """Return shape and scale of the generalised Pareto law of sorted excesses.

    By empirical Bayes, with the shape drawn a little to one half.

    Reference: J. Zhang, M. A. Stephens, A new and efficient estimation method for the generalized
        Pareto distribution, Technometrics 51 (2009) 316; Vehtari et al., appendix C.
    """
    size = excess.size
    num = 30 + int(math.sqrt(size))
    with np.errstate(all="ignore"):  # of equal excesses: no number
        tried = 1.0 - np.sqrt(num / (np.arange(num) + 0.5))
        tried = tried / (3.0 * excess[int(0.25 * size + 0.5) - 1]) + 1.0 / excess[-1]
        shapes = np.mean(np.log1p(-tried[:, None] * excess), axis=1)
        density = size * (np.log(-tried / shapes) - shapes - 1.0)
        share = np.exp(density - logsumexp(density))
        share = np.where(share < 10.0 * np.finfo(float).eps, 0.0, share)
        best = float(np.sum(tried * share) / np.sum(share))
        shape = float(np.mean(np.log1p(-best * excess)))
        return (size * shape + 5.0) / (size + 10.0), -shape / best


PARETO_LIMIT = 0.7
"""Largest Pareto k at which importance sampling can be trusted (Vehtari et al., 2024)."""

LEAST_EFFECTIVE = 400
"""Smallest effective sample size at which importance sampling can be trusted."""

BATCH, OF_LONG = 32, 8
"""Draws evaluated at once, half an ensemble: more of them fall out of the cache; and those of a
long test."""


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

    @property
    def latest(self) -> AbstractProposal:
        """It with the last of its densities of the noise."""
        ...


@dataclass(frozen=True)
class Weighted:
    """Draws with weights."""

    vectors: Float[np.ndarray, "draw all"]  # Scores of parameters and noise, shape (draw, all).
    log_density: Float[np.ndarray, " draw"]  # Unnormalised log posterior, shape (draw,).
    # Normalised importance weights, their tail Pareto-smoothed, shape (draw,).
    weights: Float[np.ndarray, " draw"]
    pareto_k: float  # Shape of the Pareto fit to the largest weights [1].
    # Estimate of the log marginal likelihood, of the weights as they came: they are without bias
    # [nat].
    log_evidence: float
    proposal: AbstractProposal  # Where they were drawn from.

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
        squares = float(np.sum(self.weights**2))
        return 1.0 / squares if squares > 0.0 else 0.0

    @property
    def is_sound(self) -> bool:
        """Whether the weights can be trusted."""
        return self.pareto_k < PARETO_LIMIT and self.effective_size > LEAST_EFFECTIVE

    @property
    def is_beyond_hope(self) -> bool:
        """Whether more draws would not make them sound: their law has too heavy a tail, by two of
        the standard errors with which a fit tells its shape.
        """
        error = (1.0 + self.pareto_k) / math.sqrt(_num_tail(self.weights.size))
        is_heavy = self.pareto_k - 2.0 * error > PARETO_LIMIT
        return self.effective_size > LEAST_EFFECTIVE and is_heavy

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
    size = side_by_side(data.tests, BATCH, OF_LONG)
    return in_batches(partial(log_posterior_batch, structure, data), vectors, size)


ROUNDS = 5
"""Steps of each draw."""

GAMMA = 1.2
"""Length of a step times the root of twice the number of dimensions [1]: half of what mixes
fastest, for more of the steps are then accepted, and a draw that has not moved stands with its
copies."""

JITTER = 1e-5
"""Standard deviation that is added to each step [scores], so that every point can be reached."""

Spread = tuple[Float[np.ndarray, "draw all"], Float[np.ndarray, " draw"]]


def spread(fit: Fit, weighted: Weighted, num: int, rng: np.random.Generator) -> Spread:
    """Return draws picked by their weights and moved apart, with their log posterior [nat].

    Draws that are picked by their weights repeat: the few that the proposal makes too rarely stand
    dozens of times, and the end of an interval may rest on one of them. Some steps of differential
    evolution, which leave the posterior as it is, move the copies apart.

    Reference: W. R. Gilks, C. Berzuini, Following a moving target: Monte Carlo inference for
        dynamic Bayesian models, Journal of the Royal Statistical Society B 63 (2001) 127-146
        (resample and move); C. J. F. ter Braak, A Markov chain Monte Carlo version of the genetic
        algorithm differential evolution, Statistics and Computing 16 (2006) 239-249.
    """
    picked = systematic(weighted.weights, num, rng)
    rng.shuffle(picked)  # copies stand in a row, and would all be in one half
    vectors, density = weighted.vectors[picked], weighted.log_density[picked]
    halves = np.array_split(np.arange(num), 2)
    for _ in range(ROUNDS):
        for mine, others in (halves, halves[::-1]):
            moved = vectors[mine] + _steps(vectors[others], mine.size, rng)
            there = evaluate(fit, moved)
            is_taken = np.log(rng.uniform(size=mine.size)) < there - density[mine]
            vectors[mine[is_taken]], density[mine[is_taken]] = moved[is_taken], there[is_taken]
    return vectors, density


def _steps(
    others: Float[np.ndarray, "other all"], num: int, rng: np.random.Generator
) -> Float[np.ndarray, "num all"]:
    """Return differences of two draws of the other half, scaled."""
    first = rng.integers(others.shape[0], size=num)
    second = (first + rng.integers(1, others.shape[0], size=num)) % others.shape[0]
    size = others.shape[1]
    jitter = JITTER * rng.standard_normal((num, size))
    return GAMMA / np.sqrt(2.0 * size) * (others[first] - others[second]) + jitter


def systematic(
    weights: Float[np.ndarray, " draw"], num: int, rng: np.random.Generator
) -> np.ndarray:
    """Return positions by weights that add up to 1: each as often as its weight says, rounded."""
    levels = (np.arange(num) + rng.uniform()) / num
    return np.minimum(np.searchsorted(np.cumsum(weights), levels), weights.size - 1)
