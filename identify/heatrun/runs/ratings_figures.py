"""Figures that follow from the parameters: time constants, resistances, rises, currents, times.

Each comes with an interval and the condition it holds under, or is refused with a reason.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from lptn import (
    Drive,
    Network,
    linearise,
    link_resistances,
    steady_current,
    steady_state,
    time_constants,
    time_to,
)

from ..io.programs import compiled
from ..io.quantities import rounded
from ..model.draws import PlausibleEffects
from ..model.model import Model
from ..posterior.identifiability import by_uncertainty
from ..posterior.posterior import Posterior
from ..results.model import AT_REST, LOADED, DerivedFigure
from ..results.values import known, number
from .duties import (
    Limit,
    Rated,
    at_limit,
    current_by_rms,
    duty_current,
    held,
    limits_of,
    simulated,
    within_rise,
)
from .figures_of_draws import (
    Budget,
    DrawValues,
    alone,
    extrapolated,
    figure,
    over_sets,
    refused,
    steady_rise,
    with_budget,
    with_effects,
)
from .machine import Machine, Tested, UnderLoad, fixed_losses, machines, tested, under_load
from .stated_duty import STANDING, Duty, Phase, Stated, other_nodes, parse_rating, phase_words


class Rates(NamedTuple):
    """What one draw says; arrays over draws where many are evaluated."""

    # Capacity times resistance of each node and its only way to the sink [s]; empty where a node
    # has several.
    node_times: dict[str, Float[Array, "*draw"]]
    A: Float[Array, "*draw node node"]  # State matrix without current [1/s], shape (node, node).
    # State matrix at the loaded part's current, with R(T) and the other losses held as for the
    # steady rise [1/s], shape (node, node).
    A_fed: Float[Array, "*draw node node"]
    follows_time: Array  # Whether an effect depends on the time since the start of a test.


@compiled("model", is_seldom=True)
def rates(
    model: Model, values: dict[str, Float[Array, " draw"]], loaded: Drive, winding: Float[Array, ""]
) -> Rates:
    """Return the rates of each draw; compiled once per model.

    Args:
        model: Network with effects.
        values: Parameters of the machine in general by name [their units].
        loaded: The loaded part of the tests.
        winding: Mean reading of the loaded part [degC]; where laws bend with the temperature, the
            rates are those with the winding there.
    """

    def one(values: dict[str, Float[Array, ""]]) -> Rates:
        under = under_load(model, values, loaded, winding)
        network, rated, drive, effects = under
        losses = model.losses(values)
        at = _with_winding_at(under, winding)
        timeless = replace(loaded, time=jnp.asarray(jnp.nan))
        return Rates(
            node_times=node_times(network),
            A=linearise(network, losses, loaded.scale_current(0.0), at, effects=effects).A,
            A_fed=linearise(network, rated, drive, at, effects=effects).A,
            # no time at all is seen by whoever looks at it
            follows_time=jnp.any(
                jnp.isnan(linearise(network, losses, timeless, at, effects=effects).offset)
            ),
        )

    return jax.vmap(one)(values)


def _with_winding_at(at: UnderLoad, winding: Float[Array, ""]) -> dict[str, Float[Array, ""]]:
    """Return the temperatures at rest with the winding held at one [degC]."""
    held = steady_current(at.network, at.losses, at.drive, winding, effects=at.effects)
    return {node: jnp.where(jnp.isfinite(T), T, winding) for node, T in held.temperature.items()}


def node_times(network: Network) -> dict[str, Float[Array, ""]]:
    """Return capacity times resistance of each node and its link towards the sink [s].

    Empty if there is one node, which has no other time, or if a node has several ways.
    """
    if len(network.nodes) == 1 or len(network.links) != len(network.nodes):
        return {}
    way: dict[str, Float[Array, ""]] = {}
    reached = {network.boundary}
    while True:
        new = {
            near: network.resistance[link]
            for link in network.links
            for near, far in (link, link[::-1])
            if far in reached and near not in reached
        }
        if not new:
            break
        way |= new
        reached |= set(new)
    if set(way) != set(network.nodes):
        return {}
    return {node: network.capacitance[node] * way[node] for node in network.nodes}


SAME = 1e-3
"""Relative difference up to which a resistance at conditions is the parameter itself [1]."""


PRINTED, UNSEEN = (0.025, 0.5, 0.975), 0.1
"""Quantiles of a resistance that the page has, and differences in them that it does not show
[standard deviations]."""


def at_conditions(
    draw_values: DrawValues,
    seen: Tested,
    plausible: PlausibleEffects | None,
    budget: Budget | None = None,
    undecided: DrawValues | None = None,
) -> dict[str, DerivedFigure]:
    """Return the resistances that effects change, at the mean load of the tests and at rest.

    At rest they stand for the same temperatures. What an effect that the network may miss would
    change is in the interval, not in the value; so is what they are in networks that the tests do
    not tell from it.

    Args:
        draw_values: The network with all effects behind the draws.
        seen: The load.
        plausible: The effects that the network may miss; None for none.
        budget: Gives the budget of draws; None for none.
        undecided: Networks that the tests do not tell apart; None where they tell one.
    """
    figures = {}
    others = {} if undecided is None else resistances(undecided, seen)
    for name, at in resistances(draw_values, seen).items():
        own = np.asarray(draw_values.values[name])
        if AT_REST not in at and _prints_same(at[LOADED][0], own):
            continue
        for ending, (draws, words) in at.items():
            other = others.get(name, {})  # at rest as under load, where no law has the speed
            there = other.get(ending, other.get(LOADED))
            entry = figure(draws, "K/W", words, plausible)
            if there is not None:
                both, sd = over_sets(entry.ends, number(known(entry.sd)), there[0])
                entry = replace(entry, interval_95=both, sd=sd)
            grade = by_uncertainty(number(known(entry.sd)) / entry.median)
            entry = replace(with_budget(entry, draws, budget), identifiability=grade)
            figures[f"{name}{ending}"] = entry
    return figures


def _prints_same(one: Float[np.ndarray, " draw"], other: Float[np.ndarray, " draw"]) -> bool:
    """Return whether two laws have the same median and interval, as the page has them."""
    if np.allclose(one, other, rtol=SAME, equal_nan=True):
        return True
    apart = np.quantile(one, PRINTED) - np.quantile(other, PRINTED)
    return bool(np.all(np.abs(apart) <= UNSEEN * np.std(other) + SAME * np.abs(np.mean(other))))


def resistances(
    draw_values: DrawValues, seen: Tested
) -> dict[str, dict[str, tuple[Float[np.ndarray, " draw"], str]]]:
    """Return each resistance at the mean load [K/W], and at rest where it differs there.

    Args:
        draw_values: The network with all effects behind the draws.
        seen: The load.

    Returns:
        Draws and what they hold under, by name of the parameter and by `LOADED` or `AT_REST`.
    """
    winding = np.asarray(seen.loaded_winding_degC)
    speed = seen.loaded.speed
    nodes, loaded = _at(draw_values.model, draw_values.values, seen.loaded, seen.loaded, winding)
    rest = loaded
    if speed is not None:
        still = replace(seen.loaded, speed=0.0 * speed, speed_rad=0.0 * speed)
        rest = _at(draw_values.model, draw_values.values, seen.loaded, still, winding)[1]
    return {
        parameter.name: {
            ending: (
                np.asarray(at[link]), _condition(seen, nodes, link, is_at_rest=ending == AT_REST)
            )
            for ending, at in ((LOADED, loaded), (AT_REST, rest))
            if ending == LOADED or not _prints_same(np.asarray(at[link]), np.asarray(loaded[link]))
        }
        for link, parameter in draw_values.model.form.resistance
    }  # fmt: skip


@compiled("model", is_seldom=True)
def _at(
    model: Model,
    values: dict[str, Float[Array, " draw"]],
    loaded: Drive,
    drive: Drive,
    winding: Float[Array, ""],
):
    """Return temperatures with the winding where it was under load in the tests [degC], and
    resistances there under another drive [K/W].
    """

    def one(values: dict[str, Float[Array, ""]]):
        at = under_load(model, values, loaded, winding)
        T = _with_winding_at(at, winding)
        own = replace(drive, losses=at.drive.losses)
        return T, link_resistances(at.network, at.losses, own, T, effects=at.effects)

    return jax.vmap(one)(values)


def _condition(
    seen: Tested, nodes: dict[str, Array], link: tuple[str, str], *, is_at_rest: bool
) -> str:
    """Return what a resistance holds under, in words."""
    parts = []
    rpm = seen.loaded.speed_rad
    if rpm is not None:
        parts.append("0 rpm" if is_at_rest else f"{float(rpm) * 30.0 / np.pi:.0f} rpm")
    parts += [f"{end} {float(np.nanmedian(nodes[end])):.0f} °C" for end in link if end in nodes]
    return ", ".join([*parts, f"sink {seen.sink_degC:.0f} °C"])


def derive(
    posterior: Posterior,
    duties: Sequence[str] = (),
    budget: Budget | None = None,
    undecided: DrawValues | None = None,
) -> dict[str, DerivedFigure]:
    """Return the derived figures by name, as they stand in `fit.json`.

    Args:
        posterior: Draws, of any network with any effects.
        duties: Ratings asked for, such as `"S2-30"` and `"time:150A:hot"`, as `parse_rating`.
        budget: From `budget_of`, of what stands on page 1 and of the ratings; None for none.
        undecided: Networks that the tests do not tell apart; None where they tell one.

    Raises:
        UsageError: If a rating is none of these.
    """
    problem = posterior.fit.problem
    seen = tested([test.winding for test in problem.tests])
    limit, rise = limits_of(problem.motor, seen.sink_degC)
    draws = posterior.draws
    base = alone(draws)
    draw_values = with_effects(draws, base, seen)
    winding = np.asarray(seen.loaded_winding_degC)
    degC = np.asarray(np.nan if limit is None else limit.degC)
    network = rates(base.model, base.values, seen.loaded, winding)
    rated = problem.motor.rated_current_A if seen.amperes > 0.0 else None
    scale = 1.0 if rated is None else (rated / seen.amperes) ** 2
    top = np.asarray(np.nan if rise is None else rise.degC)
    at_load = seen.loaded, winding, degC, np.asarray(scale), top
    drawn = machines(draw_values.model, draw_values.values, *at_load)
    times = time_constants(network.A)
    around = partial(
        seen.surroundings,
        base.model.effects,
        follows_time=bool(np.any(np.asarray(network.follows_time))),
        second_sink=base.model.form.second_sink,
    )
    is_fed = bool(np.any(np.asarray(drawn.copper_slope)))
    figures = {}
    if base.model.effects:
        figures = at_conditions(draw_values, seen, draws.plausible, budget, undecided)
    figures |= _time_constants(network, is_fed, times, seen.amperes, around())
    surroundings = around(likely=draw_values.likely)
    heated = (
        f"other losses {np.median(drawn.other):.0f} W, sink {seen.sink_degC:.0f} °C{surroundings}"
    )
    at = f"{rounded(seen.amperes)} A rms" if rated is None else f"rated current {rounded(rated)} A"
    figures["steady_rise_K"] = steady_rise(np.asarray(drawn.rise), f"{at}, {heated}", seen)
    figures |= at_limit(drawn, seen, limit, heated)
    if rise is not None:
        figures |= within_rise(drawn, seen, rise, at, heated)
    permitted_K = 0.0 if rise is None else known(rise.rise_K) or 0.0
    if undecided is not None:
        of_sets = machines(undecided.model, undecided.values, *at_load)
        figures = _over_sets(figures, _rises_and_currents(of_sets, permitted_K))
    if budget is not None:
        behind = _rises_and_currents(drawn, permitted_K)
        behind |= dict(zip(names_of_times(times.shape[-1]), times.T, strict=True))
        figures = {
            name: with_budget(entry, behind[name], budget) if name in behind else entry
            for name, entry in figures.items()
        }
    if not duties:
        return figures
    fast_s = float(np.median(times[:, 0]))
    if draw_values is not base:  # the body of an effect may be faster
        times = time_constants(rates(draw_values.model, draw_values.values, seen.loaded, winding).A)
    # as the map of ratings and the margin of page 1: the permitted rise where the class has one
    machine = Rated(draw_values, drawn, times, seen, rise or limit, surroundings,
                    rated or seen.amperes, budget)  # fmt: skip
    by = "continuous_current_A" if rise is None else "continuous_current_by_rise_A"
    for text in duties:
        figures |= rating(machine, text, figures[by], rated, fast_s)[1]
    return figures


def _rises_and_currents(drawn: Machine, permitted_K: float) -> dict[str, np.ndarray]:
    """Return the draws behind the steady rise, its margin and the continuous currents by name."""
    found = {
        "steady_rise_K": drawn.rise,
        "rise_margin_K": permitted_K - drawn.rise,
        "continuous_current_A": jnp.sqrt(drawn.limit_squared),
        "continuous_current_by_rise_A": jnp.sqrt(drawn.permitted_squared),
    }
    return {name: np.asarray(draws) for name, draws in found.items()}


def _over_sets(
    figures: Mapping[str, DerivedFigure], of_sets: Mapping[str, np.ndarray]
) -> dict[str, DerivedFigure]:
    """Return figures whose intervals hold what they are in networks that are not told apart."""
    found = dict(figures)
    for name, draws in of_sets.items():
        entry = found.get(name)
        if entry is not None and np.all(np.isfinite(entry.ends)) and np.any(np.isfinite(draws)):
            both, sd = over_sets(entry.ends, number(known(entry.sd)), draws)
            found[name] = replace(entry, interval_95=both, sd=sd)
    return found


def rating(
    rated: Rated,
    text: str,
    by_S1: DerivedFigure,
    rated_A: float | None,
    fast_s: float,
    nodes: Sequence[Collection[str]] = (),
) -> tuple[Duty | Stated, dict[str, DerivedFigure]]:
    """Return what a text of `--rating` asks for, and the figures that answer it, by name.

    Args:
        rated: The machine.
        text: As `parse_rating`.
        by_S1: Its continuous current.
        rated_A: Rated current [A]; None where the motor file gives none.
        fast_s: Fastest time constant of the network alone [s].
        nodes: As `parse_rating`.

    Raises:
        UsageError: As `parse_rating`.
    """
    asked = parse_rating(text, float(np.median(rated.times[:, -1])), rated_A, nodes)
    if isinstance(asked, Stated):
        return asked, until_limit(rated, asked)
    current = by_S1 if text == "S1" else duty_current(rated, asked)
    found = {f"{asked.name}_current_A": current}
    is_file = text.lower().endswith(".csv")
    by_rms = current_by_rms(rated, asked, current, fast_s) if is_file else None
    return asked, found if by_rms is None else {**found, f"{asked.name}_rms_current_A": by_rms}


def _time_constants(
    network: Rates, is_fed: bool, times: np.ndarray, amperes: float, surroundings: str
) -> dict[str, DerivedFigure]:
    """Return all time constants, of the nodes and of the network."""
    figures = {
        f"tau_{node}_s": figure(
            np.asarray(draws), "s", f"capacity of the {node} times its resistance towards the sink"
        )
        for node, draws in sorted(network.node_times.items(), reverse=True)
    }
    num = times.shape[-1]
    text = "eigenvalue of the network, constant copper loss"
    for name, draws in zip(names_of_times(num), times.T, strict=True):
        figures[name] = figure(draws, "s", text + surroundings)
    if is_fed:
        fed = time_constants(network.A_fed)
        text = f"eigenvalue with R(T) at {rounded(amperes)} A"
        for name, draws in zip(names_of_times(num, "_feedback"), fed.T, strict=True):
            figures[name] = figure(draws, "s", text + surroundings)
    return figures


def names_of_times(num: int, suffix: str = "") -> list[str]:
    """Return the names of a network's time constants, shortest first."""
    if num == 1:
        return [f"tau{suffix}_s"]
    middle = [str(number) for number in range(2, num)]
    return [f"tau_{word}{suffix}_s" for word in ("fast", *middle, "slow")]


