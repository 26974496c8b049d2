r"""The noise of block means: a slow Ornstein-Uhlenbeck part, a white part, and rounding.

Residuals of a bench record are not independent: 54,000 samples whose error drifts over two
minutes are worth about twenty. The density of the block means is that of

$$ e_j = o_j + w_j, \quad o_{j+1} = \phi\, o_j + \sqrt{1-\phi^2}\,\sigma\,\xi_j, \quad
   \phi = e^{-\Delta/\tau} $$

evaluated in one Kalman pass, which also whitens residuals for least squares.
"""

from __future__ import annotations

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .bench.blocks import BLOCK_S, Observation
from .parameters import Parameter

NOISE = (
    Parameter("noise_sd", "K", "slow part of the noise", "noise", "log", 0.2, 1.2,
              "thermocouple pick-up, cooling air and rounding of a slow course: 0.02...2 K"),
    Parameter("noise_time", "s", "correlation time of the slow part", "noise", "log", 40.0, 1.0,
              "between a block and ten minutes"),
    Parameter("noise_white", "K", "white part of the noise of a 20 s mean", "noise", "log", 0.05,
              1.5, "0.003...1 K, more where the network misfits"),
)  # fmt: skip
"""The three parameters of the noise, with priors that only exclude the absurd."""


class Noise(eqx.Module):
    """Noise of the block means.

    Attributes:
        sd: Standard deviation of the slow part [K].
        time: Its correlation time [s].
        white: Standard deviation of the white part of a 20 s mean [K].
    """

    sd: Float[Array, ""]
    time: Float[Array, ""]
    white: Float[Array, ""]

    def total(self) -> Float[Array, ""]:
        """Return the standard deviation of a 20 s mean [K]."""
        return jnp.sqrt(self.sd**2 + self.white**2)


def from_scores(z: Float[Array, " 3"], slow: Float[Array, ""] | float = 1.0) -> Noise:
    """Return the noise for standard scores of `NOISE`.

    Args:
        z: Scores.
        slow: Factor on the slow part: 1, or 0 for noise that counts as white.
    """
    sd, time, white = (parameter.value(z[i]) for i, parameter in enumerate(NOISE))
    return Noise(slow * sd, time, white)


@jax.jit
def whiten(
    residual: Float[Array, "block ..."], noise: Noise, blocks: Observation
) -> tuple[Float[Array, "block ..."], Float[Array, ""]]:
    """Return whitened residuals and half the log determinant of their covariance.

    Args:
        residual: Measured minus modelled block means [K], shape (block,) or (block, column):
            every column is filtered alike, so a Jacobian may be passed. Blocks without a reading
            come out as zero.
        noise: The noise.
        blocks: Which blocks hold a reading, their length and the variance from rounding.

    Reference: J. Durbin, S. J. Koopman, Time Series Analysis by State Space Methods, 2nd ed.,
        section 4.3 (innovations).
    """
    phi = jnp.exp(-blocks.block_s / noise.time)
    slow = noise.sd**2
    white = noise.white**2 * (BLOCK_S / blocks.block_s)

    def advance(state, x):
        mean, variance = state
        value, is_observed, rounding = x
        total = variance + white + rounding
        innovation = jnp.where(is_observed, value - mean, 0.0)
        gain = jnp.where(is_observed, variance / total, 0.0)
        mean = phi * (mean + gain * innovation)
        variance = phi**2 * variance * (1.0 - gain) + (1.0 - phi**2) * slow
        log_sd = jnp.where(is_observed, 0.5 * jnp.log(total), 0.0)
        return (mean, variance), (innovation / jnp.sqrt(total), log_sd)

    filled = jnp.where(_align(blocks.is_observed, residual), residual, 0.0)
    start = (jnp.zeros(residual.shape[1:]), slow)
    _, (whitened, log_sd) = jax.lax.scan(
        advance, start, (filled, blocks.is_observed, blocks.rounding_variance)
    )
    return whitened, jnp.sum(log_sd)


@jax.jit
def log_density(
    residual: Float[Array, " block"], noise: Noise, blocks: Observation
) -> Float[Array, ""]:
    """Return the log density of the residuals of one test [nat]. Arguments as `whiten`."""
    whitened, half_log_det = whiten(residual, noise, blocks)
    count = jnp.sum(blocks.is_observed)
    return -0.5 * jnp.sum(whitened**2) - half_log_det - 0.5 * count * math.log(2 * math.pi)


def draw(
    key: Array, noise: Noise, blocks: Observation, shape: tuple[int, ...] = ()
) -> Float[Array, "... block"]:
    """Return noise drawn for the blocks of a test [K], shape (*shape, block)."""
    num = blocks.is_observed.shape[0]
    first, second = jax.random.split(key)
    shocks = jax.random.normal(first, (num, *shape))
    white_sd = jnp.sqrt(noise.white**2 * (BLOCK_S / blocks.block_s) + blocks.rounding_variance)
    phi = jnp.exp(-blocks.block_s / noise.time)

    def advance(slow, shock):
        after = phi * slow + jnp.sqrt(1.0 - phi**2) * noise.sd * shock
        return after, after

    _, slow = jax.lax.scan(advance, noise.sd * shocks[0], shocks[1:])
    slow = jnp.concatenate([noise.sd * shocks[:1], slow])
    white = white_sd[:, None] * jax.random.normal(second, (num, math.prod(shape)))
    total = slow.reshape(num, -1) + white
    return jnp.moveaxis(total.reshape(num, *shape), 0, -1)


def _align(mask: Array, values: Array) -> Array:
    return mask.reshape(mask.shape + (1,) * (values.ndim - 1))
