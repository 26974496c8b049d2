"""The spread of the posterior around a fit, by its curvature (Laplace's method)."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from . import noise as noise_module
from .problem import NUM_NOISE, Problem
from .restricted import noise_precision


class Spread(NamedTuple):
    """How wide the posterior is around a fit.

    Attributes:
        covariance: Of the scores of parameters and noise, shape (all, all).
        type_a: Of the parameters with the instruments taken as exact, shape (parameter,
            parameter); rows of instruments are zero.
        log_evidence: Marginal likelihood [nat].
    """

    covariance: Float[np.ndarray, "all all"]
    type_a: Float[np.ndarray, "parameter parameter"]
    log_evidence: float


def spread(
    problem: Problem,
    z: np.ndarray,
    noise_z: np.ndarray,
    residual: np.ndarray,
    jacobian: np.ndarray,
) -> Spread:
    """Return the spread around a fit.

    Args:
        problem: Model and tests.
        z: Scores of the parameters at the fit.
        noise_z: Scores of the noise.
        residual: Residuals of all tests in a row [K].
        jacobian: Their derivative [K per score].

    Reference: D. J. C. MacKay, Information Theory, Inference, and Learning Algorithms, chapter 27.
    """
    columns = np.concatenate(whitened_rows(problem, noise_z, jacobian))
    precision = columns.T @ columns / problem.temper + np.eye(problem.num_parameters)
    covariance = np.linalg.inv(precision)

    known = np.array([s.parameter.role == "instrument" for s in problem.parameters.slots])
    type_a = np.zeros_like(covariance)
    keep = np.ix_(~known, ~known)
    type_a[keep] = np.linalg.inv(precision[keep])

    curvature = noise_precision(problem, noise_z, z, residual, jacobian)
    size = problem.num_parameters + NUM_NOISE
    full = np.zeros((size, size))
    full[: problem.num_parameters, : problem.num_parameters] = covariance
    full[problem.num_parameters :, problem.num_parameters :] = _positive_inverse(curvature)
    mode = _log_posterior(problem, z, noise_z, residual)
    log_det = float(np.linalg.slogdet(full)[1])
    return Spread(full, type_a, mode + 0.5 * log_det + 0.5 * size * float(np.log(2 * np.pi)))


def whitened_rows(problem: Problem, noise_z: np.ndarray, stacked: np.ndarray) -> list[np.ndarray]:
    """Return rows over all blocks whitened by the noise, by test."""
    noise = noise_module.from_scores(jnp.asarray(noise_z), problem.data.slow_noise)
    return [
        np.asarray(noise_module.whiten(jnp.asarray(part), noise, test)[0])
        for part, test in zip(problem.split(stacked), problem.data.tests, strict=True)
    ]


def _log_posterior(
    problem: Problem, z: np.ndarray, noise_z: np.ndarray, residual: np.ndarray
) -> float:
    """Return the log posterior from residuals that are already there."""
    noise = noise_module.from_scores(jnp.asarray(noise_z), problem.data.slow_noise)
    density = sum(
        float(noise_module.log_density(jnp.asarray(part), noise, test))
        for part, test in zip(problem.split(residual), problem.data.tests, strict=True)
    )
    vector = np.concatenate([z, noise_z])
    prior = -0.5 * float(vector @ vector) - 0.5 * vector.size * float(np.log(2 * np.pi))
    return density / problem.temper + prior


def _positive_inverse(matrix: np.ndarray) -> np.ndarray:
    """Invert a symmetric matrix; directions without curvature get the prior's variance, 1."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return (vectors / np.maximum(values, 1.0)) @ vectors.T
