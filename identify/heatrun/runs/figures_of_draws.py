r"""A figure of a run from its draws: the values behind each, the figure, its uncertainty budget.

Where a posterior is averaged over effects that the network may miss, the parameters of a draw are
where its effect puts them. The figures of that draw are then those of the network with the effect:
without it, the machine would have another rise than the tests show.

The rule of a budget is that of `heatrun.results.values`, around the fit, whose covariance of the
scores is its $S$. The slope $g$ of a figure by the scores is that of its draws, by least squares.
The readings scatter by the noise of the sensors, by heat that the network misses and by load steps
whose moment nothing tells: with $W W^T$ the inverse of their covariance, the part of columns $H$ in
it is $|(W^T H)^T W^T A S g|$ of the readings' derivative $A$. What small effects behind the draws
add is the scatter of what they move (`heatrun.effects.small_effects`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int

from lptn.effects import AbstractEffect

from ..fit.fit_result import Fit
from ..fit.restricted import whiten_fit
from ..model.draws import Draws, PlausibleEffect, PlausibleEffects, of_network
from ..model.model import Model
from ..model.parameters import Parameter, Slot, amplitudes, effect_parameters, override, qualified
from ..posterior.posterior import Posterior
from ..results.model import DerivedFigure
from ..results.values import BudgetRow, Part, budget, known, number
from .machine import Tested

WIDEST = 2.0
"""Upper over lower end of the 95 % interval of a figure beyond the tested range, at most [1]."""

LIKELY = 0.5
"""Probability from which on a condition names an effect that the network misses [1]."""


class DrawValues(NamedTuple):
    """What the figures are computed from."""

    model: Model  # The network with all effects that stand behind one of the draws.
    # By parameter name [their units], shape (draw,) each; an effect that does not stand behind a
    # draw is at its null.
    values: dict[str, Float[np.ndarray, " draw"]]
    likely: tuple[type[AbstractEffect], ...]  # Effects that the network is likely to miss.


def alone(draws: Draws) -> DrawValues:
    """Return the network without effects that it may miss; events are those of the first test."""
    values = draws.of_test(draws.parameters.tests[0])
    return DrawValues(draws.model, draws.model.in_general(values), ())


def with_effects(draws: Draws, base: DrawValues, seen: Tested) -> DrawValues:
    """Return the network with the effects behind the draws; `base` itself if there are none.

    An effect of one test is none of the machine in general.

    Args:
        draws: Draws.
        base: The network alone.
        seen: The load of the tests; an effect that needs what it does not tell is left out.
    """
    plausible = draws.plausible
    if plausible is None:
        return base
    used = {
        index: each
        for index, each in enumerate(plausible.effects)
        if each.test is None and np.any(plausible.size[:, index]) and not seen.lacks(each.kind)
    }
    if not used:
        return base
    kinds = tuple(dict.fromkeys(effect.kind for effect in used.values()))
    model = replace(base.model, effects=(*base.model.effects, *kinds))
    # where an effect is absent its amplitude alone counts, which no machine's size moves
    own = override(effect_parameters(kinds, 1.0, searched=kinds), draws.motor)
    by_name = {**draws.parameters.by_test[0], **own}
    values = {name: np.array(draws) for name, draws in base.values.items()}
    for kind in kinds:
        for name in kind.card.parameters:
            of_effect = qualified(kind, name)
            values[of_effect] = np.full(plausible.size.shape[0], by_name[of_effect].centre)
    for index, effect in used.items():
        rows = np.flatnonzero(plausible.size[:, index])
        _add(effect, plausible.size[rows, index], rows, by_name, values)
    likely = tuple(each.kind for each in used.values() if each.probability >= LIKELY)
    return DrawValues(model, jax.tree.map(np.asarray, values), likely)


def _add(
    effect: PlausibleEffect,
    size: Float[np.ndarray, " row"],
    rows: Int[np.ndarray, " row"],
    by_name: Mapping[str, Parameter],
    values: Mapping[str, Float[np.ndarray, " draw"]],
) -> None:
    """Put an effect of given sizes behind some draws.

    A resistance that it acts on stands in the draws for its mean over the tests, and moves to where
    the effect has it.
    """
    strong = {qualified(effect.kind, name) for name in amplitudes(effect.kind)}
    own = {qualified(effect.kind, name) for name in effect.kind.card.parameters}
    for name, value in effect.with_effect.items():
        parameter = by_name.get(name)
        if parameter is None or name not in values:
            continue
        if name in strong:
            values[name][rows] = parameter.centre + size * (value - parameter.centre)
        elif name in own:
            values[name][rows] = value
        elif value != effect.without[name]:
            apart = parameter.score(value) - parameter.score(effect.without[name])
            values[name][rows] = parameter.value(parameter.score(values[name][rows]) + size * apart)


def figure(
    draws: np.ndarray, unit: str, condition: str, plausible: PlausibleEffects | None = None
) -> DerivedFigure:
    """Return median, standard deviation and 95 % interval of draws, some of which may be inf.

    Args:
        draws: Shape (draw,) [unit].
        unit: Their unit.
        condition: What they hold under.
        plausible: Effects behind them, where the median is to be of the network alone.
    """
    stated = of_network(plausible, draws)
    finite = np.where(np.isfinite(draws), draws, np.nan)
    if np.mean(np.isfinite(draws)) < 0.975:
        low = np.nanquantile(finite, 0.025) if np.any(np.isfinite(draws)) else np.nan
        return DerivedFigure(
            value=float(np.median(stated)),
            unit=unit,
            sd=float("nan"),
            interval_95=(float(low), float("inf")),
            condition=condition,
        )
    low, high = np.nanquantile(finite, [0.025, 0.975])
    return DerivedFigure(
        value=float(np.nanmedian(np.where(np.isfinite(stated), stated, np.nan))),
        unit=unit,
        sd=float(np.nanstd(finite)),
        interval_95=(float(low), float(high)),
        condition=condition,
    )


def refused(reason: str) -> DerivedFigure:
    """Return what stands where a figure is refused."""
    return DerivedFigure(refused=reason)


def extrapolated(entry: DerivedFigure, short: str, slack: float = 0.0) -> DerivedFigure:
    """Return a figure that says that it lies beyond the tested range, refused where its interval
    says nothing.

    Args:
        entry: The figure.
        short: From `Tested.short_of`.
        slack: What the upper end may lie above `WIDEST` times the lower one, which may then be 0.
    """
    if not short or known(entry.refused):
        return entry
    low, high = entry.ends
    if not (low > 0.0 or slack > 0.0) or not low <= high <= WIDEST * low + slack:
        return refused(f"the tests do not tell, {short}")
    word = "" if ", extrapolated, " in str(entry.condition) else "extrapolated, "
    return replace(entry, condition=f"{entry.condition}, {word}{short}")


def steady_rise(draws: np.ndarray, condition: str, seen: Tested) -> DerivedFigure:
    """Return a steady rise [K]."""
    entry = figure(draws, "K", condition)
    return extrapolated(entry, seen.short_of(degC=seen.sink_degC + entry.median))


Budget = Callable[..., tuple[BudgetRow, ...]]
"""Gives the budget of a figure from its draws, shape (draw,), and from further parts; `picked` says
which draws they are of, where not of all."""


def with_budget(
    entry: DerivedFigure,
    draws: np.ndarray,
    budget: Budget | None,
    picked: Int[np.ndarray, " draw"] | None = None,
) -> DerivedFigure:
    """Return a figure with where its uncertainty comes from, if it is stated and all draws have it.

    Args:
        entry: The figure.
        draws: What it is of, shape (draw,).
        budget: As `budget_of`; None for none.
        picked: Which of the posterior's draws they are of; None for all.
    """
    if budget is None or known(entry.refused) or not np.all(np.isfinite(draws)):
        return entry
    more = more_of(number(known(entry.sd)), draws)
    return replace(entry, budget=budget(draws, *more, picked=picked))


def more_of(sd: float, draws: np.ndarray) -> list[Part]:
    """Return the part of an uncertainty that `over_sets` has added to that of the draws."""
    wider = sd**2 - float(np.var(draws))
    return [Part(UNDECIDED, "B", math.sqrt(wider))] if wider > 1e-9 * sd**2 else []


def over_sets(
    ends: tuple[float, float], sd: float, draws: Float[np.ndarray, " draw"]
) -> tuple[tuple[float, float], float]:
    """Return a 95 % interval that holds that of networks which the tests do not tell apart, and a
    standard uncertainty that goes with it.

    Args:
        ends: The interval of the network that is stated.
        sd: Its standard uncertainty.
        draws: The figure in all these networks.
    """
    low, high = np.nanquantile(np.where(np.isfinite(draws), draws, np.nan), [0.025, 0.975])
    both = min(ends[0], float(low)), max(ends[1], float(high))
    return both, max(sd, 0.25 * (both[1] - both[0]))


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
    plain = posterior if posterior.alone is None else posterior.alone
    effects = np.empty((len(plain.flat), 0)) if plausible is None else plausible.size
    behind = np.concatenate([plain.flat[:, :size], effects], axis=1)
    behind -= behind.mean(axis=0)
    products = np.linalg.pinv(
        behind.T @ behind, rcond=np.finfo(float).eps * len(behind), hermitian=True
    )
    to_slopes = products @ behind.T
    sources: dict[str, list[int]] = {}
    for place, slot in enumerate(fit.slots):
        sources.setdefault(_source(slot), []).append(place)

    def of(
        draws: Float[np.ndarray, " draw"],
        *more: Part,
        picked: Int[np.ndarray, " draw"] | None = None,
    ) -> tuple[BudgetRow, ...]:
        apart = draws - np.mean(draws)
        if picked is None:
            slopes = to_slopes @ apart
        else:
            some = behind[picked] - behind[picked].mean(axis=0)
            slopes = np.linalg.lstsq(some, apart, rcond=np.finfo(float).eps * len(some))[0]
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
