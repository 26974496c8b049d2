"""The posterior of a network, averaged over the effects that it may miss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..inference.noise import LARGEST_SCORES, NOISE
from ..inference.plausible_effects import NONE, PlausibleEffects
from ..inference.posterior import Posterior
from ..inference.steps import too_stiff
from .missing import Alternative

MOST_TRIES = 50
"""Times that a draw is drawn again whose amplitude has the wrong sign, or whose fastest node is too
fast for the steps of the tests."""


def averaged(posterior: Posterior, found: Sequence[Alternative], *, seed: int = 0) -> Posterior:
    """Return the posterior with its share of draws from each alternative.

    Args:
        posterior: Of the network alone.
        found: Models with one effect, with their probabilities.
        seed: Random seed.
    """
    rng = np.random.default_rng([seed, 29])
    shape = posterior.vectors.shape
    vectors = posterior.flat.copy()
    density = posterior.log_density.reshape(-1).copy()
    probability = np.array([each.effect.probability for each in found])
    which = np.full(vectors.shape[0], NONE)
    size = np.zeros(vectors.shape[0])
    if probability.size:
        kinds = [NONE, *range(probability.size)]
        share = np.append(max(0.0, 1.0 - probability.sum()), probability)
        which = rng.choice(kinds, size=vectors.shape[0], p=share / share.sum())
    num_noise = len(NOISE)
    factor = np.linalg.cholesky(posterior.fit.covariance[-num_noise:, -num_noise:])
    for index, alternative in enumerate(found):
        rows = np.flatnonzero(which == index)
        z, size[rows] = _stable(posterior, alternative, rows.size, rng)
        noise_z = alternative.noise_z + rng.standard_normal((rows.size, num_noise)) @ factor.T
        noise_z = np.minimum(noise_z, LARGEST_SCORES)
        vectors[rows] = np.concatenate([z, noise_z], axis=1)
        density[rows] = np.nan  # of another model
    effects = PlausibleEffects(tuple(each.effect for each in found), which, size)
    return replace(
        posterior,
        vectors=vectors.reshape(shape),
        log_density=density.reshape(posterior.log_density.shape),
        plausible=effects,
        alone=posterior,
    )


def _stable(
    posterior: Posterior, alternative: Alternative, num: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """As `_drawn`, without networks that are too stiff for the steps of the tests."""
    z, size = _drawn(alternative, num, rng)
    wrong = np.flatnonzero(_is_too_stiff(posterior, z))
    for _ in range(MOST_TRIES):
        if not wrong.size:
            return z, size
        z[wrong], size[wrong] = _drawn(alternative, wrong.size, rng)
        wrong = np.flatnonzero(_is_too_stiff(posterior, z))
    z[wrong], size[wrong] = posterior.fit.z, 0.0
    return z, size


def _is_too_stiff(posterior: Posterior, z: np.ndarray) -> np.ndarray:
    """Return which networks have a node that is too fast for the steps of the tests."""
    problem = posterior.fit.problem
    step = max(float(np.max(np.asarray(test.inputs.step))) for test in problem.tests)
    names = [parameter.name for parameter in problem.model.form.parameters]
    values = problem.parameters.physical(z)
    fixed = {n: p.fixed for n, p in problem.parameters.by_test[0].items() if p.fixed is not None}
    every = {n: values[n] if n in values else np.full(z.shape[0], fixed[n]) for n in names}
    return too_stiff(problem.model, every, step)


def _drawn(
    alternative: Alternative, num: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return scores of the fit's parameters, and the sizes of the effect."""
    share = np.array([part.share for part in alternative.parts])
    which = rng.choice(share.size, size=num, p=share / share.sum())
    scores = np.zeros((num, alternative.parts[0].mean.size))
    for index, part in enumerate(alternative.parts):
        rows = np.flatnonzero(which == index)
        factor = np.linalg.cholesky(part.covariance)
        drawn = part.mean + rng.standard_normal((rows.size, part.mean.size)) @ factor.T
        for _ in range(MOST_TRIES if alternative.has_one_sign else 0):
            wrong = np.flatnonzero(drawn[:, -1] < 0.0)
            if not wrong.size:
                break
            drawn[wrong] = part.mean + rng.standard_normal((wrong.size, part.mean.size)) @ factor.T
        if alternative.has_one_sign:
            drawn[:, -1] = np.maximum(drawn[:, -1], 0.0)
        scores[rows] = drawn
    return alternative.stated(scores), scores[:, -1]
