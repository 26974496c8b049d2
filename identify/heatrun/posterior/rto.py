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

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import logsumexp

from ..fit.fit_result import Fit
from ..fit.restricted import inner_products
from ..io.programs import compiled
from ..model.draws import side_by_side
from ..model.kernels import Kernels, at_once, in_batches, log_student, student
from ..model.noise import LARGEST_SCORES
from ..model.problem import NUM_NOISE, Data, Structure, linearise, residuals
from ..record.observation import Observation

FREEDOM = 100.0
"""Degrees of freedom of the draws: hardly more than normal tails, for a linear model's are those of
the posterior [1]. With 30 of them the draws of 26 parameters were a third less alike."""

MOST_STEPS, MOST_SLOPES = 12, 5
"""Steps to where the model has the drawn s, of Broyden's and then of Newton's method: what these
have not found is nowhere."""

CLOSE = 1e-2
"""How far the s that was found may be from the one that was drawn [standard deviations]; the
density is that of the one that was found."""

AT_A_TIME, OF_LONG = 16, 4
"""Draws that a thread takes at a time, and those of a long test."""


KEPT = 0.5
"""Share of the noises from the kernels that are kept [1]: the fewer, the more alike they count, but
what the linear model says of a noise takes a tenth of the time of following the model."""

LEAST_KEPT = 0.05
"""Chance of a noise that the linear model finds hopeless [1]: it may be wrong."""

NUM_TRIED = 512
"""Noises that tell from which level on they are kept."""


@dataclass(frozen=True)
class Noises:
    """Noises from kernels, of which those are kept that the linear model finds likely.

    Reference: J. S. Liu, R. Chen, W. H. Wong, Rejection Control and Sequential Importance Sampling,
        Journal of the American Statistical Association 93 (1998) 1022-1031.
    """

    kernels: Kernels  # What they are drawn from.
    level: float  # Log of the ratio of the two densities from which on each is kept [nat].
    log_share: float  # Log of the share that is kept [nat].

    @classmethod
    def of(cls, kernels: Kernels, log_ratio: Float[np.ndarray, " tried"]) -> Noises:
        """Return them with the level that keeps the share that is wanted.

        Args:
            kernels: What they are drawn from.
            log_ratio: Of draws from them, what `log_chance` takes [nat].
        """
        finite = np.sort(log_ratio[np.isfinite(log_ratio)])
        levels = finite if finite.size else np.zeros(1)
        shares = np.mean(np.exp(_log_chance(log_ratio - levels[:, None])), axis=1)
        place = max(np.searchsorted(-shares, -KEPT, side="right") - 1, 0)
        return cls(kernels, float(levels[place]), float(np.log(shares[place])))

    def log_chance(self, log_ratio: Float[np.ndarray, " draw"]) -> Float[np.ndarray, " draw"]:
        """Return the log of the chance that noises are kept [nat].

        Args:
            log_ratio: Log density of the noise alone under the linear model, up to a constant, less
                that under the kernels [nat].
        """
        return _log_chance(log_ratio - self.level)

    def log_density(
        self, noise_z: Float[np.ndarray, "draw noise"], restricted: Float[np.ndarray, " draw"]
    ) -> Float[np.ndarray, " draw"]:
        """Return the log density of noises [nat].

        Args:
            noise_z: Their scores.
            restricted: Their log density under the linear model [nat].
        """
        drawn = self.kernels.log_densities(noise_z)
        return drawn + self.log_chance(restricted - drawn) - self.log_share


def _log_chance(log_ratio: Float[np.ndarray, "*draw"]) -> Float[np.ndarray, "*draw"]:
    chance = np.clip(np.where(np.isnan(log_ratio), -np.inf, log_ratio), np.log(LEAST_KEPT), 0.0)
    return np.asarray(chance)


class _Linear(NamedTuple):
    """What the linear model says of noises."""

    value: Float[np.ndarray, "draw parameter"]  # s at the centre.
    # Lower Cholesky factor of the covariance of s.
    factor: Float[np.ndarray, "draw parameter parameter"]
    log_density: Float[np.ndarray, " draw"]  # Of the noise alone, up to a constant [nat].


class _Seen(NamedTuple):
    """The statistic s at many places."""

    value: Float[np.ndarray, "draw parameter"]  # s.
    slope: Float[np.ndarray, "draw parameter parameter"]  # ds/dz.


