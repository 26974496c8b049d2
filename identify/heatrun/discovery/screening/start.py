"""Where a discovery starts: the base network fitted from several starts, with white noise."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from ...arithmetic import refuse_wrong_sums
from ...inference.noise import Noise
from .engine import Engine, Refit

NUM_STARTS = 6
"""The centre of the prior, and draws from it."""

SPREAD = 0.7
"""Spread of the starts in prior standard deviations: a factor of 8 to either side in C and R."""

ROUGH_K = 1.0
"""White level of the first search [K]; see `heatrun.inference.fitting.fit.ROUGH_K`."""


def base_start(engine: Engine, *, seed: int = 0) -> Refit:
    """Return the best fit of the base network under white noise.

    Args:
        engine: The extended model; all effects stay at their null.
        seed: Of the starts.

    Raises:
        InputError: If compiled sums are wrong here.
    """
    refuse_wrong_sums()
    rng = np.random.default_rng([seed, 29])
    rough = white(ROUGH_K)
    best: Refit | None = None
    for number in range(NUM_STARTS):
        z = np.zeros(len(engine.slots))
        if number:
            for slot in engine.base:
                if engine.slots[slot].parameter.role in ("network", "resistance"):
                    z[slot] = SPREAD * rng.standard_normal()
        found = engine.refit(z, engine.base, rough)
        if best is None or found.chi2 < best.chi2:
            best = found
    assert best is not None
    level = float(np.sqrt(np.mean(best.residual[engine.is_observed] ** 2)))
    return engine.refit(best.z, engine.base, white(max(level, 0.05)))


def white(level: float) -> Noise:
    """Return white noise of a level [K]."""
    return Noise(*(jnp.asarray(number) for number in (0.0, 40.0, level, 0.0)))
