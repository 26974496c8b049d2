"""The noise from residuals, with the parameters integrated out, and the spread around a fit.

Around a fit the model is linear in the scores, so the likelihood of the noise alone, the restricted
one, is Gaussian and closed: the parameters, with their priors, are integrated out. This is what
keeps the noise of a short test from being too small by the degrees of freedom that the fit has used
up. The spread of the posterior follows from its curvature at the fit (Laplace's method).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import minimize

from ..io.programs import compiled
from ..model import noise as noise_module
from ..model.noise import (
    LARGEST,
    LARGEST_SCORES,
    NOISE,
    eliminated,
    lower_factor,
    scale_of,
    solved_by,
)
from ..model.problem import NUM_NOISE, Problem
from ..record.blocks import Logger
from ..record.observation import Observation

STARTS_S = (8.0, 40.0, 200.0)
"""Correlation times that the search starts from [s]; the likelihood may have two maxima."""

MOST_POLISHING = 12
"""Most steps from where a search ended to the maximum; two or three do."""

NEAR = 0.1
"""How far a maximum may be from where a search ended [prior standard deviations]."""

FLAT = 1e-9
"""Slope at which the noise is taken to be at its maximum [nat per prior standard deviation]."""

LOGGER_SD = 1.0
"""Prior standard deviation of the logarithm of the noise of a logger over that of the first [1]."""

MANY = 40
"""Columns are filled up to a multiple of this, so that few programs serve all networks."""

SCORE_LIMIT = 4.0
"""The noise is sought from this many prior standard deviations below its centre on [1]."""


def restricted_log_likelihood(
    tests: Sequence[Observation],
    noise_z: Float[Array, " noise"],
    z: Float[Array, " parameter"],
    residual: Float[Array, " block"],
    jacobian: Float[Array, "block parameter"],
) -> Float[Array, ""]:
    """Return the log likelihood of the noise plus its log prior, up to a constant [nat].

    Args:
        tests: What was read, as `Problem.readings`.
        noise_z: Scores of the noise.
        z: Scores at which `residual` was taken; the prior pulls from there to zero.
        residual: Residuals of all tests in a row [K].
        jacobian: Their derivative [K per score].

    Reference: H. D. Patterson, R. Thompson, Recovery of inter-block information when block sizes
        are unequal, Biometrika 58 (1971) 545-554.
    """
    return marginal(*inner_products(tests, noise_z, residual, jacobian), noise_z, z)


class Conditional(NamedTuple):
    """What the linear model says for one noise."""

    # Restricted log likelihood of the noise plus its log prior, up to a constant [nat].
    log_density: Float[Array, ""]
    # Mean of the scores of the parameters under that noise, shape (parameter,).
    mean: Float[Array, " parameter"]
    # Lower Cholesky factor of their precision, shape (parameter, parameter).
    factor: Float[Array, "parameter parameter"]


def inner_products(
    tests: Sequence[Observation],
    noise_z: Float[Array, " noise"],
    residual: Float[Array, " block"],
    columns: Float[Array, "block column"],
) -> tuple[Float[Array, "product product"], Float[Array, ""]]:
    """Return the inner products of a residual and columns, whitened, the residual first, and half
    the log determinant of the noise.

    Args:
        tests: What was read, as `Problem.readings`.
        noise_z: Scores of the noise.
        residual: Of all tests in a row [K].
        columns: Such as derivatives, likewise [K].
    """
    noise = noise_module.from_scores(noise_z)
    joined = jnp.concatenate([residual[:, None], columns], axis=1)
    ends = np.cumsum([test.measured.size for test in tests])[:-1]
    products, log_sd = jnp.zeros((joined.shape[1],) * 2), jnp.zeros(())
    for part, test in zip(jnp.split(joined, ends), tests, strict=True):
        of_test, half_log_det = noise_module.gram(part, noise, test)
        products, log_sd = products + of_test, log_sd + half_log_det
    return products, log_sd


def marginal(
    products: Float[Array, "product product"],
    log_sd: Float[Array, ""],
    noise_z: Float[Array, " noise"],
    z: Float[Array, " parameter"],
) -> Float[Array, ""]:
    """Return `restricted_log_likelihood` from what `inner_products` returns."""
    corner = jnp.sum(z**2)[None]  # the prior pulls from z to zero
    pulled = products + jnp.diag(jnp.concatenate([corner, jnp.zeros(z.size)]))
    pulled = pulled.at[0, 1:].add(z).at[1:, 0].add(z)
    rest, log_det = eliminated(jnp.roll(pulled, (-1, -1), (0, 1)), z.size)
    return _restricted(rest[0, 0], log_det, log_sd, noise_z)


def _restricted(squares: Array, log_det: Array, log_sd: Array, noise_z: Array) -> Array:
    """Return it from what the parameters leave of the squares, and half their log determinant."""
    return -0.5 * squares - log_sd - log_det - 0.5 * jnp.sum(noise_z**2)


def conditional(
    tests: Sequence[Observation],
    noise_z: Float[Array, " noise"],
    z: Float[Array, " parameter"],
    residual: Float[Array, " block"],
    jacobian: Float[Array, "block parameter"],
) -> Conditional:
    """Return what the linear model says; arguments as `restricted_log_likelihood`."""
    products, log_sd = inner_products(tests, noise_z, residual, jacobian)
    precision = products[1:, 1:] + jnp.eye(jacobian.shape[1])
    gradient = products[1:, 0] + z  # of half the sum of squares, prior included
    factor = lower_factor(precision)
    half = solved_by(factor, gradient)
    squares = products[0, 0] + jnp.sum(z**2) - jnp.sum(half**2)
    log_det = jnp.sum(jnp.log(jnp.diag(factor)))
    step = solved_by(factor, half, is_transposed=True)
    return Conditional(_restricted(squares, log_det, log_sd, noise_z), z - step, factor)


def estimate_noise(
    problem: Problem,
    z: np.ndarray,
    residual: np.ndarray,
    jacobian: np.ndarray,
    *,
    longest_s: float = LARGEST[1],
    start: np.ndarray | None = None,
) -> np.ndarray:
    """Return the scores of the noise at the maximum of the restricted likelihood.

    Args:
        problem: Model and tests.
        z: As `restricted_log_likelihood`.
        residual: As `restricted_log_likelihood`.
        jacobian: As `restricted_log_likelihood`.
        longest_s: Longest correlation time that counts as noise [s].
        start: Scores to search from; several by default, for the likelihood may have two maxima.
    """
    starts = _starts(residual) if start is None else [start]
    nothing = np.zeros((_num_sensors(problem), 0))
    return _search(problem, (z, residual, jacobian), starts, longest_s, nothing)[:NUM_NOISE]


def polished_noise(
    problem: Problem, noise_z: np.ndarray, z: np.ndarray, residual: np.ndarray, jacobian: np.ndarray
) -> np.ndarray:
    """Return the maximum of the restricted likelihood near what a search has found.

    A search ends where the likelihood hardly rises any more, some thousandths of a prior standard
    deviation from its maximum and at another place after each change of the last digit. Newton's
    steps with one second derivative end at the maximum itself. Scores at a limit stay there.

    Args:
        problem: Model and tests.
        noise_z: From `estimate_noise`.
        z: As `restricted_log_likelihood`.
        residual: Likewise.
        jacobian: Likewise.

    Returns:
        The scores, or `noise_z` where the likelihood has no maximum near by.
    """
    linear = _given(problem, z, residual, jacobian)
    high, as_is = np.array(LARGEST_SCORES), np.zeros(_num_sensors(problem))
    curvature = noise_precision(problem, noise_z, z, residual, jacobian)
    at = np.array(noise_z)
    for _ in range(MOST_POLISHING):
        slope = np.asarray(_objective(at, as_is, *linear)[1][0])
        is_held = ((at >= high) & (slope < 0.0)) | ((at <= -SCORE_LIMIT) & (slope > 0.0))
        free = np.flatnonzero(~is_held)
        if not np.any(np.abs(slope[free]) > FLAT):
            return at
        block = curvature[np.ix_(free, free)]
        if np.linalg.eigvalsh(block)[0] <= 0.0:
            return np.array(noise_z)
        at[free] = np.clip(at[free] - np.linalg.solve(block, slope[free]), -SCORE_LIMIT, high[free])
        if np.max(np.abs(at - noise_z)) > NEAR:
            return np.array(noise_z)
    return at


def estimate_loggers(
    problem: Problem,
    z: np.ndarray,
    residual: np.ndarray,
    jacobian: np.ndarray,
    *,
    start: np.ndarray | None = None,
) -> dict[Logger, float]:
    """Return the noise of each logger over that of the one with the most readings [1].

    Found with the noise itself at the maximum of the restricted likelihood; empty where all tests
    were recorded alike.

    Args:
        problem: Model and tests, with the loggers to search from.
        z: As `restricted_log_likelihood`.
        residual: As `restricted_log_likelihood`.
        jacobian: As `restricted_log_likelihood`.
        start: Scores of the noise to search from; several by default, and loggers alike.
    """
    counts: dict[Logger, int] = {}
    sensors = [logger for test in problem.tests for logger in test.loggers]
    read = [int(np.sum(x)) for test in problem.tests for x in test.by_sensor(test.is_observed)]
    for logger, num in zip(sensors, read, strict=True):
        counts[logger] = counts.get(logger, 0) + num
    first, *others = sorted(counts, key=lambda logger: -counts[logger])
    if not others:
        return {}
    owns = np.array([[sensor == logger for logger in others] for sensor in sensors])
    bare = replace(problem, loggers={})
    if start is None:
        starts = [[*noise_z, *np.zeros(len(others))] for noise_z in _starts(residual)]
    else:
        known = [math.log(scale_of(problem.loggers, logger)) for logger in others]
        starts = [[*start, *np.divide(known, LOGGER_SD)]]
    found = _search(bare, (z, residual, jacobian), starts, LARGEST[1], owns.astype(float))
    scales = np.exp(LOGGER_SD * found[NUM_NOISE:])
    return {first: 1.0, **dict(zip(others, map(float, scales), strict=True))}


def _given(
    problem: Problem, z: np.ndarray, residual: np.ndarray, jacobian: np.ndarray
) -> tuple[Any, ...]:
    """Return what `restricted_log_likelihood` takes after the noise, with empty columns up to a
    multiple of `MANY`: a score that moves nothing adds nothing, and few programs do for all.
    """
    more = -z.size % MANY
    columns = np.pad(problem.lengthened(jacobian), ((0, 0), (0, more)))
    return problem.readings, np.pad(z, (0, more)), problem.lengthened(residual), columns


def _num_sensors(problem: Problem) -> int:
    """Return the number of sensors of all tests."""
    return sum(len(test.loggers) for test in problem.tests)


def _starts(residual: np.ndarray) -> list[list[float]]:
    """Return scores of noise at the level of the residuals to search from."""
    spread = float(np.std(residual)) + 1e-6
    level, white = float(NOISE[0].score(spread)), float(NOISE[2].score(spread))
    return [[level, float(NOISE[1].score(time)), white, 0.0] for time in STARTS_S]


def _search(
    problem: Problem,
    linear: tuple[np.ndarray, ...],
    starts: Sequence[Sequence[float] | np.ndarray],
    longest_s: float,
    owns: Float[np.ndarray, "sensor logger"],
) -> np.ndarray:
    """Return the scores of the noise and of the loggers at the best maximum.

    Args:
        problem: Model and tests.
        linear: Scores, residuals and Jacobian, as `restricted_log_likelihood`.
        starts: Scores to search from.
        longest_s: Longest correlation time that counts as noise [s].
        owns: Which sensor of all tests was recorded with which of the loggers whose noise is
            sought [1].
    """
    z, residual, jacobian = linear
    fixed = _given(problem, z, residual, jacobian)
    limits = [(-SCORE_LIMIT, high) for high in LARGEST_SCORES]
    limits[1] = (-SCORE_LIMIT, float(NOISE[1].score(longest_s)))
    limits += [(-SCORE_LIMIT, SCORE_LIMIT)] * owns.shape[1]

    def objective(v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        noise_z, of_loggers = v[:NUM_NOISE], v[NUM_NOISE:]
        log_scales = LOGGER_SD * owns @ of_loggers
        value, (slope, of_tests) = _objective(noise_z, log_scales, *fixed)
        own = LOGGER_SD * np.asarray(of_tests) @ owns + of_loggers
        prior = 0.5 * float(of_loggers @ of_loggers)
        return np.asarray(value) + prior, np.concatenate([slope, own])

    found = [
        minimize(
            objective,
            np.clip(start, *np.transpose(limits)),
            jac=True,
            method="L-BFGS-B",
            bounds=limits,
        )
        for start in starts
    ]
    return np.asarray(min(found, key=lambda solution: solution.fun).x)


def log_evidence(
    problem: Problem, noise_z: np.ndarray, z: np.ndarray, residual: np.ndarray, jacobian: np.ndarray
) -> float:
    """Return the log evidence of a model at a noise, up to what all models share [nat].

    Arguments as `restricted_log_likelihood`.
    """
    as_is = np.zeros(_num_sensors(problem))
    linear = _given(problem, z, residual, jacobian)
    return -float(_objective(noise_z, as_is, *linear)[0])


@compiled()
@partial(jax.value_and_grad, argnums=(0, 1))
def _objective(noise_z, log_scales, tests, z, residual, jacobian):
    """Return minus the restricted likelihood with the noise of each sensor scaled anew."""
    ends = np.cumsum([test.num_sensors for test in tests])[:-1]
    scaled = [
        eqx.tree_at(lambda t: t.noise_scale, test, test.noise_scale * jnp.exp(of_test))
        for test, of_test in zip(tests, jnp.split(log_scales, ends), strict=True)
    ]
    return -restricted_log_likelihood(scaled, noise_z, z, residual, jacobian)


def noise_precision(
    problem: Problem, noise_z: np.ndarray, z: np.ndarray, residual: np.ndarray, jacobian: np.ndarray
) -> np.ndarray:
    """Return minus the Hessian of `restricted_log_likelihood` in the noise, shape (noise, noise).

    By central differences of the gradient: four scores of order one are worth no compilation.
    """
    fixed = _given(problem, z, residual, jacobian)
    width = 1e-4  # error ~ width^2 times the third derivative, both of order one
    as_is = np.zeros(_num_sensors(problem))
    rows = []
    for direction in width * np.eye(NUM_NOISE):
        ahead = _objective(noise_z + direction, as_is, *fixed)[1][0]
        behind = _objective(noise_z - direction, as_is, *fixed)[1][0]
        rows.append((np.asarray(ahead) - np.asarray(behind)) / (2 * width))
    return np.stack(rows)


class Whitened(NamedTuple):
    """Residuals and their derivative, freed of the noise's correlation."""

    residuals: list[np.ndarray]  # Of the observed blocks of each sensor of each test [1].
    stacked: Float[np.ndarray, " block"]  # Of the blocks of all tests in a row [1].
    # Of the blocks of all tests in a row [1 per score].
    jacobian: Float[np.ndarray, "block parameter"]
    half_log_det: float  # Half the log determinant of the noise's covariance.


