r"""The uncertainty budget of a calibration: what stands behind a figure of its draws.

The rule is that of `heatrun.results.values`, around the fit, whose covariance of the scores is its
$S$. The slope $g$ of a figure by the scores is that of its draws, by least squares. The readings
scatter by the noise of the sensors, by heat that the network misses and by load steps whose moment
nothing tells: with $W W^T$ the inverse of their covariance, the part of columns $H$ in it is
$|(W^T H)^T W^T A S g|$ of the readings' derivative $A$. What small effects behind the draws add is
the scatter of what they move (`heatrun.effects.small_effects`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Float

from ..fit.fit_result import Fit
from ..fit.restricted import whiten_fit
from ..model.parameters import Slot
from ..posterior.posterior import Posterior
from ..results.values import BudgetRow, Part, budget

Budget = Callable[..., tuple[BudgetRow, ...]]
"""Gives the budget of a figure from its draws, shape (draw,), and from further parts."""

OF_ROLE = {
    "network": "priors of capacities and resistances",
    "effect": "priors of the effects' parameters",
    "known": "priors of the effects' parameters",
    "change": "differences between the tests",
    "start": "temperatures at the start",
}
"""Sources of several parameters, by their role; each other parameter is a source of its own."""

NOISE, HEAT = "noise of the readings", "heat that the network misses"
MOMENTS = "moments of the load steps"
SMALL_EFFECTS = "small effects that the network may miss"
UNDECIDED = "effects that the tests do not tell apart"


def budget_of(posterior: Posterior) -> Budget:
    """Return what gives the budget of a figure from its draws.

    It is of first order: where a parameter bends the others within its interval, the standard
    deviation of the draws is another, and holds.

    Args:
        posterior: Draws; those of a figure are as many, in the same order.
    """
    fit, plausible = posterior.fit, posterior.plausible
    size = fit.problem.num_parameters
    covariance = fit.covariance[:size, :size]
    residual, jacobian = map(np.concatenate, (fit.residual, fit.jacobian))
    white = whiten_fit(fit.problem, fit.noise_z, residual, jacobian).jacobian
    of_columns = {name: _whitened(fit, columns) for name, columns in _columns(fit)}
    alone = posterior if posterior.alone is None else posterior.alone
    effects = np.empty((len(alone.flat), 0)) if plausible is None else plausible.size
    behind = np.concatenate([alone.flat[:, :size], effects], axis=1)
    behind -= behind.mean(axis=0)
    to_slopes = np.linalg.pinv(behind, rcond=np.finfo(float).eps * max(behind.shape))
    sources: dict[str, list[int]] = {}
    for place, slot in enumerate(fit.slots):
        sources.setdefault(_source(slot), []).append(place)

    def of(draws: Float[np.ndarray, " draw"], *more: Part) -> tuple[BudgetRow, ...]:
        slopes = to_slopes @ (draws - np.mean(draws))
        moved = covariance @ slopes[:size]
        parts = [*more]
        for name, places in sources.items():
            if len(places) > 1:
                parts.append(Part(name, "B", float(np.linalg.norm(moved[places]))))
                continue
            parameter = fit.slots[places[0]].parameter
            sd = parameter.sd * (parameter.centre if parameter.transform == "log" else 1.0)
            parts.append(Part(name, "B", float(moved[places[0]]), sd, parameter.unit))
        read = fit.problem.split(white @ moved)
        rest = sum(float(part @ part) for part in read)
        for name, columns in of_columns.items():
            added = sum(
                float(np.sum((of_test.T @ part) ** 2))
                for of_test, part in zip(columns, read, strict=True)
            )
            parts.append(Part(name, "A", added**0.5))
            rest -= added
        sd = float(fit.noise.total())
        parts.append(Part(NOISE, "A", max(rest, 0.0) ** 0.5, sd, "K"))
        if plausible is not None:
            parts.append(Part(SMALL_EFFECTS, "B", float(np.std(effects @ slopes[size:]))))
        return budget(part for part in parts if part.moves)

    return of


def _source(slot: Slot) -> str:
    return OF_ROLE.get(slot.parameter.role, slot.parameter.meaning)


def _columns(fit: Fit) -> Iterator[tuple[str, list[np.ndarray]]]:
    """Yield what joins the noise of the sensors, and its columns of each test [K]."""
    tests = fit.problem.tests
    heat = fit.problem.heat or tuple(np.empty((test.measured.size, 0)) for test in tests)
    yield HEAT, [float(fit.noise.heat) * each for each in heat]
    yield MOMENTS, [test.moments for test in tests]


def _whitened(fit: Fit, columns: list[np.ndarray]) -> list[np.ndarray]:
    """Return columns of each test whitened as the Jacobian, in pieces of its width: what whitens
    that is compiled already.
    """
    width, longest = fit.jacobian[0].shape[1], max(each.shape[1] for each in columns)
    wide = -(-longest // width) * width
    rows = np.concatenate([np.pad(each, ((0, 0), (0, wide - each.shape[1]))) for each in columns])
    nothing = np.zeros(len(rows))
    white = (
        [
            whiten_fit(fit.problem, fit.noise_z, nothing, piece).jacobian
            for piece in np.split(rows, wide // width, axis=1)
        ]
        if wide
        else [rows]
    )
    return fit.problem.split(np.concatenate(white, axis=1))
