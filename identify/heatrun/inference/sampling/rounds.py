"""Rounds of draws that follow the model, around every optimum, until their weights are sound.

Randomize-then-optimize around one optimum does not pass a fold of the model, behind which another
optimum may lie. So an optimum that no draw came near is drawn around too, and each draw counts with
the mean density of all proposals.

Reference: V. Elvira, L. Martino, D. Luengo, M. F. Bugallo, Generalized Multiple Importance
    Sampling, Statistical Science 34 (2019) 129-155.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

from ..fitting.fit_result import Fit
from ..kernels import Kernels
from ..problem import NUM_NOISE
from .rto import Drawn, Rto
from .weighted import Weighted, evaluate, truncated

NUM_DRAWS = 1024
"""Draws of a round."""

LEARNING = 4
"""Rounds, at most, after each of which the model is linearised anew at the mean of the draws."""

GOOD = 0.1
"""Effective sample size over draws with which no other place is looked for [1]."""

MOST_ROUNDS = 8
"""Rounds around one optimum whose draws count, at most."""


def sample_rto(fit: Fit, kernels: Kernels, rng: np.random.Generator) -> Weighted | None:
    """Return importance samples that follow the posterior, as many as make them sound.

    Args:
        fit: The optima.
        kernels: Density of the noise.
        rng: Of the draws.

    Returns:
        The draws, or None where they leave out an optimum of the fit.
    """
    rounds, found = _rounds(fit, fit.z, kernels, rng)
    if not np.any(found.weights):
        return None
    around = [rounds]
    is_covered = covered(fit, found)
    for number, mode in enumerate(fit.modes):
        if not is_covered[number]:
            around.append(_rounds(fit, mode, kernels, rng)[0])
            found = _pooled(around)
            is_covered = covered(fit, found)
    return found if np.all(is_covered) else None


def covered(fit: Fit, weighted: Weighted) -> Bool[np.ndarray, " mode"]:
    """Return whether draws were made around each optimum of a fit.

    Where hardly any are made, one would weigh more than any that was.
    """
    optima = np.concatenate([fit.modes, np.tile(fit.noise_z, (len(fit.modes), 1))], axis=1)
    weight = evaluate(fit, optima) - weighted.proposal.log_density(optima) - weighted.log_evidence
    return weight < np.log(weighted.weights.size * np.max(weighted.weights))


@dataclass(frozen=True)
class Several:
    """Proposals around several optima.

    Attributes:
        parts: One for each.
        shares: Shares of the draws [1].
    """

    parts: tuple[Rto, ...]
    shares: Float[np.ndarray, " part"]

    def draw(self, num: int, rng: np.random.Generator) -> Drawn:
        """Return draws, those of the parts in an order by chance."""
        counts = rng.multinomial(num, self.shares)
        drawn = [part.draw(k, rng) for part, k in zip(self.parts, counts, strict=True) if k]
        order = rng.permutation(num)
        vectors = np.concatenate([each.vectors for each in drawn])[order]
        own = np.concatenate([each.log_density for each in drawn])[order]
        return Drawn(vectors, np.where(np.isfinite(own), self.log_density(vectors), own))

    def log_density(self, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
        """Return the log density of vectors from elsewhere [nat]."""
        return self.mean([part.log_density(vectors) for part in self.parts])

    def mean(self, log_densities: Sequence[np.ndarray]) -> Float[np.ndarray, " draw"]:
        """Return the log density of vectors from that of each part [nat]."""
        rows = np.stack(log_densities) + np.log(self.shares)[:, None]
        return np.asarray(logsumexp(rows, axis=0))


@dataclass(frozen=True)
class _Round:
    """Draws from one proposal.

    Attributes:
        proposal: The proposal.
        drawn: The draws.
        weighted: The same with their weights.
    """

    proposal: Rto
    drawn: Drawn
    weighted: Weighted

    @classmethod
    def of(cls, proposal: Rto, rng: np.random.Generator) -> _Round:
        """Draw."""
        drawn = proposal.draw(NUM_DRAWS, rng)
        log_posterior = evaluate(proposal.fit, drawn.vectors)
        return cls(
            proposal,
            drawn,
            Weighted.of(drawn.vectors, log_posterior, drawn.log_density, proposal),
        )


def _rounds(
    fit: Fit, optimum: Float[np.ndarray, " parameter"], kernels: Kernels, rng: np.random.Generator
) -> tuple[list[_Round], Weighted]:
    """Return the rounds around one optimum that count, all of one centre, and their draws."""
    rounds = [_Round.of(Rto.around(fit, optimum, kernels), rng)]
    while len(rounds) < LEARNING and rounds[-1].weighted.effective_size < GOOD * NUM_DRAWS:
        weights = truncated(rounds[-1].weighted.weights)
        if not np.any(weights):
            break
        vectors = rounds[-1].drawn.vectors
        noise_z = Kernels.over(vectors[:, -NUM_NOISE:], weights, rng)
        mean = weights @ vectors[:, :-NUM_NOISE]
        rounds.append(_Round.of(Rto.around(fit, mean, noise_z), rng))
    kept = [max(rounds, key=lambda each: each.weighted.effective_size)]
    found = kept[0].weighted
    while np.any(found.weights) and not found.is_sound and len(kept) < MOST_ROUNDS:
        noise_z = Kernels.over(found.vectors[:, -NUM_NOISE:], truncated(found.weights), rng)
        latest = replace(kept[0].proposal, kernels=(noise_z,))
        kept.append(_Round.of(latest, rng))
        found = _pooled([kept])
    return kept, found


def _pooled(around: Sequence[Sequence[_Round]]) -> Weighted:
    """Return the draws of rounds around one or several optima, each with the mean density of all
    proposals.
    """
    parts = tuple(_joined(rounds) for rounds in around)
    counts = np.array([len(rounds) for rounds in around], dtype=float)
    proposal = parts[0] if len(parts) == 1 else Several(parts, counts / np.sum(counts))
    vectors, log_posterior, proposed = [], [], []
    for part, rounds in zip(parts, around, strict=True):
        drawn = np.concatenate([each.drawn.vectors for each in rounds])
        density = _density(part, rounds)
        if isinstance(proposal, Several):
            density = proposal.mean(
                [density if each is part else each.log_density(drawn) for each in parts]
            )
        vectors.append(drawn)
        log_posterior += [each.weighted.log_density for each in rounds]
        proposed.append(density)
    rows, of_rows, drawn_with = map(np.concatenate, (vectors, log_posterior, proposed))
    return Weighted.of(rows, of_rows, drawn_with, proposal)


def _joined(rounds: Sequence[_Round]) -> Rto:
    """Return the proposal of all rounds around one optimum."""
    kernels = tuple(kernel for each in rounds for kernel in each.proposal.kernels)
    return replace(rounds[0].proposal, kernels=kernels)


def _density(joined: Rto, rounds: Sequence[_Round]) -> Float[np.ndarray, " draw"]:
    """Return the log density of the draws of all rounds [nat], which share that given the noise."""
    densities = []
    for each in rounds:
        noise_z = each.drawn.vectors[:, -NUM_NOISE:]
        given = each.drawn.log_density - each.proposal.log_noise(noise_z)
        densities.append(given + joined.log_noise(noise_z))
    return np.concatenate(densities)