def whiten_fit(
    problem: Problem, noise_z: np.ndarray, residual: np.ndarray, jacobian: np.ndarray
) -> Whitened:
    """Return residuals and their derivative whitened by the noise; arguments as `spread`."""
    noise = noise_module.from_scores(np.asarray(noise_z))
    # side by side, so that one compilation serves all who need either
    parts = problem.split(np.column_stack([residual, jacobian]))
    rows, half_log_det = [], 0.0
    for part, test, padded in zip(parts, problem.tests, problem.readings, strict=True):
        white, half = noise_module.whiten(test.lengthened(part), noise, padded)
        rows.append(test.own(white))
        half_log_det += float(half)
    residuals = [
        white[seen]
        for part, test in zip(rows, problem.tests, strict=True)
        for white, seen in zip(
            test.by_sensor(part[:, 0]), test.by_sensor(test.is_observed), strict=True
        )
    ]
    joined = np.concatenate(rows)
    return Whitened(residuals, joined[:, 0], joined[:, 1:], half_log_det)


class Spread(NamedTuple):
    """How wide the posterior is around a fit."""

    # Of the scores of parameters and noise, shape (all, all).
    covariance: Float[np.ndarray, "all all"]
    # What the scatter of the readings contributes to that of the parameters, shape (parameter,
    # parameter); the rest comes from priors (type B).
    type_a: Float[np.ndarray, "parameter parameter"]
    log_evidence: float  # Marginal likelihood [nat].


