"""Whether compiled sums are right on this machine: NumPy adds the same numbers, once per process.

jaxlib 0.10.2 on CPUs joins a small matrix product with the sum behind it. Of more than 16 384 rows
in float64, those behind them come out wrong, in silence: with the options of `runtime` and without,
on one core and several, with wide and narrow vectors (jax-ml/jax, issue 39103). `pyproject.toml`
excludes that version; this is for environments that have it all the same, and for others that err
alike.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import version

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .errors import InputError
from .io.programs import compiled

NUM_ROWS = 20_000
"""Rows of the check: of so many, 3616 come out wrong. Of 16 384 or fewer, and of 48 000 or more,
none were seen to."""

SIZE = 3
"""Rows and columns of its matrix: sums were wrong with 2 to 6 rows and 3, 5 or 6 columns."""

BELOW = 64
"""The numbers are whole and below this: no sum of theirs is rounded, in whatever order it is taken,
in float32 either."""


@cache
def refuse_wrong_sums() -> None:
    """Refuse to go on where sums are wrong; at the start of all that fits, in some 50 ms, once.

    Raises:
        InputError: If compiled sums are not those of NumPy.
    """
    rng = np.random.default_rng(0)
    rows = rng.integers(BELOW, size=(NUM_ROWS, SIZE)).astype(float)
    matrix = np.tri(SIZE)
    found = np.asarray(sums_of_squares(matrix, rows))
    num_wrong = int(np.sum(found != np.sum((rows @ matrix.T) ** 2, axis=1)))
    if num_wrong:
        here = version("jaxlib")
        raise InputError(
            f"jaxlib {here} computes wrong sums on this machine: {num_wrong} of {NUM_ROWS} sums "
            "of squares are not those of NumPy, so no fit could be relied on.",
            remedy=f'Install another version: pip install "jax!={here}" "jaxlib!={here}"',
        )


@compiled()
def sums_of_squares(
    matrix: Float[Array, "sum column"], rows: Float[Array, "row column"]
) -> Float[Array, " row"]:
    """Return, of each row, the sum of squares of a matrix times the row."""
    return jax.vmap(lambda row: jnp.sum((matrix @ row) ** 2))(rows)