State = Mapping[str, Array | np.ndarray]

MOST_STARTS = 20
"""Starts in succession that are looked at; a machine that bears them bears more."""

LONGEST_PAUSE, NUM_HALVINGS = 5.0, 20
"""Longest pause that is looked at over the slow time constant [1], and halvings of it."""


def until_limit(rated: Rated, asked: Stated) -> dict[str, DerivedFigure]:
    """Return the time to the limit, or the starts until it and the pause before the next one."""
    name = f"time_to_limit_{asked.name}_s"
    names = [f"{what}_{asked.name}_{start}{unit}" for start in ("cold", "hot")
             for what, unit in (("starts", ""), ("pause", "_s"))]  # fmt: skip
    if rated.limit is None or rated.refusal():
        return dict.fromkeys([name] if asked.start else names, refused(rated.refusal()))
    if asked.start is not None:
        return {name: _time(rated, asked.phases[0].current, asked.start, rated.limit)}
    both = [each for start in ("cold", "hot") for each in _starts(rated, asked, start, rated.limit)]
    return dict(zip(names, both, strict=True))


def _time(
    rated: Rated, current: float, start: str | float | Mapping[str, float], limit: Limit
) -> DerivedFigure:
    """Return the time for which a current may be held from a state."""
    nodes, amperes = rated.draw_values.model.form.nodes, f"{rounded(current)} A"
    if why := other_nodes(start, [nodes]):
        return refused(why)
    state, words = _state(rated, start, limit)
    times = _held(rated, current, state, limit)[1]
    chance = 100.0 * np.mean(np.isfinite(times))
    if not np.isfinite(np.median(times)):
        never = f"never with a probability of {100.0 - chance:.0f} %"
        return refused(f"{never}, {amperes} does not reach {limit.degC:.0f} °C")
    if np.median(times) == 0.0:
        return refused(f"{words}, the winding is at {limit.degC:.0f} °C or above at the start")
    reached = "" if chance == 100.0 else f"reached with a probability of {chance:.0f} %, "
    entry = figure(times, "s", f"{reached}{amperes}, {words}, {_heated(rated, limit)}")
    found = extrapolated(entry, rated.seen.short_of(degC=limit.degC, amperes=current))
    return with_budget(found, times, rated.budget, rated.picked)


