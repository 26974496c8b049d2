"""What a population says of its machines: drawn towards it, and which do not fit it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .law import OUTLIER_SCALE, Law, given_machine, log_marginals
from .sampling import Data, Population

NUM_LAWS = 400
"""Draws of the law that the machines are averaged over."""


@dataclass(frozen=True)
class Machines:
    """The machines of a population, given all of them.

    Attributes:
        mean: Of each machine's parameters, shape (machine, parameter).
        covariance: Shape (machine, parameter, parameter).
        outlier: Probability that the machine is none of the population, shape (machine,) [1].
        distance: How far its parameters are from what is expected of it, in standard deviations
            over machines, with what is left open added to them, shape (machine, parameter) [1].
    """

    mean: Float[np.ndarray, "machine parameter"]
    covariance: Float[np.ndarray, "machine parameter parameter"]
    outlier: Float[np.ndarray, " machine"]
    distance: Float[np.ndarray, "machine parameter"]


def given_population(population: Population) -> Machines:
    """Return what is known of each machine once all are."""
    evidence = population.evidence
    laws = Law(*(each[:: max(1, each.shape[0] // NUM_LAWS)] for each in population.laws))
    data = Data.of(evidence, population.design)
    found = _under_each(data, population.hyper.has_outliers, laws)
    mean, second, outlier, centre = (
        np.asarray(part).mean(axis=0)[: evidence.num_machines] for part in found
    )
    covariance = second - np.einsum("mi,mj->mij", mean, mean)
    spread = np.asarray(jnp.mean(laws.sd**2, axis=0))
    own = np.einsum("mii->mi", _alone(population))
    distance = (_best(population, centre) - centre) / np.sqrt(spread + own)
    return Machines(mean, covariance, outlier, distance)


@eqx.filter_jit
def _under_each(data: Data, has_outliers: bool, laws: Law) -> tuple[Array, ...]:
    return jax.lax.map(partial(_under, *data, has_outliers=has_outliers), laws)


def _under(design, information, precision, law, *, has_outliers):
    """Return first and second moments, probability of an outlier, and centre, under one law."""
    usual, other = log_marginals(law, design, information, precision, has_outliers=has_outliers)
    outlier = jax.nn.sigmoid(other - usual) if has_outliers else jnp.zeros_like(usual)
    centre = law.mean + design @ law.effects
    mean, second = jnp.zeros_like(centre), jnp.zeros(precision.shape)
    for share, factor in ((1.0 - outlier, law.factor), (outlier, OUTLIER_SCALE * law.factor)):
        at, root = jax.vmap(lambda c, h, L, f=factor: given_machine(c, f, h, L))(
            centre, information, precision
        )
        mean += share[:, None] * at
        moment = root @ jnp.swapaxes(root, -1, -2) + at[:, :, None] * at[:, None, :]
        second += share[:, None, None] * moment
    return mean, second, outlier, centre


def _alone(population: Population) -> np.ndarray:
    """Return what each machine's tests leave open, with no more of a prior than ten spreads."""
    return np.linalg.inv(population.evidence.precision + _loose(population))


def _best(population: Population, centre: np.ndarray) -> np.ndarray:
    """Return what each machine's tests say alone, likewise."""
    loose = _loose(population)
    pulled = population.evidence.information + np.einsum("ij,mj->mi", loose, centre)
    return np.linalg.solve(population.evidence.precision + loose, pulled[..., None])[..., 0]


def _loose(population: Population) -> np.ndarray:
    spread = np.asarray(jnp.mean(population.laws.sd**2, axis=0))
    return np.diag(1.0 / (100.0 * spread))
