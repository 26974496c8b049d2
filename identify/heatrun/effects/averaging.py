"""The posterior of a network, averaged over the small effects that it may miss."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..inference.plausible_effects import PlausibleEffects
from ..inference.posterior import Posterior
from ..inference.steps import too_stiff
from .missing import Missing


def averaged(posterior: Posterior, found: Missing, *, seed: int = 0) -> Posterior:
    """Return the posterior with small effects behind a part of its draws.

    Around the fit the parameters given the sizes lie a shift away from those without (`missing`),
    so each draw moves by that of the effects behind it. One that would leave a node too fast for
    the steps of the tests stays as it was.

    Args:
        posterior: Of the network alone.
        found: What the network may lack.
        seed: Random seed.
    """
    rng = np.random.default_rng([seed, 29])
    vectors = posterior.flat.copy()
    size = found.size[rng.integers(found.size.shape[0], size=vectors.shape[0])]
    z = vectors[:, : found.turn.shape[0]] + size @ found.turn.T
    size = np.where(_is_too_stiff(posterior, z)[:, None], 0.0, size)
    vectors[:, : found.turn.shape[0]] += size @ found.turn.T
    effects = PlausibleEffects(found.effects, size)
    density = np.where(effects.is_none, posterior.log_density.reshape(-1), np.nan)  # another model
    return replace(
        posterior,
        vectors=vectors.reshape(posterior.vectors.shape),
        log_density=density.reshape(posterior.log_density.shape),
        plausible=effects,
        alone=posterior,
    )


def _is_too_stiff(posterior: Posterior, z: np.ndarray) -> np.ndarray:
    """Return which networks have a node that is too fast for the steps of the tests."""
    problem = posterior.fit.problem
    step = max(float(np.max(np.asarray(test.inputs.step))) for test in problem.tests)
    names = [parameter.name for parameter in problem.model.form.parameters]
    values = problem.parameters.physical(z)
    fixed = {n: p.fixed for n, p in problem.parameters.by_test[0].items() if p.fixed is not None}
    every = {n: values[n] if n in values else np.full(z.shape[0], fixed[n]) for n in names}
    return too_stiff(problem.model, every, step)
