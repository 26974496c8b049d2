"""The network with the effects that were found, as a fit of its own: for sampling and sheets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..inference.discrepancy import with_heat
from ..inference.fitting.fit_result import RESULT, Fit
from ..inference.fitting.held_heat import holding_heat
from ..inference.fitting.laplace import spread
from ..inference.fitting.restricted import estimate_noise
from ..inference.noise import from_scores
from ..inference.parameters import ParameterSet, collect
from ..inference.problem import Problem
from .screening.engine import Engine
from .screening.known import known_effects_of
from .screening.library import Candidate


def extended_fit(engine: Engine, z: np.ndarray, accepted: Sequence[Candidate]) -> Fit:
    """Return the joint fit of network, effects and noise as a fit that can be sampled.

    Noise and unmodelled heat are estimated on this very model, without a limit of the noise's
    correlation time, as in `inference.fitting.fit`: what the model does not explain widens the
    posterior. Where it would keep the model from tests that the search has followed, unmodelled
    heat is held down as `inference.fitting.held_heat` does it.

    Args:
        engine: The extended model with all effects.
        z: Scores of all its slots to start from.
        accepted: The effects that are in the model; all others are at their null.
    """
    full = engine.problem
    known = known_effects_of(full)
    model = replace(full.model, effects=(*known, *(candidate.kind for candidate in accepted)))
    parameters = _parameters(full.parameters, accepted)
    problem = Problem(model, full.motor, full.tests, parameters, loggers=full.loggers)
    order = [_slot(engine, slot.parameter.name, slot.test) for slot in parameters.slots]
    reached_K = problem.rmse_K(engine.linearise(z, order)[0])

    def fitted(problem: Problem) -> Fit:
        return _fitted(engine, problem, z, order, reached_K)

    return holding_heat(fitted(problem), refit=fitted)


def _fitted(
    engine: Engine, problem: Problem, z: np.ndarray, order: Sequence[int], reached_K: float
) -> Fit:
    problem, z, noise_z = _settle(engine, problem, z, order)
    residual, jacobian = engine.linearise(z, order)
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
        stats={"rmse_white_K": reached_K},
    )


def _settle(
    engine: Engine, problem: Problem, z: np.ndarray, order: Sequence[int]
) -> tuple[Problem, np.ndarray, np.ndarray]:
    """Return problem, scores of parameters and noise after two rounds of both."""
    slots = list(order)
    residual, jacobian = engine.linearise(z, slots)
    for _ in range(2):
        problem = with_heat(problem, z[slots])
        assert problem.heat is not None
        noise_z = estimate_noise(problem, z[slots], residual, jacobian)
        found = engine.with_heat(problem.heat).refit(z, slots, from_scores(noise_z))
        z, residual, jacobian = found.z, found.residual, found.jacobian
    return problem, z, estimate_noise(problem, z[slots], residual, jacobian)


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


def placed(engine: Engine, fit: Fit) -> tuple[np.ndarray, list[int]]:
    """Return a fit among all slots of an engine: their scores, and the places of its own.

    The order is that of the fit, where a test may have a parameter that another lacks.
    """
    order = [_slot(engine, slot.parameter.name, slot.test) for slot in fit.slots]
    z = np.zeros(len(engine.slots))
    z[order] = fit.z
    return z, order


def _slot(engine: Engine, name: str, test: int | None) -> int:
    slot = engine.find(name, test)
    assert slot is not None, name
    return slot
