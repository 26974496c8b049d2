"""Linear equations of a few nodes, solved without a library's kernel.

A solver of LAPACK inside a compiled loop over thousands of parameter sets waited for ever on two
cores; for matrices of a few rows the elimination written out is also the faster one.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float


def eliminate(
    matrix: Float[Array, "node node"], right: Float[Array, "node column"]
) -> Float[Array, "node column"]:
    """Return X of A X = B by elimination, without looking for pivots.

    Args:
        matrix: A, shape (node, node).
        right: B, shape (node, column).

    Valid for: matrices of heat balances, whose diagonal outweighs its row or its column; a zero
        in the diagonal gives values that are not finite.
    """
    num = matrix.shape[0]
    rows = jnp.concatenate([matrix, right], axis=1)
    for place in range(num):
        row = rows[place] / rows[place, place]
        others = rows - rows[:, place, None] * row[None, :]
        rows = others.at[place].set(row)
    return rows[:, num:]