def _starts(
    rated: Rated, asked: Stated, start: str, limit: Limit
) -> tuple[DerivedFigure, DerivedFigure]:
    """Return the number of successive starts until the limit, and the pause before the next."""
    seen, sample = rated.seen, rated.sample
    state, words = _state(rated, start, limit)
    said = ", ".join(phase_words(phase, "A") for phase in asked.phases)
    words = f"by the winding alone, {said}, {words}, {_heated(rated, limit)}"
    short = seen.short_of(degC=limit.degC, amperes=max(p.current for p in asked.phases))
    # phases are in amperes
    factor = np.full(sample.other.size, 1.0 / float(seen.loaded.current_squared))

    def after(phases: tuple[Phase, ...], state: State, length: np.ndarray | float = 1.0):
        return simulated(
            rated.draw_values.model, sample.values, seen.loaded, sample.other, factor,
            held(phases, seen.loaded, sample.longest_s), jnp.asarray(1), dict(state),
            np.broadcast_to(length, factor.shape),
        )  # fmt: skip

    states, counts, is_within = [state], np.zeros(factor.size), np.ones(factor.size, bool)
    while is_within.any() and len(states) <= MOST_STARTS:
        last, top = after(asked.phases, states[-1])
        is_within &= np.asarray(top) < limit.degC
        counts += is_within
        states.append(last)
    median = int(np.median(counts))
    if median == MOST_STARTS:
        never = refused(f"{MOST_STARTS} starts do not reach {limit.degC:.0f} °C")
        return never, never
    low, high = np.quantile(counts, [0.025, 0.975])
    ends = float(np.floor(low)), float(np.ceil(high))
    found = DerivedFigure(value=median, unit="", sd=None, interval_95=ends, condition=words)
    found = extrapolated(found, short, slack=1.0)
    if refusal := known(found.refused):
        return found, refused(refusal)
    longest = LONGEST_PAUSE * float(np.median(rated.times[:, -1]))
    rest = (Phase(longest, **STANDING),)

    def is_hot(share: np.ndarray | float) -> np.ndarray:
        rested = after(rest, states[median], share)[0]
        return ~(np.asarray(after(asked.phases, rested)[1]) < limit.degC)

    is_never, is_waiting = is_hot(1.0), is_hot(0.0)
    if np.mean(is_never) >= 0.5:
        return found, refused(f"one start from cold reaches {limit.degC:.0f} °C")
    soon, late = np.zeros(factor.size), np.ones(factor.size)
    for _ in range(NUM_HALVINGS):
        middle = 0.5 * (soon + late)
        hot = is_hot(middle)
        soon, late = np.where(hot, middle, soon), np.where(hot, late, middle)
    pause = np.where(is_never, np.inf, np.where(is_waiting, longest * late, 0.0))
    entry = figure(pause, "s", f"at rest after {median} starts, then one more, {words}")
    entry = extrapolated(entry, short, slack=np.inf)
    return found, with_budget(entry, pause, rated.budget, rated.picked)


