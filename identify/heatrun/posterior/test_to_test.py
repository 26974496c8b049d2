"""Do tests of one machine ask for different parameters, and by how much?

A machine is mounted anew, a coolant is set by hand, a duct is moved: capacities and resistances
then differ a little from test to test, and a joint fit that does not know it is too sure. With a
change of each parameter in each test, of one standard deviation s of its logarithm, the restricted
likelihood says how large s is; where it is above chance, the changes become parameters.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from ..fit.fit import fit
from ..fit.fit_result import Fit
from ..fit.restricted import estimate_noise, log_evidence
from ..model.model_parameters import changing
from ..model.problem import Problem
from ..record.record import Finding
from .fit_checks import HELD
from .posterior import Posterior

SIZES = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64)
"""Standard deviations of the changes that are tried [1]."""

NONE = 1e-4
"""Stands for no change at all, so that both sides are computed alike [1]."""

CLEAR = 5.0
"""Log likelihood ratio from which on tests count as different [nat]: the largest of a size that
is zero in truth is above it in one of a thousand calibrations (half a chi-squared of one degree
above 10)."""


class Scatter(NamedTuple):
    """How much the parameters change from test to test.

    Attributes:
        size: Standard deviation of the logarithm [1].
        gain: Log likelihood ratio against none [nat].
    """

    size: float
    gain: float


def test_to_test(found: Fit) -> Scatter:
    """Return the changes from test to test that fit the residuals best.

    Around the fit the model is linear in the logarithms of its parameters. The noise is estimated
    anew for each size, for it has swallowed what the tests do not have in common.

    Args:
        found: A fit of several tests.
    """
    problem = found.problem
    residual, jacobian = np.concatenate(found.residual), np.concatenate(found.jacobian)
    names = [parameter.name for parameter in changing(problem.model, problem.motor)]
    places = [i for i, slot in enumerate(found.slots) if slot.name in names]
    if not places:
        return Scatter(0.0, 0.0)
    per_log = 1.0 / np.array([found.slots[place].parameter.sd for place in places])
    apart = np.asarray(block_diag(*[rows[:, places] * per_log for rows in found.jacobian]))
    z = np.concatenate([found.z, np.zeros(apart.shape[1])])

    def likelihood(size: float) -> float:
        linear = z, residual, np.concatenate([jacobian, size * apart], axis=1)
        noise_z = estimate_noise(problem, *linear)
        return log_evidence(problem, noise_z, *linear)

    without = likelihood(NONE)
    gains = {size: likelihood(size) - without for size in SIZES[1::2]}
    if max(gains.values()) > 0.0:
        gains |= {size: likelihood(size) - without for size in SIZES[::2]}
    best = max(gains, key=lambda size: gains[size])
    return Scatter(best, gains[best])


def fit_with_changes(found: Fit, *, beyond: float = -np.inf, seed: int = 0) -> Fit:
    """Return the fit with changes from test to test, where the tests show them; else as it is.

    Args:
        found: A fit.
        beyond: Log Bayes factor of the best network with an effect, which may be what tells the
            tests apart [nat].
        seed: As `fit`.
    """
    problem = found.problem
    if len(problem.tests) < 2 or problem.model.change_sd:
        return found
    scatter = test_to_test(found)
    if scatter.gain < max(CLEAR, beyond):
        return found
    model = replace(problem.model, change_sd=scatter.size)
    again = fit(Problem.of(model, problem.motor, problem.tests), seed=seed)
    stats = {**again.stats, "test_to_test_gain": scatter.gain}
    held = [finding for finding in found.findings if finding.id == HELD]
    return replace(again, stats=stats, findings=(*again.findings, *held))


def changes_finding(posterior: Posterior) -> Finding | None:
    """Return the finding that tests disagree; None where they do not.

    Args:
        posterior: Draws of a fit from `fit_with_changes`.
    """
    problem = posterior.fit.problem
    size = problem.model.change_sd
    if not size:
        return None
    values = posterior.values()
    changes = {
        slot.name: float(np.median(values[slot.name]))
        for slot in posterior.fit.slots
        if slot.parameter.role == "change"
    }
    largest = sorted(changes, key=lambda name: -abs(changes[name]))[:3]
    said = ", ".join(
        f"{name.replace('_change[', ' in ').rstrip(']')} {100.0 * np.expm1(changes[name]):+.0f} %"
        for name in largest
    )
    return Finding(
        id="tests_disagree",
        severity="warning",
        message=f"the tests ask for different parameters of the {problem.model.words}, by some "
        f"{100.0 * size:.0f} % from test to test (log likelihood ratio "
        f"{posterior.fit.stats['test_to_test_gain']:.0f}). Largest: {said}. The 95 % intervals "
        "and the bands of other tests allow for such changes.",
        where=problem.label,
        remedy="Compare mounting, cooling and clocks of the tests. Calibrate the odd one out by "
        "itself, or search with `heatrun discover` for an effect that tells them apart.",
        values={"change_sd": size, **changes},
    )
