"""Small symmetric matrices of many lanes at once, without a library of linear algebra.

Batches of factorisations inside compiled code are shared among XLA's threads, which wait for one
another where two of them run at once (`inference.batches.ALONE`); sweeps have no such trouble, and
run alike on every device. Lanes stand in the trailing axis.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def sweep(
    matrix: Float[Array, "row row lane"], num: int
) -> tuple[Float[Array, "row row lane"], Float[Array, " lane"]]:
    """Sweep a symmetric matrix on its first pivots, whose block A is positive definite.

    With A the swept block, B the one beside it and C the rest: minus the inverse of A stands where
    A was, inv(A) B where B was, and C - B' inv(A) B where C was.

    Args:
        matrix: Symmetric matrices.
        num: Number of pivots.

    Returns:
        The swept matrices, and half the log determinant of A.

    Reference: J. H. Goodnight, A tutorial on the SWEEP operator, The American Statistician 33
        (1979) 149-158.
    """
    size = matrix.shape[0]

    def take(pivot, carry):
        swept, half_log_det = carry
        row = jax.lax.dynamic_index_in_dim(swept, pivot, 0, keepdims=False)
        d = jax.lax.dynamic_index_in_dim(row, pivot, 0, keepdims=False)
        is_pivot = (jnp.arange(size) == pivot)[:, None]
        scaled = row / d
        rest = swept - row[:, None] * scaled[None]
        edge = jnp.where(is_pivot, -1.0 / d, scaled)
        rest = jnp.where(is_pivot[:, None], edge[None], rest)
        rest = jnp.where(is_pivot[None], edge[:, None], rest)
        return rest, half_log_det + 0.5 * jnp.log(d)

    return jax.lax.fori_loop(0, num, take, (matrix, jnp.zeros(matrix.shape[-1])))


def solve(
    matrix: Float[Array, "row row lane"], right: Float[Array, "row lane"]
) -> Float[Array, "row lane"]:
    """Return the solutions of positive definite systems."""
    size = matrix.shape[0]
    corner = jnp.zeros((1, 1, matrix.shape[-1]))
    joined = jnp.concatenate([
        jnp.concatenate([matrix, right[:, None]], axis=1),
        jnp.concatenate([right[None], corner], axis=1),
    ])  # fmt: skip
    return sweep(joined, size)[0][:size, size]


def identity(size: int, num_lanes: int) -> Float[Array, "row row lane"]:
    """Return unit matrices."""
    return jnp.broadcast_to(jnp.eye(size)[:, :, None], (size, size, num_lanes))
