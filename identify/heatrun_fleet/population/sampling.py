"""Draws of a population's law, its tolerance limits, its machines given all, and the next machine.

The law is drawn by importance sampling about its mode, by emcee where that will not do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

import emcee
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import minimize
from scipy.special import ndtr

from heatrun.io.programs import compiled
from heatrun.model.kernels import log_student, student
from heatrun.posterior.ensemble import evolution
from heatrun.posterior.weighted import pareto_smoothed, systematic

from .gathered import Evidence
from .law import OUTLIER_SCALE, Hyperprior, Law, given_machine, log_marginals, num_scores, unpack

NUM_PROPOSED, NUM_KEPT = 4096, 2000
"""Importance draws that are weighed, and draws that are kept."""

ENOUGH = 600.0
"""Effective draws (Kish) at which the proposal is good enough [1]."""

MOST_PARETO_K = 0.6
"""Shape of the tail of the weights up to which importance sampling is reliable [1]."""

NUM_ROUNDS = 8
"""Rounds of the proposal, at most; the first is the normal law about the mode."""

STEP = 1e-4
"""Of the differences that give the curvature [scores, of which the prior's are of order 1]."""

FEWEST_PLACES = 16
"""Places for machines that a compiled program has at least; it has up to a quarter too many."""

LARGE_FLEET = 2000
"""Machines from which on the law is so well known that no ensemble is needed."""

WALKERS_PER_SCORE, MOST_STEPS, CHUNK = 4, 12_000, 1000
"""Size of an ensemble over the number of scores, and its steps, at most and between two looks."""

TIMES = 50.0
"""Autocorrelation times that an ensemble has to run for [1]."""


@dataclass(frozen=True)
class Population:
    """Draws of the law of a population."""

    evidence: Evidence  # Of its machines.
    # Covariates, each less its mean over the machines, shape (machine, covariate).
    design: Float[np.ndarray, "machine covariate"]
    hyper: Hyperprior  # What was assumed.
    laws: Law  # Equally probable draws, along the first axis of each array.
    method: Literal["importance", "emcee"]  # How they were drawn.
    pareto_k: float  # Of the importance weights [1].
    is_converged: bool  # Whether the draws are to be relied on.


def sample_population(
    evidence: Evidence,
    hyper: Hyperprior,
    design: Float[np.ndarray, "machine covariate"] | None = None,
    *,
    seed: int = 0,
) -> Population:
    """Return draws of the law behind the machines, with their covariates, centred, if there are."""
    design = np.zeros((evidence.num_machines, 0)) if design is None else np.asarray(design, float)
    num_covariates = design.shape[1]
    data = Data.of(evidence, design)
    rng = np.random.default_rng([seed, 17])
    mode = _mode(data, hyper, num_scores(len(evidence.names), num_covariates))
    scores, k = _importance(data, hyper, mode, rng)
    method, is_converged = "importance", k <= MOST_PARETO_K
    if not is_converged and evidence.num_machines < LARGE_FLEET:
        scores, is_converged = _ensemble(data, hyper, scores, rng)
        method = "emcee"
    laws = _laws(hyper, num_covariates, scores)
    return Population(evidence, design, hyper, laws, method, k, is_converged)


class Data(NamedTuple):
    """The machines: covariates, information and precision.

    There are as many as the next of few sizes has place for, so that not every fleet compiles
    anew. Those at the end that are none have no test and so weigh nothing.
    """

    design: Array
    information: Array
    precision: Array

    @classmethod
    def of(cls, evidence: Evidence, design: Float[np.ndarray, "machine covariate"]) -> Data:
        """Return the machines with what fills the place behind them."""
        num = evidence.num_machines
        step = max(FEWEST_PLACES, 2 ** (num.bit_length() - 3))
        empty = -num % step
        return cls(*(
            jnp.asarray(np.pad(part, [(0, empty)] + [(0, 0)] * (part.ndim - 1)))
            for part in (design, evidence.information, evidence.precision)
        ))  # fmt: skip


@compiled("num_covariates")
def _laws(hyper: Hyperprior, num_covariates: int, scores: Float[Array, "draw score"]) -> Law:
    return jax.vmap(lambda z: unpack(z, hyper, num_covariates)[0])(scores)


def _log_density(data: Data, hyper: Hyperprior, scores: Float[Array, " score"]) -> Array:
    law, log_prior = unpack(scores, hyper, data.design.shape[1])
    usual, other = log_marginals(law, *data, has_outliers=hyper.has_outliers)
    total = jnp.logaddexp(usual, other) if hyper.has_outliers else usual
    return log_prior + jnp.sum(total)


_value_and_slope = compiled()(jax.value_and_grad(_log_density, argnums=2))


@compiled()
def _many(data: Data, hyper: Hyperprior, rows: Float[Array, "draw score"]) -> Array:
    return jax.lax.map(lambda z: _log_density(data, hyper, z), rows, batch_size=32)


def _mode(data: Data, hyper: Hyperprior, size: int) -> np.ndarray:
    def objective(z: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = _value_and_slope(data, hyper, z)
        return -float(value), -np.asarray(slope)

    found = [
        minimize(objective, start, jac=True, method="L-BFGS-B", options={"maxiter": 2000})
        for start in (np.zeros(size), np.full(size, -0.5))
    ]
    return np.asarray(min(found, key=lambda each: each.fun).x)


def _curvature(data: Data, hyper: Hyperprior, mode: np.ndarray) -> Float[np.ndarray, "score score"]:
    """Return the second derivatives, for the proposal: by differences, which compile nothing."""
    rows = []
    for step in STEP * np.eye(mode.size):
        slopes = [_value_and_slope(data, hyper, mode + by)[1] for by in (step, -step)]
        rows.append(np.subtract(*map(np.asarray, slopes)) / (2.0 * STEP))
    return 0.5 * (np.array(rows) + np.array(rows).T)


def _importance(
    data: Data, hyper: Hyperprior, mode: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    """Return draws picked by weight, and the shape of the weights' tail.

    The proposal begins at the mode's normal law and takes over mean and covariance of its draws,
    weighted, until the weights are even enough.

    Reference: O. Cappe, A. Guillin, J. M. Marin, C. P. Robert, Population Monte Carlo, Journal of
        Computational and Graphical Statistics 13 (2004) 907-929.
    """
    values, directions = np.linalg.eigh(-_curvature(data, hyper, mode))
    centre, covariance = mode, (directions / np.maximum(values, 0.05)) @ directions.T
    scores, smoothed = mode[None], pareto_smoothed(np.zeros(1))
    for _ in range(NUM_ROUNDS):
        factor = np.linalg.cholesky(covariance)
        white = student(NUM_PROPOSED, mode.size, rng)
        scores = centre + white @ factor.T
        proposed = log_student(np.sum(white**2, axis=1), mode.size)
        found = np.asarray(_many(data, hyper, scores) - proposed)
        found = np.where(np.isfinite(found), found, -np.inf)
        smoothed = pareto_smoothed(found)
        num_effective = 1.0 / np.sum(np.exp(2.0 * smoothed.log_weight))
        if smoothed.pareto_k <= MOST_PARETO_K and num_effective >= ENOUGH:
            break
        # of the roots of the weights: fewer draws dominate, and the proposal stays wide
        weight = np.exp(0.5 * (found - found.max()))
        weight /= weight.sum()
        centre = weight @ scores
        apart = scores - centre
        covariance = (weight * apart.T) @ apart + 1e-12 * np.eye(mode.size)
    return scores[systematic(np.exp(smoothed.log_weight), NUM_KEPT, rng)], smoothed.pareto_k


def _ensemble(
    data: Data, hyper: Hyperprior, scores: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, bool]:
    """Return draws of an ensemble of walkers, and whether it ran long enough.

    It starts at the importance draws, which are too few of the far ones at worst.
    """
    size = scores.shape[1]
    num = WALKERS_PER_SCORE * size + WALKERS_PER_SCORE * size % 2
    sampler = emcee.EnsembleSampler(
        num,
        size,
        lambda rows: np.nan_to_num(np.asarray(_many(data, hyper, rows)), nan=-np.inf),
        vectorize=True,
        moves=evolution(),
    )
    start = scores[rng.choice(scores.shape[0], num, replace=False)]
    start = start + 0.05 * scores.std(axis=0) * rng.standard_normal(start.shape)
    state = emcee.State(start, random_state=np.random.RandomState(rng.integers(2**31)).get_state())
    is_converged = False
    while sampler.iteration < MOST_STEPS and not is_converged:
        state = sampler.run_mcmc(state, CHUNK)
        time = float(np.max(sampler.get_autocorr_time(tol=0)))
        is_converged = bool(np.isfinite(time) and sampler.iteration > TIMES * time)
    chain = np.asarray(sampler.get_chain(discard=sampler.iteration // 4, flat=True))
    return chain[rng.choice(chain.shape[0], NUM_KEPT, replace=False)], is_converged


CONTENT = CONFIDENCE = 0.95
"""Share of the machines that tolerance limits hold, and the probability that they do [1]."""


def tolerance_limits(population: Population) -> Float[np.ndarray, "2 parameter"]:
    """Return the shortest limits about the mean of each parameter, in the space in which it is
    normal, that hold the machines of the type; outliers are left aside, covariates at their mean.

    Reference: K. Krishnamoorthy, T. Mathew, Statistical Tolerance Regions, Wiley, 2009, chapter 11
        (Bayesian tolerance intervals).
    """
    mean, sd = np.asarray(population.laws.mean), np.asarray(population.laws.sd)
    middle = mean.mean(axis=0)
    low, high = np.zeros_like(middle), 40.0 * sd.mean(axis=0) + 10.0 * mean.std(axis=0)
    for _ in range(60):
        half = 0.5 * (low + high)
        held = ndtr((middle + half - mean) / sd) - ndtr((middle - half - mean) / sd)
        is_wide = np.mean(held >= CONTENT, axis=0) >= CONFIDENCE
        low, high = np.where(is_wide, low, half), np.where(is_wide, half, high)
    return np.stack([middle - high, middle + high])


NUM_LAWS = 400
"""Draws of the law that the machines are averaged over."""


@dataclass(frozen=True)
class Machines:
    """The machines of a population, given all of them."""

    # Of each machine's parameters; `covariance` likewise.
    mean: Float[np.ndarray, "machine parameter"]
    covariance: Float[np.ndarray, "machine parameter parameter"]
    # Probability that the machine is none of the population [1].
    outlier: Float[np.ndarray, " machine"]
    # How far its parameters are from what is expected of it, in standard deviations over machines,
    # with what is left open added to them [1].
    distance: Float[np.ndarray, "machine parameter"]


def given_population(population: Population) -> Machines:
    """Return what is known of each machine once all are."""
    evidence = population.evidence
    laws = Law(*(each[:: max(1, each.shape[0] // NUM_LAWS)] for each in population.laws))
    data = Data.of(evidence, population.design)
    found = _under_each(data, population.hyper.has_outliers, laws)
    mean, second, outlier, centre = (
        np.asarray(part).mean(axis=0)[: evidence.num_machines] for part in found
    )
    covariance = second - np.einsum("mi,mj->mij", mean, mean)
    spread = np.asarray(jnp.mean(laws.sd**2, axis=0))
    # what each machine's tests say alone, with no more of a prior than ten spreads
    loose = np.diag(1.0 / (100.0 * np.asarray(jnp.mean(population.laws.sd**2, axis=0))))
    alone = evidence.precision + loose
    own = np.einsum("mii->mi", np.linalg.inv(alone))
    pulled = evidence.information + np.einsum("ij,mj->mi", loose, centre)
    best = np.linalg.solve(alone, pulled[..., None])[..., 0]
    distance = (best - centre) / np.sqrt(spread + own)
    return Machines(mean, covariance, outlier, distance)


@compiled("has_outliers")
def _under_each(data: Data, has_outliers: bool, laws: Law) -> tuple[Array, ...]:
    return jax.lax.map(partial(_under, *data, has_outliers=has_outliers), laws)


def _under(design, information, precision, law, *, has_outliers):
    """Return first and second moments, probability of an outlier, and centre, under one law."""
    usual, other = log_marginals(law, design, information, precision, has_outliers=has_outliers)
    outlier = jax.nn.sigmoid(other - usual) if has_outliers else jnp.zeros_like(usual)
    centre = law.mean + design @ law.effects
    mean, second = jnp.zeros_like(centre), jnp.zeros(precision.shape)
    for share, factor in ((1.0 - outlier, law.factor), (outlier, OUTLIER_SCALE * law.factor)):
        at, around = jax.vmap(lambda c, h, L, f=factor: given_machine(c, f, h, L))(
            centre, information, precision
        )
        mean += share[:, None] * at
        second += share[:, None, None] * (around + at[:, :, None] * at[:, None, :])
    return mean, second, outlier, centre


DRAWS_PER_LAW = 20
"""Machines that are drawn from each draw of the law."""


def next_machine(
    population: Population,
) -> tuple[Float[np.ndarray, " parameter"], Float[np.ndarray, "parameter parameter"]]:
    """Return mean and covariance of the parameters of one more machine, all left open.

    In the space in which the parameters are normal; covariates at their mean over the machines. It
    may be an outlier, too, by the share that was found.
    """
    laws = population.laws
    mean = np.asarray(laws.mean)
    factor = np.asarray(laws.factor)
    within = factor @ np.swapaxes(factor, -1, -2)
    if population.hyper.has_outliers:
        share = np.asarray(laws.outlier_share)
        within = within * (1.0 + share * (OUTLIER_SCALE**2 - 1.0))[:, None, None]
    return mean.mean(axis=0), within.mean(axis=0) + np.atleast_2d(np.cov(mean.T))


def next_interval(population: Population, *, seed: int = 0) -> Float[np.ndarray, "2 parameter"]:
    """Return the 95 % interval of each parameter of one more machine; as `next_machine`.

    Of draws of it: a law with few machines that are something else has longer tails than the normal
    law of its mean and covariance, and a narrower middle.
    """
    laws, rng = population.laws, np.random.default_rng([seed, 18])
    mean, factor = np.asarray(laws.mean), np.asarray(laws.factor)
    num = mean.shape[0] * DRAWS_PER_LAW
    mean, factor = (np.repeat(each, DRAWS_PER_LAW, axis=0) for each in (mean, factor))
    share = np.repeat(np.asarray(laws.outlier_share), DRAWS_PER_LAW)
    is_other = population.hyper.has_outliers & (rng.uniform(size=num) < share)
    width = np.where(is_other, OUTLIER_SCALE, 1.0)[:, None]
    drawn = np.einsum("nij,nj->ni", factor, rng.standard_normal(mean.shape))
    return np.quantile(mean + width * drawn, [0.025, 0.975], axis=0)