@dataclass(frozen=True)
class Drawn:
    """Draws with their density."""

    # Scores of parameters and noise; where no place has the drawn s, the optimum with an infinite
    # density, so that it weighs nothing.
    vectors: Float[np.ndarray, "draw all"]
    log_density: Float[np.ndarray, " draw"]  # Of the proposal [nat].
    # Log density of the noise alone under the linear model, if there is one [nat].
    restricted: Float[np.ndarray, " draw"]


@dataclass(frozen=True)
class Rto:
    """The proposal."""

    fit: Fit  # What is drawn from.
    # Scores at which the model is linearised for s: the optimum, or the mean of draws.
    centre: Float[np.ndarray, " parameter"]
    residual: Float[np.ndarray, " block"]  # Residuals there, all tests in a row [K].
    jacobian: Float[np.ndarray, "block parameter"]  # Their derivative [K per score].
    noises: tuple[Noises, ...] = ()  # Laws of the noise, which count alike.

    @classmethod
    def around(
        cls,
        fit: Fit,
        centre: Float[np.ndarray, " parameter"],
        kernels: Kernels,
        rng: np.random.Generator,
    ) -> Rto:
        """Return it with the model linearised at a place, and with a density of the noise."""
        problem = fit.problem
        residual, jacobian = linearise(problem.structure, problem.data, centre)
        return cls(fit, centre, np.asarray(residual), np.asarray(jacobian)).over(kernels, rng)

    def over(self, kernels: Kernels, rng: np.random.Generator) -> Rto:
        """Return it with another density of the noise."""
        tried = kernels.draw(NUM_TRIED, rng)
        ratio = self._linear(tried).log_density - kernels.log_densities(tried)
        return replace(self, noises=(Noises.of(kernels, ratio),))

    def draw(self, num: int, rng: np.random.Generator) -> Drawn:
        """Return draws."""
        noise_z, linear = self._noise(num, rng)
        white = student(num, self.centre.size, rng, FREEDOM)
        wanted = _times(linear.factor, white)
        step = _solve(np.swapaxes(linear.factor, 1, 2), white - _solve(linear.factor, linear.value))
        z, seen = self._solved(self.centre + step, noise_z, wanted, linear.factor)
        given = _log_density(seen, linear.factor)
        vectors = np.concatenate([z, noise_z], axis=1)
        is_found = np.isfinite(given) & np.all(np.isfinite(vectors), axis=1)
        vectors = np.where(is_found[:, None], vectors, self.fit.vector)
        given = np.where(is_found, given, np.inf)
        log_density = given + self.log_noise(noise_z, linear.log_density)
        return Drawn(vectors, log_density, linear.log_density)

    def _noise(self, num: int, rng: np.random.Generator) -> tuple[np.ndarray, _Linear]:
        """Return draws of the noise, in an order by chance, and what the linear model says."""
        rows, counts = [], rng.multinomial(num, np.full(len(self.noises), 1 / len(self.noises)))
        for law, wanted in zip(self.noises, counts, strict=True):
            while wanted:
                tried = law.kernels.draw(math.ceil(1.1 * wanted / np.exp(law.log_share)), rng)
                linear = self._linear(tried)
                ratio = linear.log_density - law.kernels.log_densities(tried)
                is_kept = np.log(rng.uniform(size=len(tried))) < law.log_chance(ratio)
                kept = np.flatnonzero(is_kept)[:wanted]
                rows.append((tried[kept], *(part[kept] for part in linear)))
                wanted -= len(kept)
        order = rng.permutation(num)
        noise_z, *linear = (np.concatenate(part)[order] for part in zip(*rows, strict=True))
        return noise_z, _Linear(*linear)

    def log_density(self, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
        """Return the log density of vectors from elsewhere [nat]."""
        given, restricted = self.log_given(vectors)
        return given + self.log_noise(vectors[:, -NUM_NOISE:], restricted)

    def log_given(
        self, vectors: Float[np.ndarray, "draw all"]
    ) -> tuple[Float[np.ndarray, " draw"], Float[np.ndarray, " draw"]]:
        """Return the log density of the parameters given the noise, and that of the noise alone
        under the linear model [nat].
        """
        z, noise_z = vectors[:, :-NUM_NOISE], vectors[:, -NUM_NOISE:]
        linear = self._linear(noise_z)
        given = _log_density(self._seen(z, noise_z), linear.factor)
        return np.where(np.isfinite(given), given, -np.inf), linear.log_density

    def log_noise(
        self, noise_z: Float[np.ndarray, "draw noise"], restricted: Float[np.ndarray, " draw"]
    ) -> Float[np.ndarray, " draw"]:
        """Return the log density of noises under all laws [nat], as `Noises.log_density`."""
        return log_mean([law.log_density(noise_z, restricted) for law in self.noises])

    @property
    def latest(self) -> Rto:
        """It with the last law of the noise alone, which all draws before have gone into: as good
        to move walkers with, and many times as fast.
        """
        return replace(self, noises=self.noises[-1:])

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
            partial(_statistics, problem.structure, problem.data, self.jacobian),
            rows,
            self._at_a_time,
        )
        return _solve(factor, value - wanted)

    @property
    def _at_a_time(self) -> int:
        return side_by_side(self.fit.problem.readings, AT_A_TIME, OF_LONG)

    def _linear(self, noise_z: Float[np.ndarray, "draw noise"]) -> _Linear:
        """Return what the linear model says of noises."""
        tests = self.fit.problem.readings
        products, log_sd = in_batches(
            partial(_many_products, tests, self.residual, self.jacobian),
            noise_z,
            self._at_a_time,
        )
        size = self.centre.size
        value = products[:, 1:, 0] + self.centre
        factor = _factors(products[:, 1:, 1:] + np.eye(size))
        fitted = np.sum(_solve(factor, value) ** 2, axis=1)
        squares = products[:, 0, 0] + np.sum(self.centre**2) - fitted + np.sum(noise_z**2, axis=1)
        return _Linear(value, factor, -0.5 * squares - log_sd - _log_det(factor))

    def _seen(
        self, z: Float[np.ndarray, "draw parameter"], noise_z: Float[np.ndarray, "draw noise"]
    ) -> _Seen:
        """Return s and its slope at many places, each under its noise."""
        problem = self.fit.problem
        size = z.shape[1]

        def some(start: int) -> np.ndarray:
            rows = []
            for k in range(start, min(start + AT_A_TIME, len(z))):
                # one at a time: the Jacobians of a batch fall out of the cache
                linear = linearise(problem.structure, problem.data, z[k])
                rows.append(_cross_products(problem.readings, noise_z[k], *linear, self.jacobian))
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
            return (
                0.5 * inner_products(data.tests, noise_z, rows, jnp.zeros((rows.size, 0)))[0][0, 0]
            )

        return reference.T @ jax.grad(half_squares)(residual) + z

    return jax.vmap(one)(vectors)


