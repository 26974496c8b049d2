"""The network with the effects that were found, as a fit of its own: for sampling and sheets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..inference import noise as noise_module
from ..inference.fitting.adequacy import misfit_excess
from ..inference.fitting.fit_result import RESULT, Fit
from ..inference.fitting.laplace import spread, whiten_fit
from ..inference.fitting.restricted import estimate_noise
from ..inference.parameters import ParameterSet, collect
from ..inference.problem import Problem
from .screening.engine import Engine
from .screening.known import known_effects_of
from .screening.library import Candidate


def extended_fit(
    engine: Engine, z: np.ndarray, accepted: Sequence[Candidate], *, is_adequate: bool
) -> Fit:
    """Return the joint fit of network, effects and noise as a fit that can be sampled.

    The noise is estimated on this very model, without a limit of its correlation time. Where the
    model is not adequate it counts as white, as in `inference.fitting.fit`, and the evidence of the
    readings is divided by the excess of slow residuals.

    Args:
        engine: The extended model with all effects.
        z: Scores of all its slots to start from.
        accepted: The effects that are in the model; all others are at their null.
        is_adequate: Whether the model leaves only noise.
    """
    full = engine.problem
    known = known_effects_of(full)
    model = replace(full.model, effects=(*known, *(candidate.kind for candidate in accepted)))
    parameters = _parameters(full.parameters, accepted)
    kind = "correlated" if is_adequate else "white"
    problem = Problem(model, full.motor, full.tests, parameters, noise_kind=kind)
    order = [_slot(engine, slot.parameter.name, slot.test) for slot in parameters.slots]
    z, noise_z = _settle(engine, problem, z, order)
    residual, jacobian = engine.linearise(z, order)
    if not is_adequate:
        seen = whiten_fit(problem, noise_z, residual, jacobian).residuals
        level = float(noise_module.from_scores(np.asarray(noise_z), 0.0).total())
        excess, _ = misfit_excess(problem.tests, seen, level)
        problem = replace(problem, temper=max(1.0, excess))
        z, noise_z = _settle(engine, problem, z, order)
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
    )


def _settle(
    engine: Engine, problem: Problem, z: np.ndarray, order: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return scores of parameters and noise after two rounds of both."""
    slots = list(order)
    residual, jacobian = engine.linearise(z, slots)
    for _ in range(2):
        noise_z = estimate_noise(problem, z[slots], residual, jacobian)
        noise = problem.noise(noise_z)
        found = engine.refit(z, slots, noise, problem.temper)
        z, residual, jacobian = found.z, found.residual, found.jacobian
    return z, estimate_noise(problem, z[slots], residual, jacobian)


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
