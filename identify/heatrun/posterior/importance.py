"""Draws from around the optima of a fit, and their importance weights under the posterior.

The quick posterior follows the model where it bends (`rto.Rto`), in rounds around each optimum
until they are sound, weighted by the true density, the largest weights smoothed by a Pareto law
whose shape is the guard. The ensemble sampler starts from cheaper draws of the linear models
(`proposal.Proposal`), so that hardly any burn-in is needed; they may miss a tail that no guard
sees, which the walkers find.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

from ..fit.fit_result import Fit
from ..model.kernels import Kernels
from ..model.problem import NUM_NOISE
from .proposal import Proposal
from .rto import Drawn, Rto, log_mean
from .weighted import (
    LEAST_EFFECTIVE,
    AbstractDrawn,
    AbstractProposal,
    Weighted,
    evaluate,
    truncated,
)

NUM_ADAPTATIONS = 5
"""Most rounds in which the proposal is moved to the importance samples of the round before; one
that is sound gains little (`duty_90min`: effective sizes of 11, 14, 11, 13 % of the draws)."""


def importance_sample(fit: Fit, *, seed: int = 0, linear: Weighted | None = None) -> Weighted:
    """Draw from a posterior by following the model, and weigh by the density.

    Args:
        fit: The fit.
        seed: Random seed.
        linear: Draws of the linear models, where they are at hand: for where following fails.

    Reference: A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, Pareto Smoothed Importance
        Sampling, Journal of Machine Learning Research 25 (2024) 72.
    """
    followed = _followed(fit, np.random.default_rng(seed))
    if followed is not None and followed.is_sound:
        return followed
    linear = linear or linear_sample(fit, seed=seed)
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

    The proposal is moved to the draws of a round as long as that makes them better. Where no draw
    is possible, as where all lead to a network too stiff for the steps, the optimum
    stands for them: equal draws are never sound, and walkers can start from them.
    """
    rng = np.random.default_rng(seed)
    proposal = Proposal.around(fit, rng)
    drawn = proposal.draw(num_draws, rng)
    best = _weigh(fit, proposal, drawn)
    for _ in range(NUM_ADAPTATIONS):
        if best.is_sound or not np.any(best.weights):
            break
        proposal = proposal.adapted(drawn, truncated(best.weights), rng)
        drawn = proposal.draw(num_draws, rng)
        weighted = _weigh(fit, proposal, drawn)
        if weighted.effective_size <= best.effective_size:
            break
        best = weighted
    if not np.any(best.weights):
        at = np.tile(fit.vector, (num_draws, 1))
        best = Weighted.of(at, evaluate(fit, at), np.zeros(num_draws), proposal)
    return best


def _followed(fit: Fit, rng: np.random.Generator) -> Weighted | None:
    return sample_rto(fit, Proposal.around(fit, rng).kernels, rng)


def _weigh(fit: Fit, proposal: AbstractProposal, drawn: AbstractDrawn) -> Weighted:
    return Weighted.of(drawn.vectors, evaluate(fit, drawn.vectors), drawn.log_density, proposal)


NUM_DRAWS = 256
"""Draws of a round: the first leads to where the noise is, the others are three times as good."""

LEARNING = 4
"""Rounds, at most, after each of which the model is linearised anew at the mean of the draws."""

GOOD = 0.1
"""Effective sample size over draws with which no other place is looked for [1]."""

MOST_ROUNDS, TELLING, SHORT = 32, 4, 2.0
"""Rounds around an optimum whose draws count, at most; rounds that tell how many draws count; and
how many times too few these may be, with all rounds, to go on [1]: they come by chance."""


def sample_rto(fit: Fit, kernels: Kernels, rng: np.random.Generator) -> Weighted | None:
    """Return importance samples that follow the posterior, as many as make them sound.

    Draws around one optimum do not pass a fold of the model, behind which another optimum may lie.
    So an optimum that no draw came near is drawn around too, and each draw counts with the mean
    density of all proposals.

    Returns:
        The draws, or None where they leave out an optimum of the fit.

    Reference: V. Elvira, L. Martino, D. Luengo, M. F. Bugallo, Generalized Multiple Importance
        Sampling, Statistical Science 34 (2019) 129-155.
    """
    around = [_learned(fit, fit.z, kernels, rng)]
    found = around[0][0].weighted
    if not np.any(found.weights):
        return None
    for number, mode in enumerate(fit.modes):
        if not covered(fit, found)[number]:
            around.append(_learned(fit, mode, kernels, rng))
            found = _pooled(around)
    for done in range(1, MOST_ROUNDS):
        if found.is_sound or found.is_beyond_hope or not np.any(found.weights):
            break
        in_all = found.effective_size * MOST_ROUNDS / done
        if done >= TELLING and SHORT * in_all < LEAST_EFFECTIVE:
            break
        noise_z = Kernels.over(found.vectors[:, -NUM_NOISE:], truncated(found.weights), rng)
        for part in around:
            part.append(_Round.of(part[0].proposal.over(noise_z, rng), rng))
        found = _pooled(around)
    return found if np.all(covered(fit, found)) else None


def covered(fit: Fit, weighted: Weighted) -> Bool[np.ndarray, " mode"]:
    """Return whether draws were made around each optimum of a fit.

    Where hardly any are made, one would weigh more than any that was.
    """
    optima = np.concatenate([fit.modes, np.tile(fit.noise_z, (len(fit.modes), 1))], axis=1)
    weight = evaluate(fit, optima) - weighted.proposal.log_density(optima) - weighted.log_evidence
    return weight < np.log(weighted.weights.size * np.max(weighted.weights))