def spread(
    problem: Problem,
    z: np.ndarray,
    noise_z: np.ndarray,
    residual: np.ndarray,
    jacobian: np.ndarray,
    white: Whitened,
) -> Spread:
    """Return the spread around a fit.

    Args:
        problem: Model and tests.
        z: Scores of the parameters at the fit.
        noise_z: Scores of the noise.
        residual: Residuals of all tests in a row [K].
        jacobian: Their derivative [K per score].
        white: Both whitened.

    The best estimate moves with the readings and with the centres of the priors. With J the
    whitened derivative and P the precision J'J + 1, the first contribute inv(P) J'J inv(P) to the
    covariance inv(P), the second inv(P) inv(P): an uncertainty that the tests did not lessen is
    type B, whatever it belongs to.

    References: D. J. C. MacKay, Information Theory, Inference, and Learning Algorithms, chapter
        27. JCGM 100:2008 (GUM), 4.2 and 4.3.
    """
    columns = white.jacobian
    covariance = np.linalg.inv(columns.T @ columns + np.eye(problem.num_parameters))
    # what comes of the readings, and what of the priors: the two add up to the covariance
    type_a = covariance - covariance @ covariance

    size = z.size + NUM_NOISE
    full = np.zeros((size, size))
    full[: z.size, : z.size] = covariance
    curvature = noise_precision(problem, noise_z, z, residual, jacobian)
    full[z.size :, z.size :] = _positive_inverse(curvature)
    values = np.concatenate(white.residuals)
    density = -0.5 * float(values @ values) - white.half_log_det
    density -= 0.5 * values.size * float(np.log(2 * np.pi))
    vector = np.concatenate([z, noise_z])
    prior = -0.5 * float(vector @ vector) - 0.5 * vector.size * float(np.log(2 * np.pi))
    log_det = float(np.linalg.slogdet(full)[1])
    evidence = density + prior + 0.5 * log_det + 0.5 * size * float(np.log(2 * np.pi))
    return Spread(full, type_a, evidence)


def _positive_inverse(matrix: np.ndarray) -> np.ndarray:
    """Invert a symmetric matrix; directions without curvature get the prior's variance, 1."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return (vectors / np.maximum(values, 1.0)) @ vectors.T
