"""What the optimum of a fit says of the network and of itself, before anything is sampled."""

from __future__ import annotations

import numpy as np

from ...bench.record import Finding
from ..noise import from_scores, noise_parameters
from ..problem import Problem
from .fit_result import RESULT

LONGEST_NOISE_S = 150.0
"""Residuals correlated over more than this are a misfit, not noise [s]."""

MUCH_HEAT = 2.0
"""Prior standard deviations from which on the unmodelled heat is a finding [1]."""


def misfit_findings(
    problem: Problem, noise_z: np.ndarray, rmse: float, excess: float, is_flagged: bool
) -> list[Finding]:
    """Return what the noise and the unmodelled heat say of the network.

    Args:
        problem: Model and tests.
        noise_z: Scores of the noise.
        rmse: Of the residuals [K].
        excess: Low-frequency excess of the innovations [1].
        is_flagged: Whether that is above its limit.
    """
    noise = from_scores(noise_z)
    of_heat = noise_parameters(problem.model.adequacy)[-1]
    heat, usual = float(of_heat.value(noise_z[3])), of_heat.prior_interval_95()[1]
    reasons = []
    if noise_z[3] > MUCH_HEAT:
        reasons.append(
            f"it leaves heat of {100.0 * heat:.2g} % of the loss unexplained (up to "
            f"{100.0 * usual:.2g} % is usual)"
        )
    if float(noise.time) > LONGEST_NOISE_S:
        reasons.append(f"its residuals are correlated over more than {LONGEST_NOISE_S:.0f} s")
    if is_flagged:
        reasons.append(f"its slow residuals have {excess:.1f} times the variance of noise")
    if not reasons:
        return []
    return [
        Finding(
            id="misfit",
            severity="warning",
            message=f"the {problem.model.words} is incomplete: {'; '.join(reasons)}. The 95 % "
            "intervals allow for slow heat of this size, not for every cause.",
            where=problem.label,
            remedy="Search for the missing effect with `heatrun discover`.",
            values={
                "rmse_K": rmse,  # of the most probable parameters; that of the run is its median's
                "low_frequency_excess": excess,
                "unmodelled_heat": heat,
                "noise_time_s": float(noise.time),
            },
        )
    ]


def several_optima(problem: Problem, num_modes: int) -> Finding:
    """Return the finding that `num_modes` parameter sets fit about equally well."""
    return Finding(
        id="several_optima",
        severity="warning",
        message=f"the posterior of the {problem.model.words} is "
        f"{'bimodal' if num_modes == 2 else 'multimodal'}: {num_modes} parameter sets fit the "
        "tests about equally well. The 95 % intervals cover all modes.",
        where=problem.label,
        remedy="Add a test in which current and speed change independently, or fix a parameter in "
        "the motor file.",
        values={"num_modes": num_modes},
    )


def not_converged(problem: Problem) -> Finding:
    """Return the finding that the alternation of noise and least squares has not ended."""
    return Finding(
        id="not_converged",
        severity="warning",
        message=f"{problem.model.title}: {RESULT.not_converged.value}",
        where=problem.label,
    )