@dataclass(frozen=True)
class Several:
    """Proposals around several optima."""

    parts: tuple[Rto, ...]  # One for each.
    shares: Float[np.ndarray, " part"]  # Shares of the draws [1].

    def draw(self, num: int, rng: np.random.Generator) -> Drawn:
        """Return draws, those of the parts in an order by chance."""
        counts = rng.multinomial(num, self.shares)
        drawn = [part.draw(k, rng) for part, k in zip(self.parts, counts, strict=True) if k]
        order = rng.permutation(num)
        vectors = np.concatenate([each.vectors for each in drawn])[order]
        own = np.concatenate([each.log_density for each in drawn])[order]
        log_density = np.where(np.isfinite(own), self.log_density(vectors), own)
        return Drawn(vectors, log_density, np.full(num, np.nan))

    def log_density(self, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
        """Return the log density of vectors from elsewhere [nat]."""
        return self.mean([part.log_density(vectors) for part in self.parts])

    @property
    def latest(self) -> Several:
        """As `Rto.latest`."""
        return replace(self, parts=tuple(part.latest for part in self.parts))

    def mean(self, log_densities: Sequence[np.ndarray]) -> Float[np.ndarray, " draw"]:
        """Return the log density of vectors from that of each part [nat]."""
        rows = np.stack(log_densities) + np.log(self.shares)[:, None]
        return np.asarray(logsumexp(rows, axis=0))


@dataclass(frozen=True)
class _Place:
    """What the proposals around one optimum say of a round's draws."""

    # Log density of the parameters given the noise, which they share [nat].
    given: Float[np.ndarray, " draw"]
    restricted: Float[np.ndarray, " draw"]  # That of the noise alone under the linear model [nat].
    # That of the noise under the law of each of their rounds [nat], as far as they were asked for:
    # each law is asked once.
    noise: list[Float[np.ndarray, " draw"]] = field(default_factory=list)


@dataclass(frozen=True)
class _Round:
    """Draws from one proposal."""

    proposal: Rto  # The proposal.
    weighted: Weighted  # The draws with their weights.
    own: _Place  # What the proposals around the same optimum say of them.
    # Likewise those around other optima, by the place of these; filled in where it is asked for.
    elsewhere: dict[int, _Place] = field(default_factory=dict)

    @classmethod
    def of(cls, proposal: Rto, rng: np.random.Generator) -> _Round:
        """Draw."""
        drawn = proposal.draw(NUM_DRAWS, rng)
        weighted = _weigh(proposal.fit, proposal, drawn)
        noise = proposal.log_noise(drawn.vectors[:, -NUM_NOISE:], drawn.restricted)
        return cls(proposal, weighted, _Place(drawn.log_density - noise, drawn.restricted))

    def log_density(self, part: Rto, place: int | None = None) -> Float[np.ndarray, " draw"]:
        """Return the log density of the draws by all rounds around an optimum [nat].

        Args:
            part: The proposal of these rounds; since it was asked last, rounds may have been added.
            place: Of the optimum, if it is another one than that of the draws.
        """
        vectors = self.weighted.vectors
        if place is not None and place not in self.elsewhere:
            self.elsewhere[place] = _Place(*part.log_given(vectors))
        there = self.own if place is None else self.elsewhere[place]
        for law in part.noises[len(there.noise) :]:
            there.noise.append(law.log_density(vectors[:, -NUM_NOISE:], there.restricted))
        return there.given + log_mean(there.noise)


def _learned(
    fit: Fit, optimum: Float[np.ndarray, " parameter"], kernels: Kernels, rng: np.random.Generator
) -> list[_Round]:
    """Return the best of a few rounds around one optimum, each from where the last one leads, as
    long as that is better.
    """
    rounds = [_Round.of(Rto.around(fit, optimum, kernels, rng), rng)]
    while len(rounds) < LEARNING and rounds[-1].weighted.effective_size < GOOD * NUM_DRAWS:
        sizes = [each.weighted.effective_size for each in rounds]
        if sizes[-1] < max(sizes) or sizes[-1] == 0.0:
            break
        weights = truncated(rounds[-1].weighted.weights)
        vectors = rounds[-1].weighted.vectors
        noise_z = Kernels.over(vectors[:, -NUM_NOISE:], weights, rng)
        mean = weights @ vectors[:, :-NUM_NOISE]
        rounds.append(_Round.of(Rto.around(fit, mean, noise_z, rng), rng))
    return [max(rounds, key=lambda each: each.weighted.effective_size)]


def _pooled(around: Sequence[Sequence[_Round]]) -> Weighted:
    """Return the draws of rounds around one or several optima, each with the mean density of all
    proposals.
    """
    parts = tuple(_joined(rounds) for rounds in around)
    counts = np.array([len(rounds) for rounds in around], dtype=float)
    proposal = parts[0] if len(parts) == 1 else Several(parts, counts / np.sum(counts))
    rounds = [(place, each) for place, part in enumerate(around) for each in part]
    densities = []
    for own, each in rounds:
        by_place = [each.log_density(part, None if place == own else place)
                    for place, part in enumerate(parts)]  # fmt: skip
        is_one = isinstance(proposal, Rto)
        densities.append(by_place[0] if is_one else proposal.mean(by_place))
    vectors = np.concatenate([each.weighted.vectors for _, each in rounds])
    log_posterior = np.concatenate([each.weighted.log_density for _, each in rounds])
    return Weighted.of(vectors, log_posterior, np.concatenate(densities), proposal)


def _joined(rounds: Sequence[_Round]) -> Rto:
    """Return the proposal of all rounds around one optimum."""
    noises = tuple(law for each in rounds for law in each.proposal.noises)
    return replace(rounds[0].proposal, noises=noises)
