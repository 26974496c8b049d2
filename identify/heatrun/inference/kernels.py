"""A density of the noise made of Student t kernels, and Student t draws."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp
from jaxtyping import Array, Float
from scipy.special import gammaln

from .problem import NUM_NOISE

DEGREES_OF_FREEDOM = 5.0
"""Tails of the draws: heavier than those of the posterior, so that weights stay bounded."""

NUM_KERNELS = 256
BANDWIDTH = 0.6
"""Width of a kernel in standard deviations [1]: Silverman's rule, 0.48 for 256 points in 4
dimensions, and a quarter more, because too thin a tail costs more than a broad middle."""

GUARDING = 0.1
"""Share of the noises drawn from the prior [1], which no tail of their posterior outreaches."""


class Kernels(eqx.Module):
    """A density of the noise's scores as a sum of equal Student t kernels.

    Attributes:
        centres: Shape (kernel, noise).
        factor: Lower Cholesky factor of the kernels' shape.
        whiten: Its inverse.
    """

    centres: Float[Array, "kernel noise"]
    factor: Float[Array, "noise noise"]
    whiten: Float[Array, "noise noise"]

    @classmethod
    def at(cls, centres: np.ndarray, factor: np.ndarray) -> Kernels:
        """Return kernels with these centres and this factor."""
        return cls(*map(jnp.asarray, (centres, factor, np.linalg.inv(factor))))

    @classmethod
    def over(cls, noise_z: np.ndarray, weights: np.ndarray, rng: np.random.Generator) -> Kernels:
        """Return kernels over importance samples."""
        shift = noise_z - weights @ noise_z
        shape = (shift * weights[:, None]).T @ shift + 1e-4 * np.eye(NUM_NOISE)
        picked = rng.choice(weights.size, size=NUM_KERNELS, p=weights)
        return cls.at(noise_z[picked], BANDWIDTH * np.linalg.cholesky(shape))

    def draw(self, num: int, rng: np.random.Generator) -> np.ndarray:
        """Return draws, shape (num, noise)."""
        which = rng.integers(len(self.centres), size=num)
        gap = student(num, NUM_NOISE, rng) @ np.asarray(self.factor).T
        noise_z = np.asarray(self.centres)[which] + gap
        is_prior = rng.uniform(size=num) < GUARDING
        noise_z[is_prior] = rng.standard_normal((int(np.sum(is_prior)), NUM_NOISE))
        return noise_z

    def log_density(self, noise_z: Float[Array, "*draw noise"]) -> Float[Array, "*draw"]:
        """Return the log density [nat]."""
        gap = (noise_z @ self.whiten.T)[..., None, :] - self.centres @ self.whiten.T
        parts = log_student(jnp.sum(gap**2, axis=-1), NUM_NOISE)
        log_det = jnp.sum(jnp.log(jnp.diag(self.factor)))
        near = logsumexp(parts, axis=-1) - np.log(self.centres.shape[0]) - log_det
        return jnp.logaddexp(np.log1p(-GUARDING) + near, np.log(GUARDING) + log_prior(noise_z))


def log_prior(noise_z: Float[Any, "*draw noise"]) -> Float[Any, "*draw"]:
    """Return the log density of the prior of the noise's scores [nat]."""
    return -0.5 * (noise_z**2).sum(axis=-1) - 0.5 * NUM_NOISE * np.log(2.0 * np.pi)


def student(
    num: int, size: int, rng: np.random.Generator, freedom: float = DEGREES_OF_FREEDOM
) -> np.ndarray:
    """Return draws of a standard Student t distribution, shape (num, size)."""
    scale = np.sqrt(freedom / rng.chisquare(freedom, num))
    return rng.standard_normal((num, size)) * scale[:, None]


def log_student(
    square: Float[Any, "*draw"], size: int, freedom: float = DEGREES_OF_FREEDOM
) -> Float[Array, "*draw"]:
    """Return their log density [nat] for squared distances from the centre."""
    nu = freedom
    constant = gammaln((nu + size) / 2) - gammaln(nu / 2) - 0.5 * size * np.log(nu * np.pi)
    return constant - 0.5 * (nu + size) * jnp.log1p(square / nu)
