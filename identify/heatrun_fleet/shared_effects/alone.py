"""Which machines would show an effect by their own tests alone."""

from __future__ import annotations

import numpy as np

from .pooled import Pool, one_sided

ALONE = 0.05
"""Probability that a machine without effects shows one by itself [1]."""

NUM_DRAWS = 4000
"""Draws for the level of a single machine."""


def num_alone(pool: Pool, both: np.ndarray, seed: int) -> int:
    """Return the number of machines whose own tests alone show an effect.

    Args:
        pool: The machines.
        both: Which amplitudes may have either sign, shape (effect,).
        seed: Of what is drawn.
    """
    num = pool.num_parameters
    own = np.einsum("iaa->ia", pool.information)[:, num:]
    usable = own > 1e-9
    values = np.where(usable, pool.score[:, num:] / np.sqrt(np.where(usable, own, 1.0)), 0.0)
    mean = pool.information.mean(axis=0)[num:, num:]
    size = np.sqrt(np.maximum(np.diag(mean), 1e-12))
    strength, turn = np.linalg.eigh(mean / size / size[:, None])
    rng = np.random.default_rng([seed, 37])
    draws = rng.standard_normal((NUM_DRAWS, size.size)) @ (turn * np.sqrt(strength.clip(0.0))).T
    critical = np.quantile(one_sided(draws, both).max(axis=1), 1.0 - ALONE)
    return int(np.sum(one_sided(values, both).max(axis=1) >= critical))
