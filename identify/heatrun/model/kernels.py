"""A density of the noise made of Student t kernels, and functions run over many items at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from threading import local
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp
from jaxtyping import Array, Float
from scipy.special import gammaln

from ..io.programs import compiled
from .problem import NUM_NOISE

Item = TypeVar("Item")
Rows = TypeVar("Rows")
Result = TypeVar("Result")

FEW = 4
"""Batches below which threads are not worth their start."""


HERE = local()

POOL = ThreadPoolExecutor(os.cpu_count(), initializer=partial(setattr, HERE, "is_worker", True))
"""The same threads throughout: each keeps for itself what memory it has used."""


def at_once(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return what a function gives for each item, worked out on all cores.

    Compiled code runs on one core and lets other threads run; what Python does in between is done
    by one thread at a time. What one of the threads asks for in its turn, it does itself.
    """
    if getattr(HERE, "is_worker", False):
        return [function(item) for item in items]
    return list(POOL.map(function, items))


def beside(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """Return what a function gives for a few long items, each in a thread that asks for all cores
    in its turn.
    """
    with ThreadPoolExecutor(len(items)) as pool:
        return list(pool.map(function, items))


def in_batches(function: Callable[[Rows], Any], rows: Rows, size: int) -> Any:
    """Return what a function gives for rows, as NumPy arrays.

    One size of batch means one compilation; the last batch is filled up with copies of the last
    row.

    Args:
        function: Compiled, each row for itself.
        rows: A pytree of NumPy arrays whose first axis is that of the rows, at least one; what
            `function` returns is another.
        size: Rows in a batch.
    """
    num = jax.tree.leaves(rows)[0].shape[0]

    def one(start: int) -> Any:
        picked = np.minimum(np.arange(start, start + size), num - 1)
        part = jax.tree.map(lambda array: array[picked], rows)
        return jax.tree.map(np.asarray, function(part))

    starts = range(0, num, size)
    done = [one(start) for start in starts] if len(starts) < FEW else at_once(one, starts)
    return jax.tree.map(lambda *arrays: np.concatenate(arrays)[:num], *done)


AT_A_TIME = 32
"""Noises whose density is worked out at once: times the kernels, some thousand rows."""

DEGREES_OF_FREEDOM = 5.0
"""Tails of the draws: heavier than those of the posterior, so that weights stay bounded."""

NUM_KERNELS = 256
BANDWIDTH = 0.6
"""Width of a kernel in standard deviations [1]: Silverman's rule, 0.48 for 256 points in 4
dimensions, and a quarter more, because too thin a tail costs more than a broad middle."""

GUARDING = 0.1
"""Share of the noises drawn from the prior [1], which no tail of their posterior outreaches."""

ONE_ANEW = 0.1
"""Share of the noises of which one score is drawn from the prior [1]: where the tests say nothing
of a score, such as a white part so small that it does not show, its tail is that of the prior, and
few draws of the whole prior have the other scores right."""


class Kernels(eqx.Module):
    """A density of the noise's scores as a sum of equal Student t kernels."""

    centres: Float[Any, "kernel noise"]  # Shape (kernel, noise).
    factor: Float[Any, "noise noise"]  # Lower Cholesky factor of the kernels' shape.
    whiten: Float[Any, "noise noise"]  # Its inverse.
    # Likewise of the kernels' shape without one of the scores.
    whiten_others: Float[Any, "noise other other"]

    @classmethod
    def at(cls, centres: np.ndarray, factor: np.ndarray) -> Kernels:
        """Return kernels with these centres and this factor."""
        shape = factor @ factor.T
        others = [np.delete(np.delete(shape, j, 0), j, 1) for j in range(NUM_NOISE)]
        whiten_others = np.linalg.inv(np.linalg.cholesky(np.stack(others)))
        whiten = np.linalg.inv(factor)
        return cls(*map(np.asarray, (centres, factor, whiten, whiten_others)))

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
        chance, score = rng.uniform(size=num), rng.integers(NUM_NOISE, size=num)
        is_anew = np.tile((chance < GUARDING)[:, None], NUM_NOISE)
        one = np.flatnonzero((chance >= GUARDING) & (chance < GUARDING + ONE_ANEW))
        is_anew[one, score[one]] = True
        return np.where(is_anew, rng.standard_normal(noise_z.shape), noise_z)

    def log_density(self, noise_z: Float[Array, "*draw noise"]) -> Float[Array, "*draw"]:
        """Return the log density [nat]."""
        parts = [np.log1p(-GUARDING - ONE_ANEW) + self._near(noise_z, self.centres, self.whiten)]
        for j, whiten in enumerate(self.whiten_others):
            others, centres = (jnp.delete(each, j, axis=-1) for each in (noise_z, self.centres))
            anew = self._near(others, centres, whiten) + log_prior(noise_z[..., j : j + 1])
            parts.append(np.log(ONE_ANEW / NUM_NOISE) + anew)
        parts.append(np.log(GUARDING) + log_prior(noise_z))
        return logsumexp(jnp.stack(parts), axis=0)

    def log_densities(self, noise_z: Float[np.ndarray, "draw noise"]) -> np.ndarray:
        """Return the log density of many noises [nat], compiled once for any number of them."""
        return in_batches(partial(_log_density, self), noise_z, AT_A_TIME)

    @staticmethod
    def _near(
        scores: Float[Array, "*draw score"],
        centres: Float[Array, "kernel score"],
        whiten: Float[Array, "score score"],
    ) -> Float[Array, "*draw"]:
        """Return the log density of some scores under the kernels [nat]."""
        gap = (scores @ whiten.T)[..., None, :] - centres @ whiten.T
        parts = log_student(jnp.sum(gap**2, axis=-1), scores.shape[-1])
        log_det = jnp.sum(jnp.log(jnp.diag(whiten)))
        return logsumexp(parts, axis=-1) - np.log(centres.shape[0]) + log_det


@compiled()
def _log_density(kernels: Kernels, noise_z: Float[Array, "draw noise"]) -> Float[Array, " draw"]:
    return kernels.log_density(noise_z)


def log_prior(noise_z: Float[Any, "*draw noise"]) -> Float[Any, "*draw"]:
    """Return the log density of the prior of some of the noise's scores [nat]."""
    return -0.5 * (noise_z**2).sum(axis=-1) - 0.5 * noise_z.shape[-1] * np.log(2.0 * np.pi)


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
    # eager JAX would compile a function for each operation
    log1p = np.log1p if isinstance(square, np.ndarray) else jnp.log1p
    return constant - 0.5 * (nu + size) * log1p(square / nu)
