"""A compiled function over many items at once: on all cores, or in batches of one size."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np

Item = TypeVar("Item")
Rows = TypeVar("Rows")
Result = TypeVar("Result")

FEW = 4
"""Batches below which threads are not worth their start."""


def at_once(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return what a function gives for each item, worked out on all cores.

    Compiled code runs on one core and lets other threads run; what Python does in between is done
    by one thread at a time.
    """
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(function, items))


ALONE = Lock()
"""Held by what factorises batches of matrices inside compiled code. XLA shares such a batch among
the threads of its pool and waits for them; two of them at once, on two cores, each occupy one
thread and wait for the other for ever (seen with 24 parameters)."""


def in_batches(
    function: Callable[[Rows], Result], rows: Rows, size: int, *, alone: bool = False
) -> Result:
    """Return what a function gives for rows, as NumPy arrays.

    One size of batch means one compilation; the last batch is filled up with copies of the last
    row.

    Args:
        function: Compiled, each row for itself.
        rows: A pytree of NumPy arrays whose first axis is that of the rows, at least one; what
            `function` returns is another.
        size: Rows in a batch.
        alone: Whether `function` factorises matrices, so that nothing of the kind may run beside.
    """
    num = jax.tree.leaves(rows)[0].shape[0]

    def one(start: int) -> Result:
        picked = np.minimum(np.arange(start, start + size), num - 1)
        part = jax.tree.map(lambda array: jnp.asarray(array[picked]), rows)
        return jax.tree.map(np.asarray, function(part))

    starts = range(0, num, size)
    if alone:
        with ALONE:
            done = [one(start) for start in starts]
    else:
        done = [one(start) for start in starts] if len(starts) < FEW else at_once(one, starts)
    return jax.tree.map(lambda *arrays: np.concatenate(arrays)[:num], *done)
