"""The posterior of a fit by MCMC (emcee) or, where its diagnostics allow, importance sampling."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from ..fit.fit_result import Fit
from ..model.draws import Draws, PlausibleEffects, of_network
from ..model.kernels import beside
from .convergence import FULL, QUICK, Convergence, is_one_law, judge
from .importance import importance_sample, starting_sample
from .proposal import Proposal
from .weighted import LEAST_EFFECTIVE, PARETO_LIMIT, Weighted, spread

NUM_ENSEMBLES = 2
"""Ensembles that run apart, so that they can be held against each other."""

CHUNK = 50
"""Steps between two checkpoints, and between two looks at the convergence at first."""

FEWEST = 4
"""Chunks of an ensemble at least."""

LOOK_AGAIN = 0.1
"""Growth of the ensembles between two looks [1]: a look takes the longer the more steps it sees."""

BURN_IN = 0.2
"""Share of the steps that is dropped: the walkers start from importance samples."""

MOST_STEPS = 24_000
"""Steps of an ensemble after which it is given up, with a verdict that says so. After half of them
it is, where the autocorrelation time says that the other half would not do."""

MOST_QUICK = 12_000
"""The same with `--quick`: who asks for it does not wait for the rest."""

FORGOTTEN_ONCE, FORGOTTEN = 1.3, 3.0
"""Autocorrelation times in as many steps below which walkers still stand where they began, and
below which the time is told too short: the steps that are left are not known from it [1]."""

LONG = 3000
"""Steps of an ensemble from which on importance samples are made to stand in for it, where they are
reliable and agree with it: three tests of several loggers take 4000 and more, one test 250 to
2500."""

COMPARED = 10
"""Chunks after which importance samples may stand in: the walkers began at them."""

NUM_KEPT = 2000
"""Draws kept: the ensembles and the importance samples that are enough hold less than these."""

NUM_FOR_COURSE, NUM_STEPS = 64, 3
"""Draws whose courses make the mean course, and steps to the machine that has it."""

Method = Literal["emcee", "importance", "normal"]
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Posterior:
    """Draws from the posterior of a fit."""

    fit: Fit  # What was sampled.
    # Scores of parameters and noise, shape (chain, draw, all); a chain is one of the ensembles,
    # thinned, one walker after the other.
    vectors: Float[np.ndarray, "chain draw all"]
    log_density: Float[np.ndarray, "chain draw"]  # Unnormalised log posterior, shape (chain, draw).
    method: Method  # How they were drawn.
    # The importance samples that came first; None for draws of a normal law.
    weighted: Weighted | None
    convergence: Convergence | None  # Verdict on the ensembles; None for importance sampling.
    # Whether the ensembles stand in for importance samples that could not be trusted.
    was_to_be_quick: bool = False
    # Steps that ensembles would have taken which agree with the importance samples; zero where none
    # were begun.
    spared: int = 0
    # Effects behind the draws, where these are averaged over models with one; None where all draws
    # are of the network alone.
    plausible: PlausibleEffects | None = None
    alone: Posterior | None = None  # The posterior before it was averaged; None where it was not.
    # Log Bayes factor of another network over this one, for which it was not sampled [nat]; None
    # where it was to be.
    behind: float | None = None

    @property
    def flat(self) -> Float[np.ndarray, "draw all"]:
        """All draws in a row."""
        return self.vectors.reshape(-1, self.vectors.shape[-1])

    @property
    def is_sound(self) -> bool:
        """Whether the draws can be trusted."""
        if self.convergence is not None:
            return self.convergence.is_enough
        return self.weighted is not None and self.weighted.is_sound

    def sentence(self) -> str:
        """Return the verdict in words."""
        if self.weighted is None:
            drawn = "Drawn from the normal law around the fit: the intervals are indicative."
            if self.behind is None:
                return drawn
            factor = f"log Bayes factor {-self.behind:.0f} against the other"
            refused = f"The tests refuse this network ({factor})."
            return f"{refused} {drawn} Calibrate it alone to have it sampled."
        figures = (
            f"tail of the weights, Pareto k {self.weighted.pareto_k:.2f}, limit "
            f"{PARETO_LIMIT:g}; effective sample size "
            f"{self.weighted.effective_size:.0f}, at least {LEAST_EFFECTIVE:g}"
        )
        if self.convergence is not None:
            why = (
                " With `--quick`, MCMC took the place of importance sampling, which is faster and "
                f"not reliable for these tests ({figures})."
            )
            return self.convergence.sentence() + (why if self.was_to_be_quick else "")
        if self.weighted.is_sound:
            why = f" MCMC agrees and would take {self.spared} steps." if self.spared else ""
            return f"Importance sampling is reliable ({figures}).{why}"
        return f"Importance sampling is not reliable ({figures}): the intervals are indicative."

    @property
    def draws(self) -> Draws:
        """The draws with what gives them a meaning: enough to predict any test."""
        problem = self.fit.problem
        return Draws(
            problem.model,
            problem.motor,
            problem.parameters,
            self.flat,
            self.plausible,
            problem.loggers,
        )

    def thin(self, num: int, seed: int = 0) -> Float[np.ndarray, "draw all"]:
        """Return `num` of the draws, picked evenly at random without repetition."""
        flat = self.flat
        picked = np.random.default_rng(seed).permutation(flat.shape[0])[:num]
        return flat[picked]

    @cached_property
    def stated(self) -> dict[str, float]:
        """Values by slot name in physical units of the machine that is stated [their units].

        Of the machines whose course is the mean of those of the draws, it is the nearest to the
        mean of their scores, by their own spread. That mean itself is no machine where parameters
        that hang together bend: it runs several times as far from the tests as any draw.
        """
        problem = self.fit.problem
        z = of_network(self.plausible, self.flat)[:, : problem.num_parameters]
        some = np.random.default_rng(0).permutation(len(z))[:NUM_FOR_COURSE]
        middle = np.mean([problem.linearised(each)[0] for each in z[some]], axis=0)
        nearness = np.linalg.inv(np.atleast_2d(np.cov(z.T)) + 1e-9 * np.eye(z.shape[1]))
        at = mean = z.mean(axis=0)
        residual, jacobian = problem.linearised(at)
        weight = 1.0 / float(self.fit.noise.total()) ** 2
        for _ in range(NUM_STEPS):
            slope = weight * jacobian.T @ (residual - middle) + nearness @ (at - mean)
            tried = at - np.linalg.solve(weight * jacobian.T @ jacobian + nearness, slope)
            tried = np.minimum(tried, problem.data.priors.largest)
            there, turned = problem.linearised(tried)
            if not problem.rmse_K(there - middle) < problem.rmse_K(residual - middle):
                break
            at, residual, jacobian = tried, there, turned
        return {name: float(v) for name, v in problem.parameters.physical(at).items()}

    def values(self) -> dict[str, np.ndarray]:
        """Return the draws by slot name in physical units, each of shape (chain, draw)."""
        parameters = self.fit.problem.parameters
        return parameters.physical(self.vectors[..., : self.fit.problem.num_parameters])


def sample(
    fit: Fit,
    *,
    method: Literal["emcee", "quick"] = "emcee",
    seed: int = 0,
    folder: Path | None = None,
    progress: Progress | None = None,
    most_steps: int = MOST_STEPS,
) -> Posterior:
    """Sample the posterior around a fit.

    Args:
        fit: The fit.
        method: `"emcee"`: MCMC, or importance sampling if it is sound and agrees with an MCMC that
            would take over `LONG` steps or began at it; `"quick"`: importance sampling if it is
            sound, else MCMC of half the effective sample size.
        seed: Random seed.
        folder: Where checkpoints are written and taken up again; None for none.
        progress: Called with a sentence and the share done; with a share of 0 where MCMC takes the
            place of importance sampling that was to be enough.
        most_steps: Steps of an ensemble after which it is given up; after half of them where all
            would not do.
    """
    is_quick = method == "quick"
    weighted = (importance_sample if is_quick else starting_sample)(fit, seed=seed)
    if is_quick and weighted.is_sound:
        return _of_weighted(fit, weighted, seed)
    wanted = QUICK if is_quick else FULL
    instead = "importance sampling is not reliable here, MCMC instead: " if is_quick else ""

    from .ensemble import Ensemble

    size = fit.vector.size
    num_walkers = max(64, 2 * (2 * size // 2 + 1))
    ensembles = [
        Ensemble.begin(fit, weighted, num_walkers, index, seed, folder)
        for index in range(NUM_ENSEMBLES)
    ]
    if is_quick:
        most_steps = min(most_steps, MOST_QUICK)
        if progress is not None:
            progress(f"{instead}the first steps", 0.0)
    is_linear = isinstance(weighted.proposal, Proposal)
    followed = None if is_linear and not is_quick else weighted
    num_steps, planned = 0, LONG

    def tell(done: int) -> None:
        if progress is not None:
            progress(f"{instead}{done} of about {planned} steps", done / planned)

    while True:
        chunks = max(1, int(LOOK_AGAIN * num_steps / CHUNK))
        beside(
            lambda ensemble, num=chunks: ensemble.advance(
                CHUNK, num, tell if ensemble is ensembles[0] else None
            ),
            ensembles,
        )
        num_steps = ensembles[0].num_steps
        drop = int(BURN_IN * num_steps)
        chains = np.stack([ensemble.chain()[drop:] for ensemble in ensembles])
        convergence = judge(chains, wanted)
        if (convergence.is_enough and num_steps >= FEWEST * CHUNK) or num_steps >= most_steps:
            break
        # until it is enough there is one look more at least, whatever lacks
        times = max(convergence.times_as_long, 1.0 + LOOK_AGAIN)
        steps = max(times * num_steps, FEWEST * CHUNK)
        steps = CHUNK * math.ceil(steps / CHUNK) if steps < most_steps else most_steps
        if COMPARED * CHUNK <= num_steps <= LONG and (followed is not None or steps > LONG):
            followed = followed or importance_sample(fit, seed=seed, linear=weighted)
            if followed.is_sound and is_one_law(chains, followed.vectors, followed.weights):
                return replace(_of_weighted(fit, followed, seed), spared=steps)
        planned = _planned(convergence, num_steps, steps, most_steps)
        tell(num_steps)
        least_steps = wanted.times * convergence.autocorrelation / (1.0 - BURN_IN)
        if num_steps >= most_steps // 2 and least_steps > most_steps:
            break
    density = np.stack([ensemble.density()[drop:] for ensemble in ensembles])
    return Posterior(fit, keep(chains), keep(density), "emcee", weighted, convergence, is_quick)


def _planned(convergence: Convergence, num_steps: int, steps: int, most_steps: int) -> int:
    """Return the steps that are told to be needed [1]: so many `steps` by the autocorrelation time,
    or what is usual or the most as long as that cannot be told.
    """
    forgotten = convergence.num_steps / convergence.autocorrelation
    if forgotten < FORGOTTEN_ONCE and num_steps < most_steps // 2:
        return most_steps // 2
    return min(max(steps, LONG), most_steps) if forgotten < FORGOTTEN else steps


def keep(draws: Float[np.ndarray, "ensemble step walker ..."]) -> np.ndarray:
    """Return about `NUM_KEPT` draws, shape (ensemble, draw, ...): whole steps, walker by walker.

    Every n-th of all draws in a row would be the same few walkers wherever n and their number
    share a divisor. One walker after the other, so that whoever looks for the autocorrelation of
    the rows finds it.
    """
    every = max(1, draws.shape[0] * draws.shape[1] * draws.shape[2] // NUM_KEPT)
    by_walker = np.swapaxes(draws[:, ::every], 1, 2)
    return by_walker.reshape(draws.shape[0], -1, *draws.shape[3:])


def normal_draws(fit: Fit, *, seed: int = 0, behind: float | None = None) -> Posterior:
    """Return draws of the normal law around a fit, for where nothing better is to be had or needed.

    They are not held against the posterior: `Posterior.is_sound` is false.
    """
    rng = np.random.default_rng([seed, 2])
    values, axes = np.linalg.eigh(0.5 * (fit.covariance + fit.covariance.T))
    spread = axes * np.sqrt(np.maximum(values, 0.0))
    vectors = fit.vector + rng.standard_normal((NUM_KEPT, fit.vector.size)) @ spread.T
    largest = fit.problem.data.priors.largest
    vectors[:, : largest.size] = np.minimum(vectors[:, : largest.size], largest)
    density = np.full((1, NUM_KEPT), np.nan)
    return Posterior(fit, vectors[None], density, "normal", None, None, behind=behind)


def weighted_draws(fit: Fit, *, seed: int = 0) -> Posterior:
    """Return importance samples of a fit, reliable or not; `Posterior.is_sound` tells."""
    return _of_weighted(fit, importance_sample(fit, seed=seed), seed)


def _of_weighted(fit: Fit, weighted: Weighted, seed: int) -> Posterior:
    vectors, density = spread(fit, weighted, NUM_KEPT, np.random.default_rng([seed, 1]))
    return Posterior(fit, vectors[None], density[None], "importance", weighted, None)
