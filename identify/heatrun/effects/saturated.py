"""The noise, estimated on a model that leaves room for what the network misses.

If the noise is estimated on the residuals of a network that misses something, it swallows the
misfit, and nothing is ever found; if it is taken as white, everything is. Here the likelihood of
the noise has the parameters of the network integrated out, and with them the directions in which
the library's effects would show most.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..inference import noise as noise_module
from ..inference.fitting.restricted import estimate_noise
from ..inference.noise import Noise
from .engine import Engine, Refit
from .screen import Screen

NUM_DIRECTIONS = 12
"""Principal directions of the library that are integrated out."""

LONGEST_S = 60.0
"""Correlation over longer than this is no noise while causes are sought [s]."""

UNLIMITED_S = 2000.0
"""Correlation time that no noise reaches [s]."""

ROOM = 3.0
"""Prior standard deviation along each direction, in units of a typical effect [1]."""


def saturated_noise(
    engine: Engine, screen: Screen, *, longest_s: float = LONGEST_S
) -> tuple[Noise, Float[np.ndarray, " 3"]]:
    """Return the noise with the library's directions integrated out, and its scores.

    Args:
        engine: The extended model.
        screen: The library against the present model.
        longest_s: As `LONGEST_S`.
    """
    present = screen.present
    projected = screen.projected()
    # the directions in which typical effects show most against the noise so far
    _, strength, turn = np.linalg.svd(projected, full_matrices=False)
    keep = min(NUM_DIRECTIONS, int(np.sum(strength > 1e-6 * strength[0])))
    directions = ROOM * (screen.raw_typical() @ turn[:keep].T)
    return _noise(engine, present, directions, longest_s)


def plain_noise(engine: Engine, present: Refit, *, longest_s: float = UNLIMITED_S) -> Noise:
    """Return the noise with only the present model's parameters integrated out, uncapped unless a
    longest correlation time is given [s].
    """
    return _noise(engine, present, np.zeros((present.residual.size, 0)), longest_s)[0]


def _noise(
    engine: Engine, present: Refit, directions: np.ndarray, longest_s: float
) -> tuple[Noise, np.ndarray]:
    columns = padded(np.concatenate([present.jacobian, directions], axis=1))
    z = filled(present.z[list(present.free)], columns)
    scores = estimate_noise(engine.problem, z, present.residual, columns, longest_s=longest_s)
    return noise_module.from_scores(jnp.asarray(scores)), scores


def padded(columns: Float[np.ndarray, "block column"]) -> Float[np.ndarray, "block more"]:
    """Return columns with empty ones up to a multiple of 40, for one compilation."""
    return np.pad(columns, ((0, 0), (0, -columns.shape[1] % 40)))


def filled(z: Float[np.ndarray, " column"], columns: np.ndarray) -> Float[np.ndarray, " more"]:
    """Return scores with zeros for the empty ones among padded columns."""
    return np.pad(z, (0, columns.shape[1] - z.size))
