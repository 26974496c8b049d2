"""Draws from around the optima of a fit, and their importance weights under the posterior.

The quick posterior: a mixture of Student t distributions around all optima, weighted by the true
density, with a Pareto fit to the largest weights as the guard. It is also where the ensemble
sampler starts, so that hardly any burn-in is needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.special import gammaln, logsumexp
from scipy.stats import genpareto

from . import noise as noise_module
from .fit_result import Fit
from .problem import NUM_NOISE, linearise, log_posterior_batch

DEGREES_OF_FREEDOM = 8.0
"""Tails of the proposal: heavier than those of the posterior, so that weights stay bounded."""

NUM_ADAPTATIONS = 3
"""Rounds in which the proposal gains a component, moved to the weighted draws so far."""

PARETO_LIMIT = 0.7
"""Largest Pareto shape at which weighted draws can be trusted (Vehtari et al., 2024)."""

BATCH = 64
"""Draws evaluated at once: more of them fall out of the cache."""


@dataclass(frozen=True)
class Weighted:
    """Draws with weights.

    Attributes:
        vectors: Scores of parameters and noise, shape (draw, all).
        log_density: Unnormalised log posterior, shape (draw,).
        weights: Normalised importance weights, shape (draw,).
        pareto_k: Shape of the Pareto fit to the largest weights [1].
        log_evidence: Estimate of the log marginal likelihood [nat].
    """

    vectors: Float[np.ndarray, "draw all"]
    log_density: Float[np.ndarray, " draw"]
    weights: Float[np.ndarray, " draw"]
    pareto_k: float
    log_evidence: float

    @property
    def effective_size(self) -> float:
        """Kish's effective number of draws."""
        return float(1.0 / np.sum(self.weights**2))

    @property
    def is_sound(self) -> bool:
        """Whether the weights can be trusted."""
        return self.pareto_k < PARETO_LIMIT and self.effective_size > 400

    def resample(self, num: int, rng: np.random.Generator) -> np.ndarray:
        """Return rows drawn with their weights, shape (num, all)."""
        return self.vectors[rng.choice(self.weights.size, size=num, p=self.weights)]


def importance_sample(fit: Fit, *, num_draws: int = 4096, seed: int = 0) -> Weighted:
    """Draw from around the optima and weigh by the posterior.

    Args:
        fit: Optima and covariance.
        num_draws: Number of draws of each round.
        seed: Of the draws.

    Reference: A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, Pareto Smoothed Importance
        Sampling, Journal of Machine Learning Research 25 (2024) 72; J.-M. Cornuet, J.-M. Marin,
        A. Mira, C. P. Robert, Adaptive Multiple Importance Sampling, Scandinavian Journal of
        Statistics 39 (2012) 798-812 (the weights over all rounds); E. L. Ionides, Truncated
        Importance Sampling, Journal of Computational and Graphical Statistics 17 (2008) 295-311
        (the cut at the root of the number of draws).
    """
    rng = np.random.default_rng(seed)
    centres, factors = _mixture(fit)
    vectors = _draw(centres, factors, num_draws, rng)
    log_density = evaluate(fit, vectors)
    weighted = _weigh(vectors, log_density, centres, factors)
    for _ in range(NUM_ADAPTATIONS if len(centres) == 1 else 0):
        # one more component at the weighted mean and shape, which follow the skew of the noise;
        # weights are cut there, so that one heavy draw does not decide, and a tenth of the first
        # shape keeps it from collapsing
        weights = np.minimum(weighted.weights, weighted.weights.size**-0.5)
        weights = weights / np.sum(weights)
        mean = weights @ weighted.vectors
        shift = weighted.vectors - mean
        shape = (shift * weights[:, None]).T @ shift
        shape = 0.9 * shape + 0.1 * fit.covariance
        centres = np.concatenate([centres, mean[None]])
        factors = np.concatenate([factors, np.linalg.cholesky(shape)[None]])
        more = _draw(centres[-1:], factors[-1:], num_draws, rng)
        vectors = np.concatenate([vectors, more])
        log_density = np.concatenate([log_density, evaluate(fit, more)])
        weighted = _weigh(vectors, log_density, centres, factors)
    return weighted


