r"""The noise of block means: a slow Ornstein-Uhlenbeck part, a white part, rounding, and heat.

Residuals of a bench record are not independent: 54,000 samples whose error drifts over two
minutes are worth about twenty. With $o$ the slow part at the edges of blocks of length $\Delta$,
the density of the block means $e_j$ is that of

$$ e_j = A\, o_j + \eta_j + w_j, \quad o_{j+1} = \phi\, o_j + \xi_j, \quad
   \phi = e^{-\Delta/\tau} $$

evaluated in one Kalman pass, which also whitens residuals for least squares. A mean over a block
is smoother than a reading: $A$, the variance of $\eta$ and its covariance with $\xi$ are those of
the mean of as many readings, evenly spaced, as the block holds.

To these joins what the network misses: unmodelled heat (`discrepancy`), whose responses are columns
$H$ of a low rank, taken out exactly at a cost that is linear in the number of blocks.

Unlike loggers are not of one noise: that of each is told over the one of the first (`Loggers`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, Bool, Float

from ..io.programs import compiled
from ..record.blocks import Blocks, Logger
from ..record.motor import HEAT_LIMITS, Adequacy
from ..record.observation import Observation
from ..record.samples import BLOCK_S
from .parameters import Parameter

NOISE = (
    Parameter("noise_sd", "K", "slow part of the noise", "noise", "log", 0.2, 1.2,
              "thermocouple pick-up, cooling air and rounding of a slow course: 0.02...2 K"),
    Parameter("noise_time", "s", "correlation time of the slow part", "noise", "log", 40.0, 1.0,
              "between a block and ten minutes"),
    Parameter("noise_white", "K", "white part of the noise of a 20 s mean", "noise", "log", 0.05,
              1.5, "0.003...1 K, more where the network misfits"),
    Parameter("unmodelled_heat", "1", "heat that the network misses, sd over the mean loss",
              "noise", "log", 0.0015, 1.2,
              "a network of a few nodes tells the heat flows to 0.01...1.6 % of the loss"),
)  # fmt: skip
"""The parameters of the noise and of what the network misses, with priors that only exclude the
absurd."""

HEAT = NOISE[3]

FACTORS = 8
"""Variances of which one logarithm is taken: their product lies far from the limits of a double."""


def noise_parameters(adequacy: Adequacy) -> tuple[Parameter, ...]:
    """Return `NOISE` with the prior of the heat that the motor file gives.

    The noise is computed with `NOISE`; where the prior is another, the columns of the heat are
    larger or smaller by as much (`discrepancy`).
    """
    return (*NOISE[:3], replace(HEAT, centre=adequacy.unmodelled_heat))


LARGEST = (20.0, 160.0, 20.0, HEAT_LIMITS[1])
"""Largest values of `NOISE` [K, s, K, 1]; the prior ends there. Without an end, a network that is
far off would have all its error booked as noise over half an hour or as heat of half the loss, and
its parameters would be left to their priors."""

LARGEST_SCORES = tuple(float(p.score(v)) for p, v in zip(NOISE, LARGEST, strict=True))


MANY = 200.0
"""Readings of a 20 s block at 10 Hz; the noise of a mean hardly depends on their number [1]."""


class _SlowMeans(NamedTuple):
    """The mean of a slow part of variance 1 over blocks."""

    gain: Float[Array, "..."]  # Its share of the slow part at the first edge of the block [1].
    variance: Float[Array, "..."]  # Its variance [1].


def _slow_means(decay: Float[Array, "..."], count: Float[Array, "..."]) -> _SlowMeans:
    """Return the mean of `count` readings in the middles of as many equal parts of a block.

    Args:
        decay: Length of the block over the correlation time [1].
        count: Readings in the block, 1 or more [1].
    """
    part = decay / count
    lost_in_part, lost = -jnp.expm1(-part), -jnp.expm1(-decay)
    spaced = count * lost_in_part
    gain = jnp.exp(-0.5 * part) * lost / spaced
    variance = (2.0 - lost_in_part) / spaced - 2.0 * (1.0 - lost_in_part) * lost / spaced**2
    return _SlowMeans(gain, variance)


class Noise(eqx.Module):
    """Noise of the block means."""

    sd: Float[Any, ""]  # Standard deviation of the slow part of a reading [K].
    time: Float[Any, ""]  # Its correlation time [s].
    white: Float[Any, ""]  # Standard deviation of the white part of a 20 s mean [K].
    heat: Float[Any, ""]  # Standard deviation of the unmodelled heat over the mean loss [1].

    def scaled(self, factor: Float[Any, "..."]) -> Noise:
        """Return the noise of a logger that is noisier by a factor [1], over the same time."""
        return Noise(self.sd * factor, self.time, self.white * factor, self.heat)

    @compiled()
    def total(self) -> Float[Array, ""]:
        """Return the standard deviation of a 20 s mean of many readings [K]."""
        slow = self.sd**2 * _slow_means(BLOCK_S / self.time, jnp.asarray(MANY)).variance
        return jnp.sqrt(slow + self.white**2)


def from_scores(z: Float[Any, "4 ..."]) -> Noise:
    """Return the noise for standard scores of `NOISE`."""
    return Noise(*(parameter.value(z[i]) for i, parameter in enumerate(NOISE)))


@compiled(is_seldom=True)
def whiten(
    residual: Float[Array, "block ..."], noise: Noise, blocks: Observation
) -> tuple[Float[Array, "block ..."], Float[Array, ""]]:
    """Return whitened residuals and half the log determinant of their covariance.

    Args:
        residual: Measured minus modelled block means [K], shape (block,) or (block, column):
            every column is filtered alike, so a Jacobian may be passed. Blocks without a reading
            come out as zero.
        noise: The noise.
        blocks: Which blocks hold a reading, their length, the variance from rounding, and what
            heat does to them.

    Reference: J. Durbin, S. J. Koopman, Time Series Analysis by State Space Methods, 2nd ed.,
        section 4.3 (innovations).
    """
    columns = _columns(noise, blocks)
    num = columns.shape[1]
    if not num:
        return _filter(residual, noise, blocks)
    beside = jnp.concatenate([columns, residual.reshape(residual.shape[0], -1)], axis=1)
    rows, half_log_det = _filter(beside, noise, blocks)
    freed, more = free_of_columns(rows, num)
    return freed.reshape(residual.shape), half_log_det + more


def _columns(noise: Noise, blocks: Observation) -> Float[Array, "block column"]:
    """Return the responses to heat, and to load steps at unknown moments [K]."""
    return jnp.concatenate([noise.heat * blocks.heat, blocks.moments], axis=1)


class SensorRows(eqx.Module):
    """What the noise needs to know of the blocks of one sensor, as `Observation` has it."""

    is_observed: Bool[Array, "..."]
    count: Float[Array, "..."]
    known_variance: Float[Array, "..."]
    block_s: Float[Array, "..."]
    noise_scale: Float[Array, "..."]


def _by_sensor(blocks: Observation) -> SensorRows:
    """Return the rows of each sensor, shape (sensor, block) each."""
    size = blocks.num_sensors

    def split(rows: Array) -> Array:
        return rows.reshape(size, -1)

    return SensorRows(
        split(blocks.is_observed),
        split(blocks.count),
        split(blocks.known_variance),
        jnp.broadcast_to(blocks.block_s, (size,)),
        blocks.noise_scale,
    )


def _filter(
    rows: Float[Array, "row ..."], noise: Noise, blocks: Observation
) -> tuple[Float[Array, "row ..."], Float[Array, ""]]:
    """Return rows whitened by the noise without heat, and half its log determinant.

    The noise of one sensor knows nothing of another's.
    """
    sensors = _by_sensor(blocks)
    if blocks.num_sensors == 1:
        return filter_rows(rows, noise, jax.tree.map(lambda values: values[0], sensors))
    split = rows.reshape(blocks.num_sensors, -1, *rows.shape[1:])
    whitened, log_sd = jax.vmap(filter_rows, (0, None, 0))(split, noise, sensors)
    return whitened.reshape(rows.shape), jnp.sum(log_sd)


def filter_rows(
    rows: Float[Array, "block ..."], noise: Noise, blocks: SensorRows
) -> tuple[Float[Array, "block ..."], Float[Array, ""]]:
    """Return rows of one sensor whitened by the noise without heat, and half its log determinant.

    Args:
        rows: Residuals, or columns beside each other that are filtered alike.
        noise: The noise.
        blocks: What it needs to know of the blocks.
    """
    noise = noise.scaled(blocks.noise_scale)
    slow = noise.sd**2
    decay = blocks.block_s / noise.time
    phi, gains, own = _of_blocks(noise, blocks)
    shared = slow * gains * -jnp.expm1(-decay)
    fresh = slow * -jnp.expm1(-2.0 * decay)
    apart = own + noise.white**2 * (BLOCK_S / blocks.block_s) + blocks.known_variance

    def advance(state, x):
        mean, variance = state
        value, is_observed, gain, apart, shared = x
        total = gain**2 * variance + apart
        innovation = jnp.where(is_observed, value - gain * mean, 0.0)
        weight = jnp.where(is_observed, (phi * gain * variance + shared) / total, 0.0)
        mean = phi * mean + weight * innovation
        variance = phi**2 * variance + fresh - weight**2 * total
        return (mean, variance), (innovation, jnp.where(is_observed, total, 1.0))

    filled = jnp.where(_align(blocks.is_observed, rows), rows, 0.0)
    start = (jnp.zeros(rows.shape[1:]), slow)
    _, (innovation, total) = jax.lax.scan(
        advance, start, (filled, blocks.is_observed, gains, apart, shared)
    )
    return innovation * _align(jax.lax.rsqrt(total), innovation), 0.5 * _sum_of_logs(total)


def _sum_of_logs(values: Float[Array, " block"]) -> Float[Array, ""]:
    """Return the sum of logarithms, of which one is taken for `FACTORS` values."""
    filled = jnp.concatenate([values, jnp.ones(-values.shape[0] % FACTORS)])
    return jnp.sum(jnp.log(jnp.prod(filled.reshape(-1, FACTORS), axis=1)))


def free_of_columns(
    rows: Float[Array, "block column"], num: int
) -> tuple[Float[Array, "block other"], Float[Array, ""]]:
    """Return rows whitened by 1 + W W' for the first columns W, and half its log determinant.

    With C C' = 1 + W'W, the root of the inverse is 1 - W inv(1 + C') inv(C) W'.

    Args:
        rows: White but for those columns; they come first.
        num: Number of those columns.
    """
    W, other = rows[:, :num], rows[:, num:]
    factor = jnp.linalg.cholesky(jnp.eye(num) + W.T @ W)
    half = solve_triangular(factor, W.T @ other, lower=True)
    share = solve_triangular(factor.T + jnp.eye(num), half, lower=False)
    return other - W @ share, jnp.sum(jnp.log(jnp.diag(factor)))


@compiled()
def gram(
    columns: Float[Array, "block column"], noise: Noise, blocks: Observation
) -> tuple[Float[Array, "column column"], Float[Array, ""]]:
    """Return the inner products of whitened columns, and half the log determinant.

    As those of `whiten`, at less cost. Arguments as there.
    """
    own = _columns(noise, blocks)
    rows, half_log_det = _filter(jnp.concatenate([own, columns], axis=1), noise, blocks)
    rest, more = eliminated(rows.T @ rows, own.shape[1])
    return rest, half_log_det + more


@compiled()
def log_density(
    residual: Float[Array, " block"], noise: Noise, blocks: Observation
) -> Float[Array, ""]:
    """Return the log density of the residuals of one test [nat]. Arguments as `whiten`."""
    squares, half_log_det = gram(residual[:, None], noise, blocks)
    count = jnp.sum(blocks.is_observed)
    return -0.5 * squares[0, 0] - half_log_det - 0.5 * count * math.log(2 * math.pi)


def eliminated(
    products: Float[Array, "column column"], num: int
) -> tuple[Float[Array, "other other"], Float[Array, ""]]:
    """Return O'O - O'W inv(1 + W'W) W'O, and half the log determinant of 1 + W'W.

    Column by column, without a factorisation: draws come in batches, and XLA shares a batch of
    factorisations among the threads of its pool, where two of them wait for each other.

    Args:
        products: Inner products of the columns W and others O.
        num: Number of columns of W; they come first.
    """

    def take(place, carry):
        rest, half_log_det = carry
        row = rest[place]
        pivot = row[place]
        return rest - jnp.outer(row, row / pivot), half_log_det + 0.5 * jnp.log(pivot)

    ones = jnp.arange(products.shape[0]) < num
    start = products + jnp.diag(ones.astype(float)), jnp.zeros(())
    rest, half_log_det = jax.lax.fori_loop(0, num, take, start)
    return rest[num:, num:], half_log_det


def lower_factor(matrix: Float[Array, "row row"]) -> Float[Array, "row row"]:
    """Return the lower Cholesky factor of a matrix, column by column as `eliminated`.

    Args:
        matrix: Symmetric and positive definite.
    """
    rows = jnp.arange(matrix.shape[0])

    def take(place, carry):
        rest, factor = carry
        column = jnp.where(rows >= place, rest[:, place] * jax.lax.rsqrt(rest[place, place]), 0.0)
        return rest - jnp.outer(column, column), factor.at[:, place].set(column)

    start = matrix, jnp.zeros_like(matrix)
    return jax.lax.fori_loop(0, matrix.shape[0], take, start)[1]


def solved_by(
    factor: Float[Array, "row row"], right: Float[Array, " row"], *, is_transposed: bool = False
) -> Float[Array, " row"]:
    """Return inv(L) b for a lower factor L, or inv(L') b, column by column likewise."""
    num = factor.shape[0]
    columns = factor.T if is_transposed else factor

    def take(step, carry):
        rest, solution = carry
        place = num - 1 - step if is_transposed else step
        value = rest[place] / columns[place, place]
        return rest - columns[:, place] * value, solution.at[place].set(value)

    return jax.lax.fori_loop(0, num, take, (right, jnp.zeros_like(right)))[1]


def draw(
    key: Array, noise: Noise, blocks: Observation, shape: tuple[int, ...] = ()
) -> Float[Array, "... block"]:
    """Return noise and unmodelled heat drawn for a test [K], shape (*shape, row)."""
    of_sensors, of_heat = jax.random.split(key)
    sensors = _by_sensor(blocks)
    parts = [
        _draw_one(each, noise, jax.tree.map(lambda values, i=i: values[i], sensors), shape)
        for i, each in enumerate(jax.random.split(of_sensors, blocks.num_sensors))
    ]
    columns = _columns(noise, blocks)
    normal = jax.random.normal(of_heat, (columns.shape[1], math.prod(shape)))
    total = jnp.concatenate(parts) + columns @ normal
    return jnp.moveaxis(total.reshape(-1, *shape), 0, -1)


def _draw_one(
    key: Array, noise: Noise, blocks: SensorRows, shape: tuple[int, ...]
) -> Float[Array, "block draw"]:
    """Return the noise of one sensor [K]."""
    noise = noise.scaled(blocks.noise_scale)
    num = blocks.is_observed.shape[0]
    first, second = jax.random.split(key)
    shocks = jax.random.normal(first, (num + 1, *shape))
    phi, gain, own = _of_blocks(noise, blocks)

    def advance(slow, shock):
        after = phi * slow + jnp.sqrt(1.0 - phi**2) * noise.sd * shock
        return after, after

    _, slow = jax.lax.scan(advance, noise.sd * shocks[0], shocks[1:])
    edges = jnp.concatenate([noise.sd * shocks[:1], slow]).reshape(num + 1, -1)
    # given both edges of its block, a mean depends on nothing else
    share = gain / (1.0 + phi)
    between = own - (noise.sd * gain) ** 2 * (1.0 - phi) / (1.0 + phi)
    apart = between + noise.white**2 * (BLOCK_S / blocks.block_s) + blocks.known_variance
    rest = jax.random.normal(second, (num, math.prod(shape)))
    return share[:, None] * (edges[1:] + edges[:-1]) + jnp.sqrt(apart)[:, None] * rest


def variance_of_mean(noise: Noise, block_s: float, num: int) -> float:
    """Return the variance of the mean of blocks of many readings in a row [K^2].

    Args:
        noise: The noise.
        block_s: Length of a block [s].
        num: Number of blocks.
    """
    decay = jnp.asarray(num * block_s) / noise.time
    slow = noise.sd**2 * _slow_means(decay, jnp.asarray(num * MANY)).variance
    return float(slow + noise.white**2 * (BLOCK_S / (num * block_s)))


def _of_blocks(
    noise: Noise, blocks: SensorRows
) -> tuple[Float[Array, ""], Float[Array, " block"], Float[Array, " block"]]:
    """Return the decay over a block, the gain of each, and the variance beside that [1, 1, K^2]."""
    decay = blocks.block_s / noise.time
    gain, variance = _slow_means(decay, jnp.maximum(blocks.count, 1.0))
    return jnp.exp(-decay), gain, noise.sd**2 * (variance - gain**2)


def _align(mask: Array, values: Array) -> Array:
    return mask.reshape(mask.shape + (1,) * (values.ndim - 1))


Loggers = Mapping[Logger, float]
"""Noise of each logger over that of the first one [1]; empty where all tests share one noise."""


def scale_of(loggers: Loggers, logger: Logger) -> float:
    """Return the noise of a logger over that of the first one [1].

    One that the fit does not know is taken to be as noisy as the noisiest.
    """
    return loggers.get(logger, max(loggers.values(), default=1.0))


def scales_of(loggers: Loggers, test: Blocks) -> list[float]:
    """Return the noise of each sensor of a test over that of the first logger [1]."""
    return [scale_of(loggers, logger) for logger in test.loggers]
