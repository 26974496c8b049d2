"""How large the best score of a whole library gets where nothing is missing."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..inference import noise as noise_module
from ..inference.fitting.restricted import noise_precision
from .engine import Engine
from .screen import Screen

NUM_DRAWS = 400
"""Records that are drawn: a p-value of 0.05 is then good to 0.011."""


def familywise_p(
    engine: Engine, screen: Screen, noise_scores: np.ndarray, value: float, seed: int
) -> float:
    """Return the share of records without any effect whose best score reaches a value [1].

    Records are drawn from the noise, whose parameters are drawn from their posterior first; the
    present model is refitted to each, and the largest score of all candidates and settings of
    their shapes is taken. It is counted with one added, so it is never zero.

    Args:
        engine: The extended model.
        screen: The library against the present model.
        noise_scores: Scores of the noise that the screen was whitened with.
        value: Log Bayes factor that was found [nat].
        seed: Of the draws.

    Reference: A. C. Davison, D. V. Hinkley, Bootstrap Methods and their Application, section 4.2.
    """
    rows = _records(engine, screen, noise_scores, seed)
    largest = screen.largest_gain(engine.whiten(screen.present.noise, rows))
    return float((1 + np.sum(largest >= value)) / (1 + largest.size))


def _records(
    engine: Engine, screen: Screen, noise_scores: np.ndarray, seed: int
) -> Float[np.ndarray, "block draw"]:
    present = screen.present
    z = present.z[list(present.free)]
    curvature = noise_precision(engine.problem, noise_scores, z, present.residual, present.jacobian)
    values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T))
    rng = np.random.default_rng([seed, 17])
    spread = vectors / np.sqrt(np.maximum(values, 1.0))
    scores = noise_scores + rng.standard_normal((NUM_DRAWS, noise_scores.size)) @ spread.T
    parts = []
    for index, test in enumerate(engine.observations):
        keys = jax.random.split(jax.random.key(seed + 1000 * index), NUM_DRAWS)
        parts.append(np.asarray(_draw(jnp.asarray(scores), keys, test)).T)
    return np.concatenate(parts)


@jax.jit
def _draw(scores, keys, test):
    def one(score, key):
        return noise_module.draw(key, noise_module.from_scores(score), test)

    return jax.vmap(one)(scores, keys)