def _state(
    rated: Rated, start: str | float | Mapping[str, float], limit: Limit
) -> tuple[State, str]:
    """Return the temperature of each node at the start [degC], and the start in words.

    A winding of a stated temperature has the other parts in proportion: each as far between the
    sink and the steady state at the rated current as it is itself.
    """
    cold, sink = rated.sample.cold, rated.seen.sink_degC
    if isinstance(start, Mapping):
        said = ", ".join(f"{node} {T:g} °C" for node, T in start.items())
        size = rated.sample.other.size
        return {node: np.full(size, T) for node, T in start.items()}, f"at the start {said}"
    if start == "cold":
        return cold, "from the sink's temperature"
    # where the copper runs away, it passes the limit on its way
    rest = {node: np.where(np.isfinite(T), T, limit.degC)
            for node, T in _held(rated, rated.rated_A, cold, limit)[0].items()}  # fmt: skip
    if isinstance(start, str):
        return rest, f"from the steady state at {rounded(rated.rated_A)} A"
    share = (start - sink) / (rest[rated.draw_values.model.form.copper] - sink)
    return {node: sink + share * (T - sink) for node, T in rest.items()}, (
        f"from a winding at {start:g} °C, other parts in proportion to the steady rise"
    )


def _heated(rated: Rated, limit: Limit) -> str:
    watts, sink = np.median(rated.sample.other), rated.seen.sink_degC
    return f"{limit}, other losses {watts:.0f} W under load, sink {sink:.0f} °C{rated.surroundings}"


