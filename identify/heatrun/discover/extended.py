"""The network with the effects that were found, as a fit of its own: for sampling and sheets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from .. import noise as noise_module
from ..fit_result import RESULT, Fit
from ..laplace import spread
from ..parameters import ParameterSet, collect
from ..problem import Problem
from ..restricted import estimate_noise
from .engine import Engine
from .library import Candidate


def extended_fit(
    engine: Engine, z: np.ndarray, accepted: Sequence[Candidate], temper: float = 1.0
) -> Fit:
    """Return the joint fit of network, effects and noise as a fit that can be sampled.

    The noise is estimated on this very model, without a limit of its correlation time; the
    parameters are fitted again under it.

    Args:
        engine: The extended model with all effects.
        z: Scores of all its slots to start from.
        accepted: The effects that are in the model; all others are at their null.
        temper: Factor that the evidence of the readings is divided by [1].
    """
    full = engine.problem
    kinds = tuple(candidate.kind for candidate in accepted)
    model = replace(full.model, effects=kinds)
    parameters = _parameters(full.parameters, accepted)
    problem = Problem(model, full.motor, full.tests, parameters, temper=temper)
    order = [_slot(engine, slot.parameter.name, slot.test) for slot in parameters.slots]
    residual, jacobian = engine.linearise(z, order)
    for _ in range(2):
        noise_z = estimate_noise(problem, z[order], residual, jacobian)
        found = engine.refit(z, order, noise_module.from_scores(jnp.asarray(noise_z)), temper)
        z, residual, jacobian = found.z, found.residual, found.jacobian
    noise_z = estimate_noise(problem, z[order], residual, jacobian)
    width = spread(problem, z[order], noise_z, residual, jacobian)
    return Fit(
        problem=problem,
        z=z[order],
        noise_z=noise_z,
        covariance=width.covariance,
        covariance_type_a=width.type_a,
        residual=problem.split(residual),
        jacobian=problem.split(jacobian),
        modes=z[order][None],
        log_evidence=width.log_evidence,
        result=RESULT.converged,
    )


def _parameters(full: ParameterSet, accepted: Sequence[Candidate]) -> ParameterSet:
    """Return the parameters of the base and the accepted effects; events in their test only."""
    owners = {candidate.id: candidate.test for candidate in accepted}
    by_test = []
    for index, parameters in enumerate(full.by_test):
        kept = {}
        for name, parameter in parameters.items():
            if parameter.role == "effect":
                effect = name.split(".", 1)[0]
                if effect not in owners:
                    continue
                if parameter.per_test and owners[effect] != index:
                    parameter = replace(parameter, fixed=parameter.centre)
            kept[name] = parameter
        by_test.append(kept)
    return collect(full.tests, by_test)


def _slot(engine: Engine, name: str, test: int | None) -> int:
    slot = engine.find(name, test)
    assert slot is not None, name
    return slot