def _draw(
    centres: np.ndarray, factors: np.ndarray, num: int, rng: np.random.Generator
) -> np.ndarray:
    """Draw from a mixture of Student t distributions."""
    which = rng.integers(len(centres), size=num)
    normal = rng.standard_normal((num, centres.shape[1]))
    scale = np.sqrt(DEGREES_OF_FREEDOM / rng.chisquare(DEGREES_OF_FREEDOM, num))
    return centres[which] + np.einsum("nij,nj->ni", factors[which], normal) * scale[:, None]


def _weigh(
    vectors: np.ndarray, log_density: np.ndarray, centres: np.ndarray, factors: np.ndarray
) -> Weighted:
    """Weigh the draws of all rounds by the posterior over the mixture of all their components.

    No round is thrown away: choosing the one with the most effective draws would be choosing the
    one that missed a tail.
    """
    log_weight = log_density - _log_mixture(vectors, centres, factors)
    log_weight = np.where(np.isfinite(log_weight), log_weight, -np.inf)
    total = float(np.asarray(logsumexp(log_weight)))
    return Weighted(
        vectors=vectors,
        log_density=log_density,
        weights=np.exp(log_weight - total),
        pareto_k=pareto_shape(log_weight),
        log_evidence=total - float(np.log(log_weight.size)),
    )


def evaluate(fit: Fit, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
    """Return the log posterior of many vectors, in batches of one size (one compilation)."""
    structure, data = fit.problem.structure, fit.problem.data
    num = vectors.shape[0]
    padded = np.concatenate([vectors, np.repeat(vectors[-1:], -num % BATCH, axis=0)])
    parts = [
        np.asarray(log_posterior_batch(structure, data, jnp.asarray(part)))
        for part in np.split(padded, padded.shape[0] // BATCH)
    ]
    return np.concatenate(parts)[:num]


def pareto_shape(log_weight: Float[np.ndarray, " draw"]) -> float:
    """Return the shape of a generalised Pareto fit to the largest weights [1]."""
    num = log_weight.size
    num_tail = int(min(0.2 * num, 3 * np.sqrt(num)))
    ordered = np.sort(log_weight - np.max(log_weight))
    tail, threshold = np.exp(ordered[-num_tail:]), np.exp(ordered[-num_tail - 1])
    if not np.any(tail > threshold):
        return float("inf")
    shape, _, _ = genpareto.fit(tail - threshold, floc=0.0)
    return float(shape)


def _mixture(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return centres and Cholesky factors of the mixture's components."""
    size = fit.problem.num_parameters
    centres, factors = [], []
    for mode in fit.modes:
        covariance = fit.covariance.copy()
        if not np.array_equal(mode, fit.z):
            covariance[:size, :size] = _covariance_at(fit, mode)
        centres.append(np.concatenate([mode, fit.noise_z]))
        factors.append(np.linalg.cholesky(covariance + 1e-12 * np.eye(size + NUM_NOISE)))
    return np.stack(centres), np.stack(factors)


def _covariance_at(fit: Fit, z: np.ndarray) -> np.ndarray:
    problem = fit.problem
    _, jacobian = linearise(problem.structure, problem.data, jnp.asarray(z))
    columns = np.concatenate([
        np.asarray(noise_module.whiten(jnp.asarray(part), fit.noise, test)[0])
        for part, test in zip(problem.split(np.asarray(jacobian)), problem.data.tests, strict=True)
    ])  # fmt: skip
    return np.linalg.inv(columns.T @ columns / problem.temper + np.eye(z.size))


def _log_mixture(vectors: np.ndarray, centres: np.ndarray, factors: np.ndarray) -> np.ndarray:
    nu, size = DEGREES_OF_FREEDOM, vectors.shape[1]
    constant = gammaln((nu + size) / 2) - gammaln(nu / 2) - 0.5 * size * np.log(nu * np.pi)
    parts = []
    for centre, factor in zip(centres, factors, strict=True):
        scaled = np.linalg.solve(factor, (vectors - centre).T)
        log_det = np.sum(np.log(np.diag(factor)))
        square = np.sum(scaled**2, axis=0)
        parts.append(constant - log_det - 0.5 * (nu + size) * np.log1p(square / nu))
    return np.asarray(logsumexp(np.stack(parts), axis=0)) - np.log(len(parts))
