"""Unmodelled heat, held down where it would keep a network from tests that it could follow.

Heat that a network misses may be as slow as what it has to explain. Where it misses much, such as a
body measured far from its node, all that is slow goes as heat, and the parameters follow the quick
changes alone: such a network may run ten kelvin from tests to which least squares brings it within
two.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...bench.record import Finding
from ...motor import HEAT_LIMITS, Adequacy
from ..problem import Problem
from .fit import fit
from .fit_result import Fit

OVERRULED, OVERRULED_K = 3.0, 0.5
"""Times that a fit may be farther from its tests than least squares with white noise [1], and how
far it must be at all [K]: of 62 simulated machines with mild causes one was beyond."""

FOLLOWS = 1.5
"""Times that distance at which a network counts as following its tests again [1]."""

HELD = "heat_held_down"
"""Id of the finding."""

LESS = 10.0**-0.5
"""Unmodelled heat of each further fit over that of the one before [1]."""


def distance(found: Fit) -> tuple[float, float]:
    """Return how far a fit is from its tests, and how far least squares is (RMSE) [K].

    Args:
        found: The fit.
    """
    reached = found.stats.get("rmse_white_K", math.nan)
    return found.problem.rmse_K(np.concatenate(found.residual)), reached


def is_overruled(found: Fit) -> bool:
    """Return whether unmodelled heat keeps a network from tests that it could follow.

    Args:
        found: The fit.
    """
    rmse, reached = distance(found)
    return rmse > max(OVERRULED * reached, OVERRULED_K)


def holding_heat(
    found: Fit, *, refit: Callable[[Problem], Fit] | None = None, seed: int = 0
) -> Fit:
    """Return the fit, or one with so much less unmodelled heat that the network follows its tests.

    Where none follows, it is the nearest of those that were tried. What a motor file states under
    `[adequacy]` stays as it is.

    Args:
        found: The fit.
        refit: Fits the problem with less heat; by default `fit`.
        seed: As `fit`.
    """
    problem = found.problem
    usual = problem.model.adequacy
    if not is_overruled(found) or problem.motor.adequacy != Adequacy():
        return found
    held, adequacy, nearest = found, usual, found
    while _is_away(held) and adequacy.unmodelled_heat > HEAT_LIMITS[0]:
        least = max(LESS * adequacy.unmodelled_heat, HEAT_LIMITS[0])
        adequacy = replace(adequacy, unmodelled_heat=least)
        model = replace(problem.model, adequacy=adequacy)
        if refit is None:
            held = fit(Problem.of(model, problem.motor, problem.tests), seed=seed)
        else:
            held = refit(replace(problem, model=model))
        nearest = min(nearest, held, key=lambda each: distance(each)[0])
    if nearest is found:  # a search may end elsewhere, however little heat there is
        return found
    return replace(nearest, findings=(*nearest.findings, _finding(found, nearest)))


def _is_away(found: Fit) -> bool:
    rmse, reached = distance(found)
    return rmse > max(FOLLOWS * reached, OVERRULED_K)


def _finding(before: Fit, held: Fit) -> Finding:
    usual, less = (each.problem.model.adequacy.unmodelled_heat for each in (before, held))
    (rmse_before, reached), (rmse, _) = distance(before), distance(held)
    return Finding(
        id=HELD,
        severity="warning",
        message=f"the network misses so much that with the usual unmodelled heat ({usual:.2g} of "
        f"the mean loss) it would run {rmse_before:.1f} K (RMSE of all readings) from the tests, "
        f"where plain least squares reaches {reached:.1f} K. Held to {less:.1g}, it runs "
        f"{rmse:.1f} K from them. The 95 % intervals do not allow for what it misses.",
        where=held.problem.label,
        remedy="A network with more nodes, or with the missing effect (`heatrun discover`), may do "
        "without. Check where measured bodies are placed under [sensors].",
        values={
            "rmse_K": rmse,
            "rmse_before_K": rmse_before,
            "rmse_white_K": reached,
            "unmodelled_heat": less,
        },
    )
