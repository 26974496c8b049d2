"""The posterior of a fit: emcee until it is long enough, or weighted draws where those will do."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import emcee
import numpy as np
from jaxtyping import Float

from .checkpoint import Checkpoint, state_of
from .ensemble import Convergence, judge
from .fit_result import Fit
from .proposal import Weighted, evaluate, importance_sample

NUM_ENSEMBLES = 2
"""Ensembles that run apart, so that they can be held against each other."""

CHUNK = 250
"""Steps between two looks at the convergence, and between two checkpoints."""

BURN_IN = 0.2
"""Share of the steps that is dropped: the walkers start from weighted draws."""

MOST_STEPS = 12_000
"""Steps of an ensemble after which it is given up, with a verdict that says so."""

NUM_KEPT = 4000
"""Draws kept of the posterior."""

Method = Literal["emcee", "importance"]
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Posterior:
    """Draws from the posterior of a fit.

    Attributes:
        fit: What was sampled.
        vectors: Scores of parameters and noise, shape (chain, draw, all); a chain is one of the
            ensembles, thinned, one walker after the other.
        log_density: Unnormalised log posterior, shape (chain, draw).
        method: How they were drawn.
        weighted: The weighted draws that came first.
        convergence: Verdict on the ensembles; None for weighted draws.
    """

    fit: Fit
    vectors: Float[np.ndarray, "chain draw all"]
    log_density: Float[np.ndarray, "chain draw"]
    method: Method
    weighted: Weighted
    convergence: Convergence | None

    @property
    def flat(self) -> Float[np.ndarray, "draw all"]:
        """All draws in a row."""
        return self.vectors.reshape(-1, self.vectors.shape[-1])

    @property
    def is_sound(self) -> bool:
        """Whether the draws can be trusted."""
        return self.weighted.is_sound if self.convergence is None else self.convergence.is_enough

    def sentence(self) -> str:
        """Return the verdict in words."""
        if self.convergence is not None:
            return self.convergence.sentence()
        return (
            f"Weighted draws around the fit: Pareto k {self.weighted.pareto_k:.2f} (limit 0.7), "
            f"{self.weighted.effective_size:.0f} effective draws."
        )

    def thin(self, num: int, seed: int = 0) -> Float[np.ndarray, "draw all"]:
        """Return `num` of the draws, picked evenly at random without repetition."""
        flat = self.flat
        picked = np.random.default_rng(seed).permutation(flat.shape[0])[:num]
        return flat[picked]

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
        method: `"emcee"`; or `"quick"`: weighted draws if their Pareto guard holds, else emcee.
        seed: Of everything that is drawn.
        folder: Where checkpoints are written and taken up again; None for none.
        progress: Called with a sentence and the share done.
        most_steps: Steps of an ensemble after which it is given up.
    """
    weighted = importance_sample(fit, seed=seed)
    if method == "quick" and weighted.is_sound:
        return _of_weighted(fit, weighted, seed)

    size = fit.vector.size
    num_walkers = max(64, 2 * (2 * size // 2 + 1))
    ensembles = [
        _Ensemble.begin(fit, weighted, num_walkers, index, seed, folder)
        for index in range(NUM_ENSEMBLES)
    ]
    while True:
        for ensemble in ensembles:
            ensemble.advance(CHUNK)
        num_steps = ensembles[0].num_steps
        drop = int(BURN_IN * num_steps)
        chains = np.stack([ensemble.chain()[drop:] for ensemble in ensembles])
        convergence = judge(chains)
        if progress is not None:
            progress(
                f"{num_steps} steps, {convergence.effective_size:.0f} effective draws",
                min(1.0, max(convergence.effective_size / 800.0, num_steps / most_steps)),
            )
        if (convergence.is_enough and num_steps >= 2 * CHUNK) or num_steps >= most_steps:
            break
    density = np.stack([ensemble.density()[drop:] for ensemble in ensembles])
    return Posterior(fit, keep(chains), keep(density), "emcee", weighted, convergence)


def keep(draws: Float[np.ndarray, "ensemble step walker ..."]) -> np.ndarray:
    """Return about `NUM_KEPT` draws, shape (ensemble, draw, ...): whole steps, walker by walker.

    Every n-th of all draws in a row would be the same few walkers wherever n and their number
    share a divisor. One walker after the other, so that whoever looks for the autocorrelation of
    the rows finds it.
    """
    every = max(1, draws.shape[0] * draws.shape[1] * draws.shape[2] // NUM_KEPT)
    by_walker = np.swapaxes(draws[:, ::every], 1, 2)
    return by_walker.reshape(draws.shape[0], -1, *draws.shape[3:])


def weighted_draws(fit: Fit, *, seed: int = 0) -> Posterior:
    """Return weighted draws around a fit, whether their guard holds or not; it says so itself."""
    return _of_weighted(fit, importance_sample(fit, seed=seed), seed)


def _of_weighted(fit: Fit, weighted: Weighted, seed: int) -> Posterior:
    vectors = weighted.resample(NUM_KEPT, np.random.default_rng([seed, 1]))
    density = np.full((1, NUM_KEPT), np.nan)
    return Posterior(fit, vectors[None], density, "importance", weighted, None)


def _moves(weighted: Weighted) -> list[tuple[emcee.moves.Move, float]]:
    """Return the moves of an ensemble with their shares.

    Differential evolution mixes three times faster than the stretch move in a dozen dimensions,
    and its full steps change between optima. Draws from the proposal of the weighted draws
    forget where a walker was wherever that proposal is good, at five times the cost of a step of
    evolution; where it is not good, evolution goes on alone. The snooker move of emcee 3.1.6 is
    left out: it gave a standard normal in ten dimensions a variance of 0.6.
    """
    evolution, exchange = emcee.moves.DEMove(), emcee.moves.DEMove(gamma0=1.0)
    if not weighted.is_sound:
        return [(evolution, 0.9), (exchange, 0.1)]
    proposal = weighted.proposal

    def anew(coordinates: np.ndarray, random: np.random.RandomState):
        rng = np.random.default_rng(random.randint(2**32, size=4, dtype=np.uint32))
        drawn = proposal.draw(coordinates.shape[0], rng)
        return drawn.vectors, proposal.log_density(coordinates) - drawn.log_density

    return [(evolution, 0.54), (exchange, 0.06), (emcee.moves.MHMove(anew), 0.4)]


class _Ensemble:
    """One ensemble with its chunks; takes up a checkpoint where there is one."""

    def __init__(self, sampler: emcee.EnsembleSampler, state, checkpoint, chunks) -> None:
        self._sampler, self._state = sampler, state
        self._checkpoint, self._waiting, self._done = checkpoint, chunks, []

    @classmethod
    def begin(
        cls,
        fit: Fit,
        weighted: Weighted,
        num_walkers: int,
        index: int,
        seed: int,
        folder: Path | None,
    ) -> _Ensemble:
        sampler = emcee.EnsembleSampler(
            num_walkers,
            fit.vector.size,
            partial(evaluate, fit),
            vectorize=True,
            moves=_moves(weighted),
        )
        rng = np.random.default_rng([seed, 7, index])
        start = weighted.resample(num_walkers, rng)
        # equal draws would leave the ensemble in a subspace that it cannot get out of
        start = start + 1e-3 * np.sqrt(np.diag(fit.covariance)) * rng.standard_normal(start.shape)
        random_state = np.random.RandomState(rng.integers(2**31)).get_state()
        state = emcee.State(start, random_state=random_state)
        if folder is None:
            return cls(sampler, state, None, [])
        digest = hashlib.sha256(
            repr((fit.problem.structure, seed, index, num_walkers)).encode() + start.tobytes()
        )
        checkpoint = Checkpoint(folder / f"ensemble_{index}", digest.hexdigest())
        return cls(sampler, state, checkpoint, checkpoint.load())

    @property
    def num_steps(self) -> int:
        return sum(chunk["chain"].shape[0] for chunk in self._done)

    def advance(self, num_steps: int) -> None:
        if self._waiting:
            chunk = self._waiting.pop(0)
            self._state = state_of(chunk)
            self._done.append(chunk)
            return
        self._sampler.reset()
        self._state = self._sampler.run_mcmc(self._state, num_steps)
        chain, density = self._sampler.get_chain(), self._sampler.get_log_prob()
        if self._checkpoint is not None:
            self._checkpoint.save(len(self._done), chain, density, self._state)
        self._done.append({"chain": chain, "log_density": density})

    def chain(self) -> np.ndarray:
        return np.concatenate([chunk["chain"] for chunk in self._done])

    def density(self) -> np.ndarray:
        return np.concatenate([chunk["log_density"] for chunk in self._done])
