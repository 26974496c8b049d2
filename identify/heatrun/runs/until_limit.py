"""Time to the limit from any state, and permissible starts: the current is given, not sought."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from lptn import Drive, steady_state, time_to

from ..io.programs import compiled
from ..io.quantities import rounded
from ..model.model import Model
from ..results.model import DerivedFigure
from ..results.values import known
from .duties import Limit, Rated, held, simulated
from .machine import extrapolated, figure, fixed_losses, refused
from .stated_duty import AT_REST, Phase, Stated, phase_words

State = Mapping[str, Array | np.ndarray]

MOST_STARTS = 20
"""Starts in succession that are looked at; a machine that bears them bears more."""

LONGEST_PAUSE, NUM_HALVINGS = 5.0, 20
"""Longest pause that is looked at over the slow time constant [1], and halvings of it."""


def until_limit(rated: Rated, asked: Stated) -> dict[str, DerivedFigure]:
    """Return the time to the limit, or the starts until it and the pause before the next one.

    Args:
        rated: The machine.
        asked: The load.
    """
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
    if isinstance(start, Mapping) and set(start) != set(nodes):
        got = " and ".join(start)
        return refused(f"expected start temperatures of {' and '.join(nodes)}, got {got}")
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
    return extrapolated(entry, rated.seen.short_of(degC=limit.degC, amperes=current))


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
    rest = (Phase(longest, **AT_REST),)

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
    return found, extrapolated(entry, short, slack=np.inf)


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
