r"""Randomize-then-optimize: draws that follow a posterior where it bends.

A dozen parameters are told together far better than each alone: the posterior is a sheet that is
thin in some directions, and over the width of the others it bends by many times its thickness. No
draw of a linear model stays on it, and steps of MCMC along it are short. Given the noise, with
residuals r, their derivative J_0 at the optimum and the covariance C of the noise, let

$$ s(z) = J_0^\top C^{-1} r(z) + z $$

for a linear model the gradient, prior included, of minus the log posterior, whose law is then
normal with covariance J_0' inv(C) J_0 + 1. So s is drawn from this law, and z is where the
*whole* model has that s: the sheet is followed as far as it goes, and the density of z is that of
s times the determinant of ds/dz, in closed form. It differs from the posterior only by how far the
model's curve leaves the plane of J_0, and the importance weights make up for it.

Reference: J. M. Bardsley, A. Solonen, H. Haario, M. Laine, Randomize-then-optimize: a method for
    sampling from posterior distributions in nonlinear inverse problems, SIAM Journal on Scientific
    Computing 36 (2014) A1895-A1910.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.special import logsumexp

from ..fit.fit_result import Fit
from ..fit.restricted import inner_products
from ..io.programs import compiled
from ..model.kernels import Kernels, at_once, in_batches, log_student, student
from ..model.noise import LARGEST_SCORES
from ..model.problem import NUM_NOISE, Data, Structure, linearise, residuals
from .weighted import Weighted, evaluate, truncated

FREEDOM = 30.0
"""Degrees of freedom of the draws: hardly more than normal tails, for a linear model's are those of
the posterior [1]."""

MOST_STEPS, MOST_SLOPES = 12, 5
"""Steps to where the model has the drawn s, of Broyden's and then of Newton's method: what these
have not found is nowhere."""

CLOSE = 1e-2
"""How far the s that was found may be from the one that was drawn [standard deviations]; the
density is that of the one that was found."""

AT_A_TIME = 16
"""Draws that a thread takes at a time."""


class _Seen(NamedTuple):
    """The statistic s at many places.

    Attributes:
        value: s.
        slope: ds/dz.
    """

    value: Float[np.ndarray, "draw parameter"]
    slope: Float[np.ndarray, "draw parameter parameter"]


@dataclass(frozen=True)
class Drawn:
    """Draws with their density.

    Attributes:
        vectors: Scores of parameters and noise; where no place has the drawn s, the optimum with an
            infinite density, so that it weighs nothing.
        log_density: Of the proposal [nat].
    """

    vectors: Float[np.ndarray, "draw all"]
    log_density: Float[np.ndarray, " draw"]


@dataclass(frozen=True)
class Rto:
    """The proposal.

    Attributes:
        fit: What is drawn from.
        centre: Scores at which the model is linearised for s: the optimum, or the mean of draws.
        residual: Residuals there, all tests in a row [K].
        jacobian: Their derivative [K per score].
        kernels: Densities of the noise, which count alike.
    """

    fit: Fit
    centre: Float[np.ndarray, " parameter"]
    residual: Float[np.ndarray, " block"]
    jacobian: Float[np.ndarray, "block parameter"]
    kernels: tuple[Kernels, ...]

    @classmethod
    def around(cls, fit: Fit, centre: Float[np.ndarray, " parameter"], kernels: Kernels) -> Rto:
        """Return it with the model linearised at a place, and with a density of the noise."""
        problem = fit.problem
        residual, jacobian = linearise(problem.structure, problem.data, centre)
        return cls(fit, centre, np.asarray(residual), np.asarray(jacobian), (kernels,))

    def draw(self, num: int, rng: np.random.Generator) -> Drawn:
        """Return draws."""
        which = rng.integers(len(self.kernels), size=num)
        drawn = np.stack([each.draw(num, rng) for each in self.kernels])
        noise_z = drawn[which, np.arange(num)]
        white = student(num, self.centre.size, rng, FREEDOM)
        value, factor = self._linear(noise_z)
        wanted = _times(factor, white)
        start = self.centre + _solve(np.swapaxes(factor, 1, 2), white - _solve(factor, value))
        z, seen = self._solved(start, noise_z, wanted, factor)
        given = _log_density(seen, factor)
        vectors = np.concatenate([z, noise_z], axis=1)
        is_found = np.isfinite(given) & np.all(np.isfinite(vectors), axis=1)
        vectors = np.where(is_found[:, None], vectors, self.fit.vector)
        given = np.where(is_found, given, np.inf)
        return Drawn(vectors, given + self.log_noise(noise_z))

    def log_density(self, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
        """Return the log density of vectors from elsewhere [nat]."""
        return self.log_given(vectors) + self.log_noise(vectors[:, -NUM_NOISE:])

    def log_given(self, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
        """Return the log density of the parameters given the noise [nat]."""
        z, noise_z = vectors[:, :-NUM_NOISE], vectors[:, -NUM_NOISE:]
        given = _log_density(self._seen(z, noise_z), self._linear(noise_z)[1])
        return np.where(np.isfinite(given), given, -np.inf)

    def log_noise(self, noise_z: Float[np.ndarray, "draw noise"]) -> Float[np.ndarray, " draw"]:
        """Return the log density of the noise [nat]."""
        parts = [each.log_densities(noise_z) for each in self.kernels]
        return np.asarray(logsumexp(parts, axis=0)) - np.log(len(parts))

    @property
    def latest(self) -> Rto:
        """It with the last density of the noise alone, which all draws before have gone into: as
        good to move walkers with, and many times as fast.
        """
        return replace(self, kernels=self.kernels[-1:])

    def _solved(
        self,
        z: Float[np.ndarray, "draw parameter"],
        noise_z: Float[np.ndarray, "draw noise"],
        wanted: Float[np.ndarray, "draw parameter"],
        factor: Float[np.ndarray, "draw parameter parameter"],
    ) -> tuple[np.ndarray, _Seen]:
        """Return where s is as wanted, and what is seen there; not a number where it is nowhere.

        Newton's steps, made shorter as long as they lead farther away. They need the slope, which
        costs ten times as much as s alone, so they begin where steps without it end: after
        those, few are left.
        """
        z, share = self._neared(z, noise_z, wanted, factor), np.ones(len(z))
        value, slope = map(np.array, self._seen(z, noise_z))
        away = np.linalg.norm(_solve(factor, value - wanted), axis=1)
        is_allowed = np.all(noise_z <= LARGEST_SCORES, axis=1)
        for _ in range(MOST_SLOPES):
            left = np.flatnonzero(is_allowed & (away > CLOSE))
            if not left.size:
                break
            step = _solve(slope[left], value[left] - wanted[left])
            tried = z[left] - share[left, None] * step
            there = self._seen(tried, noise_z[left])
            now = np.linalg.norm(_solve(factor[left], there.value - wanted[left]), axis=1)
            is_nearer = now < away[left]
            rows = left[is_nearer]
            z[rows], value[rows], slope[rows] = (
                part[is_nearer] for part in (tried, there.value, there.slope)
            )
            away[rows] = now[is_nearer]
            share[left] = np.where(is_nearer, np.minimum(1.0, 2.0 * share[left]), share[left] / 4.0)
        value[~(away <= CLOSE)] = np.nan
        return z, _Seen(value, slope)

    def _neared(
        self,
        z: Float[np.ndarray, "draw parameter"],
        noise_z: Float[np.ndarray, "draw noise"],
        wanted: Float[np.ndarray, "draw parameter"],
        factor: Float[np.ndarray, "draw parameter parameter"],
    ) -> np.ndarray:
        """Return where s is as wanted, or nearer to it, by Broyden's method.

        In the scores in which the slope of the linear model is one, it begins with that. A step
        that leads farther away is not taken, but what it tells of the slope is.

        Reference: C. G. Broyden, A class of methods for solving nonlinear simultaneous equations,
            Mathematics of Computation 19 (1965) 577-593.
        """
        z = z.copy()
        transposed = np.swapaxes(factor, 1, 2)
        inverse = np.tile(np.eye(z.shape[1]), (len(z), 1, 1))
        is_allowed = np.all(noise_z <= LARGEST_SCORES, axis=1)
        left = np.flatnonzero(is_allowed)
        away = np.full_like(z, np.inf)
        away[left] = self._away(z[left], noise_z[left], wanted[left], factor[left])
        for _ in range(MOST_STEPS):
            length = np.linalg.norm(away, axis=1)
            left = np.flatnonzero(is_allowed & (length > CLOSE) & np.isfinite(length))
            if not left.size:
                break
            step = -_times(inverse[left], away[left])
            tried = z[left] + _solve(transposed[left], step)
            there = self._away(tried, noise_z[left], wanted[left], factor[left])
            change = _times(inverse[left], there - away[left])
            along = np.sum(step * change, axis=1)
            with np.errstate(all="ignore"):  # of steps that leave the model
                turned = _times(np.swapaxes(inverse[left], 1, 2), step)
                update = (step - change)[:, :, None] * (turned / along[:, None])[:, None, :]
            is_told = np.all(np.isfinite(update), axis=(1, 2))
            inverse[left[is_told]] += update[is_told]
            is_nearer = np.linalg.norm(there, axis=1) < length[left]
            z[left[is_nearer]], away[left[is_nearer]] = tried[is_nearer], there[is_nearer]
            is_allowed[left[~is_told & ~is_nearer]] = False
        return z

    def _away(
        self,
        z: Float[np.ndarray, "draw parameter"],
        noise_z: Float[np.ndarray, "draw noise"],
        wanted: Float[np.ndarray, "draw parameter"],
        factor: Float[np.ndarray, "draw parameter parameter"],
    ) -> np.ndarray:
        """Return how far s is from the one that is wanted, as white scores."""
        problem = self.fit.problem
        rows = np.concatenate([z, noise_z], axis=1)
        value = in_batches(
            partial(_statistics, problem.structure, problem.data, self.jacobian), rows, AT_A_TIME
        )
        return _solve(factor, value - wanted)

    def _linear(self, noise_z: Float[np.ndarray, "draw noise"]) -> tuple[np.ndarray, np.ndarray]:
        """Return s at the centre, and the lower Cholesky factor of its covariance."""
        data = self.fit.problem.data
        products = in_batches(
            partial(_many_products, data, self.residual, self.jacobian), noise_z, AT_A_TIME
        )
        size = self.centre.size
        return products[:, 1:, 0] + self.centre, _factors(products[:, 1:, 1:] + np.eye(size))

    def _seen(
        self, z: Float[np.ndarray, "draw parameter"], noise_z: Float[np.ndarray, "draw noise"]
    ) -> _Seen:
        """Return s and its slope at many places, each under its noise."""
        structure, data = self.fit.problem.structure, self.fit.problem.data
        size = z.shape[1]

        def some(start: int) -> np.ndarray:
            rows = []
            for k in range(start, min(start + AT_A_TIME, len(z))):
                # one at a time: the Jacobians of a batch fall out of the cache
                linear = linearise(structure, data, z[k])
                rows.append(_cross_products(data, noise_z[k], *linear, self.jacobian))
            return np.stack(rows)

        products = np.concatenate(at_once(some, range(0, len(z), AT_A_TIME)))
        return _Seen(products[:, :, 0] + z, products[:, :, 1:] + np.eye(size))


@compiled("structure")
def _statistics(
    structure: Structure,
    data: Data,
    reference: Float[Array, "block parameter"],
    vectors: Float[Array, "draw all"],
) -> Float[Array, "draw parameter"]:
    """Return s at draws of scores and noise."""

    def one(vector: Float[Array, " all"]) -> Float[Array, " parameter"]:
        z, noise_z = vector[:-NUM_NOISE], vector[-NUM_NOISE:]
        residual = jnp.concatenate(residuals(structure, data, z))

        def half_squares(rows: Float[Array, " block"]) -> Float[Array, ""]:
            return 0.5 * inner_products(data, noise_z, rows, jnp.zeros((rows.size, 0)))[0][0, 0]

        return reference.T @ jax.grad(half_squares)(residual) + z

    return jax.vmap(one)(vectors)


@compiled()
def _cross_products(
    data: Data,
    noise_z: Float[Array, " noise"],
    residual: Float[Array, " block"],
    jacobian: Float[Array, "block parameter"],
    reference: Float[Array, "block parameter"],
) -> Float[Array, "parameter product"]:
    """Return the products of the columns of a reference with the residual and the Jacobian."""
    columns = jnp.concatenate([jacobian, reference], axis=1)
    products, _ = inner_products(data, noise_z, residual, columns)
    num = jacobian.shape[1]
    return products[1 + num :, : 1 + num]


@compiled()
def _many_products(
    data: Data,
    residual: Float[Array, " block"],
    jacobian: Float[Array, "block parameter"],
    noise_z: Float[Array, "draw noise"],
) -> Float[Array, "draw product product"]:
    return jax.vmap(lambda each: inner_products(data, each, residual, jacobian)[0])(noise_z)


def _log_density(
    seen: _Seen, factor: Float[np.ndarray, "draw parameter parameter"]
) -> Float[np.ndarray, " draw"]:
    """Return the log density of places from what is seen there [nat]; -inf beyond a fold, where s
    goes back, and not a number where nothing is seen.
    """
    squares = np.sum(_solve(factor, seen.value) ** 2, axis=1)
    with np.errstate(invalid="ignore"):  # of places without an answer
        sign, log_det = np.linalg.slogdet(seen.slope)
    log_sd = np.sum(np.log(np.diagonal(factor, axis1=1, axis2=2)), axis=1)
    found = np.asarray(log_student(squares, seen.value.shape[1], FREEDOM)) + log_det - log_sd
    return np.where(sign > 0.0, found, np.where(np.isnan(found), np.nan, -np.inf))


def _factors(
    matrices: Float[np.ndarray, "draw row row"],
) -> Float[np.ndarray, "draw row row"]:
    """Return lower Cholesky factors; not a number for a matrix that has none."""
    return _of_each(np.linalg.cholesky, matrices)


def _solve(
    matrices: Float[np.ndarray, "draw row row"], vectors: Float[np.ndarray, "draw row"]
) -> Float[np.ndarray, "draw row"]:
    """Return solutions; not a number where there is none."""
    joined = np.concatenate([matrices, vectors[..., None]], axis=2)
    return _of_each(lambda rows: np.linalg.solve(rows[..., :-1], rows[..., -1:])[..., 0], joined)


def _of_each(function, stacked: np.ndarray) -> np.ndarray:
    """Return what a function of stacked matrices gives; not a number for those that it refuses."""
    try:
        return function(stacked)
    except np.linalg.LinAlgError:
        if len(stacked) == 1:
            return np.full_like(function(np.eye(*stacked.shape[1:])[None]), np.nan)
        halves = np.array_split(stacked, 2)
        return np.concatenate([_of_each(function, half) for half in halves])


def _times(
    matrices: Float[np.ndarray, "draw row column"], vectors: Float[np.ndarray, "draw column"]
) -> Float[np.ndarray, "draw row"]:
    return (matrices @ vectors[..., None])[..., 0]


NUM_DRAWS = 512
"""Draws of a round."""

LEARNING = 4
"""Rounds, at most, after each of which the model is linearised anew at the mean of the draws."""

GOOD = 0.1
"""Effective sample size over draws with which no other place is looked for [1]."""

MOST_ROUNDS = 16
"""Rounds around an optimum whose draws count, at most."""


def sample_rto(fit: Fit, kernels: Kernels, rng: np.random.Generator) -> Weighted | None:
    """Return importance samples that follow the posterior, as many as make them sound.

    Draws around one optimum do not pass a fold of the model, behind which another optimum may lie.
    So an optimum that no draw came near is drawn around too, and each draw counts with the mean
    density of all proposals.

    Args:
        fit: The optima.
        kernels: Density of the noise.
        rng: Of the draws.

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
    for _ in range(MOST_ROUNDS - 1):
        if found.is_sound or found.is_beyond_hope or not np.any(found.weights):
            break
        noise_z = Kernels.over(found.vectors[:, -NUM_NOISE:], truncated(found.weights), rng)
        for part in around:
            part.append(_Round.of(replace(part[0].proposal, kernels=(noise_z,)), rng))
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

    @property
    def latest(self) -> Several:
        """As `Rto.latest`."""
        return replace(self, parts=tuple(part.latest for part in self.parts))

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
        elsewhere: Log density of the draws given their noise around other optima, by the place of
            those [nat]; filled in where it is asked for.
    """

    proposal: Rto
    drawn: Drawn
    weighted: Weighted
    elsewhere: dict[int, Float[np.ndarray, " draw"]] = field(default_factory=dict)

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


def _learned(
    fit: Fit, optimum: Float[np.ndarray, " parameter"], kernels: Kernels, rng: np.random.Generator
) -> list[_Round]:
    """Return the best of a few rounds around one optimum, each from where the last one leads, as
    long as that is better.
    """
    rounds = [_Round.of(Rto.around(fit, optimum, kernels), rng)]
    while len(rounds) < LEARNING and rounds[-1].weighted.effective_size < GOOD * NUM_DRAWS:
        weights = truncated(rounds[-1].weighted.weights)
        sizes = [each.weighted.effective_size for each in rounds]
        if not np.any(weights) or sizes[-1] < max(sizes):
            break
        vectors = rounds[-1].drawn.vectors
        noise_z = Kernels.over(vectors[:, -NUM_NOISE:], weights, rng)
        mean = weights @ vectors[:, :-NUM_NOISE]
        rounds.append(_Round.of(Rto.around(fit, mean, noise_z), rng))
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
    for place, each in rounds:
        own = _density(parts[place], each)
        if isinstance(proposal, Several):
            own = proposal.mean([
                own if other == place else _density_elsewhere(parts[other], other, each)
                for other in range(len(parts))
            ])  # fmt: skip
        densities.append(own)
    vectors = np.concatenate([each.drawn.vectors for _, each in rounds])
    log_posterior = np.concatenate([each.weighted.log_density for _, each in rounds])
    return Weighted.of(vectors, log_posterior, np.concatenate(densities), proposal)


def _joined(rounds: Sequence[_Round]) -> Rto:
    """Return the proposal of all rounds around one optimum."""
    kernels = tuple(kernel for each in rounds for kernel in each.proposal.kernels)
    return replace(rounds[0].proposal, kernels=kernels)


def _density(joined: Rto, own: _Round) -> Float[np.ndarray, " draw"]:
    """Return the log density of a round's draws by all rounds around its optimum [nat], which share
    that given the noise.
    """
    noise_z = own.drawn.vectors[:, -NUM_NOISE:]
    return own.drawn.log_density - own.proposal.log_noise(noise_z) + joined.log_noise(noise_z)


def _density_elsewhere(other: Rto, place: int, drawn: _Round) -> Float[np.ndarray, " draw"]:
    """Return that of draws by the rounds around another optimum [nat]."""
    vectors = drawn.drawn.vectors
    if place not in drawn.elsewhere:
        drawn.elsewhere[place] = other.log_given(vectors)
    return drawn.elsewhere[place] + other.log_noise(vectors[:, -NUM_NOISE:])
