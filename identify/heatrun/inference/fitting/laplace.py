"""The spread of the posterior around a fit, by its curvature (Laplace's method)."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .. import noise as noise_module
from ..problem import NUM_NOISE, Problem
from .restricted import noise_precision


class Spread(NamedTuple):
    """How wide the posterior is around a fit.

    Attributes:
        covariance: Of the scores of parameters and noise, shape (all, all).
        type_a: What the scatter of the readings contributes to that of the parameters, shape
            (parameter, parameter); the rest comes from priors (type B).
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

    The best estimate moves with the readings and with the centres of the priors. With J the
    whitened derivative and P the precision J'J + 1, the first contribute inv(P) J'J inv(P) to the
    covariance inv(P), the second inv(P) inv(P): an uncertainty that the tests did not lessen is
    type B, whatever it belongs to.

    References: D. J. C. MacKay, Information Theory, Inference, and Learning Algorithms, chapter
        27. JCGM 100:2008 (GUM), 4.2 and 4.3.
    """
    white = whiten_fit(problem, noise_z, residual, jacobian)
    columns = white.jacobian
    precision = columns.T @ columns + np.eye(problem.num_parameters)
    curvature = noise_precision(problem, noise_z, z, residual, jacobian)
    values = np.concatenate(white.residuals)
    return laplace(
        z, noise_z, np.linalg.inv(precision), curvature, float(values @ values),
        white.half_log_det, values.size,
    )  # fmt: skip


def laplace(
    z: np.ndarray,
    noise_z: np.ndarray,
    covariance: Float[np.ndarray, "parameter parameter"],
    curvature: Float[np.ndarray, "noise noise"],
    squares: float,
    half_log_det: float,
    num_read: int,
) -> Spread:
    """Return the spread around a fit from what its residuals say.

    Args:
        z: Scores of the parameters.
        noise_z: Scores of the noise.
        covariance: Of the scores of the parameters, given the noise.
        curvature: From `restricted.noise_precision`.
        squares: Sum of the squared whitened residuals [1].
        half_log_det: Half the log determinant of the covariance of noise and heat.
        num_read: Blocks with a reading.
    """
    # what comes of the readings, and what of the priors: the two add up to the covariance
    type_a = covariance - covariance @ covariance

    size = z.size + NUM_NOISE
    full = np.zeros((size, size))
    full[: z.size, : z.size] = covariance
    full[z.size :, z.size :] = _positive_inverse(curvature)
    density = -0.5 * squares - half_log_det - 0.5 * num_read * float(np.log(2 * np.pi))
    vector = np.concatenate([z, noise_z])
    prior = -0.5 * float(vector @ vector) - 0.5 * vector.size * float(np.log(2 * np.pi))
    log_det = float(np.linalg.slogdet(full)[1])
    evidence = density + prior + 0.5 * log_det + 0.5 * size * float(np.log(2 * np.pi))
    return Spread(full, type_a, evidence)


class Whitened(NamedTuple):
    """Residuals and their derivative, freed of the noise's correlation.

    Attributes:
        residuals: Of the observed blocks of each sensor of each test [1].
        stacked: Of the blocks of all tests in a row [1].
        jacobian: Of the blocks of all tests in a row [1 per score].
        half_log_det: Half the log determinant of the noise's covariance.
    """

    residuals: list[np.ndarray]
    stacked: Float[np.ndarray, " block"]
    jacobian: Float[np.ndarray, "block parameter"]
    half_log_det: float


def whiten_fit(
    problem: Problem, noise_z: np.ndarray, residual: np.ndarray, jacobian: np.ndarray
) -> Whitened:
    """Return residuals and their derivative whitened by the noise; arguments as `spread`."""
    noise = noise_module.from_scores(np.asarray(noise_z))
    # side by side, so that one compilation serves all who need either
    parts = problem.split(np.column_stack([residual, jacobian]))
    rows, half_log_det = [], 0.0
    for part, test in zip(parts, problem.data.tests, strict=True):
        white, half = noise_module.whiten(jnp.asarray(part), noise, test)
        rows.append(np.asarray(white))
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


def _positive_inverse(matrix: np.ndarray) -> np.ndarray:
    """Invert a symmetric matrix; directions without curvature get the prior's variance, 1."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return (vectors / np.maximum(values, 1.0)) @ vectors.T
