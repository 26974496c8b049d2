r"""Each stretch of the readings predicted from all the others, for cross-validation of draws.

Block means share their noise, so the density of the readings is no product over them, and what
one block would be worth if it were left out is hardly more than an interpolation of its
neighbours' noise. Left out here are windows of some minutes. For the readings y of a test and a
draw theta,

$$ p(y_W \mid y_{-W}, \theta) = \frac{p(y \mid \theta)}{p(y_{-W} \mid \theta)} $$

where the denominator is the density of the test with the blocks of the window taken as not read:
exact for any noise that can be filtered with gaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from . import noise as noise_module
from .batches import in_batches
from .problem import Data, Problem, Structure, residuals

NUM_WINDOWS = 24
"""Windows of all tests together, of 4 min for a test of 90 min: enough for a standard error over
them, and long against the time in which the noise of a bench is forgotten."""

BATCH = 2
"""Draws that are worked out at once, each with all its windows: more of them fall out of the
cache."""


@dataclass(frozen=True)
class Windows:
    """Stretches of the tests.

    Attributes:
        test: Index of the test of each window.
        from_s: Mean time of its first block [s].
        to_s: Mean time of its last block [s].
        without: By test: the blocks that are read where a window is left out, shape
            (window of the test, block).
    """

    test: Int[np.ndarray, " window"]
    from_s: Float[np.ndarray, " window"]
    to_s: Float[np.ndarray, " window"]
    without: tuple[Bool[np.ndarray, "window block"], ...]


def windows(problem: Problem, num: int = NUM_WINDOWS) -> Windows:
    """Cut the readings of all tests into windows of about as many blocks each.

    Args:
        problem: With the tests.
        num: Of windows, about; every test with a reading has one at least.
    """
    total = int(np.sum(problem.is_observed))
    owner, ends, without = [], [], []
    for index, test in enumerate(problem.tests):
        read = np.flatnonzero(test.is_observed)
        share = min(read.size, max(1, round(num * read.size / total)))
        parts = np.array_split(read, share) if read.size else []
        masks = np.tile(test.is_observed, (len(parts), 1))
        for mask, part in zip(masks, parts, strict=True):
            mask[part] = False
            owner.append(index)
            ends.append((test.time[part[0]], test.time[part[-1]]))
        without.append(masks)
    from_s, to_s = np.array(ends, dtype=float).reshape(-1, 2).T
    return Windows(np.array(owner, dtype=int), from_s, to_s, tuple(without))


def left_out(
    problem: Problem, cut: Windows, vectors: Float[np.ndarray, "draw all"]
) -> Float[np.ndarray, "draw window"]:
    """Return the log density of each window given all other readings.

    Args:
        problem: Model and tests.
        cut: Windows of these tests.
        vectors: Scores of parameters and noise.
    """
    without = tuple(jnp.asarray(masks) for masks in cut.without)
    function = partial(_left_out, problem.structure, problem.data, without)
    return in_batches(function, vectors, BATCH)


@partial(jax.jit, static_argnames="structure")
def _left_out(
    structure: Structure,
    data: Data,
    without: tuple[Bool[Array, "window block"], ...],
    vectors: Float[Array, "draw all"],
) -> Float[Array, "draw window"]:
    def one(vector):
        z, noise_z = vector[: structure.num_parameters], vector[structure.num_parameters :]
        noise = noise_module.from_scores(noise_z)
        parts = []
        for residual, test, masks in zip(
            residuals(structure, data, z), data.tests, without, strict=True
        ):

            def density(is_read, residual=residual, test=test):
                seen = eqx.tree_at(lambda test: test.is_observed, test, is_read)
                return noise_module.log_density(residual, noise, seen)

            parts.append(density(test.is_observed) - jax.vmap(density)(masks))
        return jnp.concatenate(parts)

    return jax.vmap(one)(vectors)
