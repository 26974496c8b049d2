"""Factors of small matrices, without a library of linear algebra.

Batches of factorisations inside compiled code are shared among XLA's threads, which wait for one
another for ever where two of them run at once: a population of 300 machines on two cores stood
still. Rank-one updates, as many as a machine has parameters, have no such trouble and are faster.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float


def cholesky(matrix: Float[Array, "row row"]) -> Float[Array, "row row"]:
    """Return the lower factor of a positive definite matrix."""
    size = matrix.shape[0]
    rest, columns = matrix, []
    for pivot in range(size):
        below = jnp.arange(size) >= pivot
        column = jnp.where(below, rest[:, pivot] / jnp.sqrt(rest[pivot, pivot]), 0.0)
        rest = rest - column[:, None] * column
        columns.append(column)
    return jnp.stack(columns, axis=1)


def solve_lower(
    factor: Float[Array, "row row"], right: Float[Array, "row ..."]
) -> Float[Array, "row ..."]:
    """Return x with factor x = right, of a lower triangular factor."""
    rows = []
    for pivot in range(factor.shape[0]):
        rows.append(right[pivot] / factor[pivot, pivot])
        right = right - jnp.tensordot(factor[:, pivot], rows[-1], axes=0)
    return jnp.stack(rows)