def _held(rated: Rated, current: float, state: State, limit: Limit) -> tuple[State, np.ndarray]:
    """Return where each draw comes to rest under a current [degC], and its time to the limit."""
    sample, loaded = rated.sample, rated.seen.loaded
    squared = np.asarray(current**2 / loaded.current_squared)
    rest, times = _rest_and_time(rated.draw_values.model, sample.values, loaded, sample.other,
                                 squared, dict(state), np.asarray(limit.degC))  # fmt: skip
    return {node: np.asarray(T) for node, T in rest.items()}, np.asarray(times)


@compiled("model", is_seldom=True)
def _rest_and_time(
    model: Model,
    values: dict[str, Float[Array, " draw"]],
    loaded: Drive,
    other: Float[Array, " draw"],
    factor: Float[Array, ""],
    start: dict[str, Float[Array, " draw"]],
    limit: Float[Array, ""],
) -> tuple[dict[str, Float[Array, " draw"]], Float[Array, " draw"]]:
    """As `_held`, under a squared current over that of the tests [1]."""

    def one(values, other, start):
        network, effects = model.network(values), model.built_effects(values)
        losses = fixed_losses(model.losses(values))
        drive = replace(loaded.scale_current(factor), losses=other)
        rest = steady_state(network, losses, drive, effects=effects)
        return rest, time_to(network, losses, drive, start, node=network.copper_node, limit=limit,
                             effects=effects, steady=rest)  # fmt: skip

    return jax.vmap(one)(values, other, start)
