"""The plain network that comes nearest to a model with effects, for tools that take no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from ..inference.instruments import OWN, own_name
from ..inference.posterior import Posterior
from ..inference.predict import Prediction
from ..results.model import Replica

REACH = 5.0
"""A parameter of the replica stays within this factor of the model's, to either side, in logarithms
of e [1]."""


def replica(posterior: Posterior, predictions: Sequence[Prediction]) -> Replica | None:
    """Return the plain network that behaves most like a model with effects over its fitted tests.

    Its resistances and capacities are those that bring its winding nearest to the model's, with
    exact instruments and the model's start temperatures. None where the model has no effects.

    Args:
        posterior: Draws of the model.
        predictions: Of all tests.
    """
    model, problem = posterior.fit.problem.model, posterior.fit.problem
    tests = [p for p in predictions if p.is_there]
    fitted = [p for p in tests if not p.is_held_out]
    names = [p.name for p in model.form.parameters if p.fixed is None]
    if not model.effects or not fitted:
        return None
    plain = replace(model, effects=())
    own_names = {own_name(name) for name in OWN}  # a test's own: its inputs without these mislead
    exact = {
        name: parameter.centre
        for name, parameter in problem.parameters.by_test[0].items()
        if parameter.role == "instrument" and name not in own_names
    }
    means = jax.jit(plain.block_means)
    course = {}
    for each in tests:
        own = {n: v for n, v in each.middle.items() if n not in exact and "." not in n}
        course[each.test.name] = (each.test.observation(), exact | own)

    def simulated(logs: np.ndarray, each: Prediction) -> np.ndarray:
        observation, values = course[each.test.name]
        numbers = values | dict(zip(names, np.exp(logs).tolist(), strict=True))
        found = means({n: jnp.asarray(v) for n, v in numbers.items()}, observation)
        return np.asarray(found)[: each.test.measured.size]

    def apart(logs: np.ndarray) -> np.ndarray:
        return np.concatenate([simulated(logs, each) - each.median for each in fitted])

    start = np.log([fitted[0].middle[name] for name in names])
    found = least_squares(apart, start, bounds=(start - REACH, start + REACH), diff_step=1e-4)
    errors = {
        each.test.name: float(
            np.sqrt(np.mean((each.test.measured - simulated(found.x, each))[seen] ** 2))
        )
        for each in tests
        if np.any(seen := each.test.is_observed)
    }
    return Replica(
        parameters=dict(zip(names, np.exp(found.x).tolist(), strict=True)),
        rmse_K=errors,
        from_model_K=float(np.sqrt(np.mean(found.fun**2))),
    )