@compiled()
def _cross_products(
    tests: Sequence[Observation],
    noise_z: Float[Array, " noise"],
    residual: Float[Array, " block"],
    jacobian: Float[Array, "block parameter"],
    reference: Float[Array, "block parameter"],
) -> Float[Array, "parameter product"]:
    """Return the products of the columns of a reference with the residual and the Jacobian."""
    columns = jnp.concatenate([jacobian, reference], axis=1)
    products, _ = inner_products(tests, noise_z, residual, columns)
    num = jacobian.shape[1]
    return products[1 + num :, : 1 + num]


@compiled()
def _many_products(
    tests: Sequence[Observation],
    residual: Float[Array, " block"],
    jacobian: Float[Array, "block parameter"],
    noise_z: Float[Array, "draw noise"],
) -> tuple[Float[Array, "draw product product"], Float[Array, " draw"]]:
    return jax.vmap(lambda each: inner_products(tests, each, residual, jacobian))(noise_z)


def log_mean(log_densities: Sequence[np.ndarray]) -> Float[np.ndarray, " draw"]:
    """Return the log of the mean of densities [nat]."""
    return np.asarray(logsumexp(log_densities, axis=0)) - np.log(len(log_densities))


def _log_density(
    seen: _Seen, factor: Float[np.ndarray, "draw parameter parameter"]
) -> Float[np.ndarray, " draw"]:
    """Return the log density of places from what is seen there [nat]; -inf beyond a fold, where s
    goes back, and not a number where nothing is seen.
    """
    squares = np.sum(_solve(factor, seen.value) ** 2, axis=1)
    with np.errstate(invalid="ignore"):  # of places without an answer
        sign, log_det = np.linalg.slogdet(seen.slope)
    found = np.asarray(log_student(squares, seen.value.shape[1], FREEDOM))
    found = found + log_det - _log_det(factor)
    return np.where(sign > 0.0, found, np.where(np.isnan(found), np.nan, -np.inf))


def _log_det(factor: Float[np.ndarray, "draw row row"]) -> Float[np.ndarray, " draw"]:
    return np.sum(np.log(np.diagonal(factor, axis1=1, axis2=2)), axis=1)


def _factors(matrices: Float[np.ndarray, "draw row row"]) -> Float[np.ndarray, "draw row row"]:
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
