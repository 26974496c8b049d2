"""Currents at the insulation limit: continuous, of duty types, and of any duty by simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from lptn import Drive, hold

from ..io.programs import compiled
from ..io.quantities import rounded
from ..model.model import Model
from ..record.motor import LIMIT_DEGC, Motor
from ..results.model import DerivedFigure
from ..results.values import known, number
from .figures_of_draws import (
    Budget,
    DrawValues,
    extrapolated,
    figure,
    refused,
    steady_rise,
    with_budget,
)
from .machine import RAD_PER_S, WARM, Machine, Tested, fixed_losses
from .stated_duty import Duty, Phase

NUM_DRAWS = 300
"""Draws behind a rating: each is a search over simulated duties."""

LARGEST = 6.0
"""Largest current of the search over the largest one tested [1]."""

BRACKETS = (0.25, 0.5, 1.0)
"""Shares of that current up to which it is sought, one after the other [1]."""

CLOSE_K, MOST_STEPS = 1e-3, 24
"""How near to the limit the search ends [K], and steps at most; it takes about five."""


def current_at_limit(
    duty: Duty,
    highest: Callable[[np.ndarray, Duty], np.ndarray],
    limit_degC: float,
    largest_A: float,
    num_draws: int,
) -> np.ndarray:
    """Return the rms current at which the winding just reaches its limit [A], shape (draw,).

    The temperature follows the squared current nearly along a line as long as nothing runs away;
    beyond, what it says is bounded, so that where the line between both ends of a bracket crosses
    the limit is near to it.

    Args:
        duty: The duty.
        highest: Returns the highest winding temperature [degC] for currents [A] of each draw.
        limit_degC: Limit of the insulation class.
        largest_A: Upper end of the search; draws that stay below the limit there return inf, and
            0 where no current does.
        num_draws: Number of draws.

    Reference: M. Dowell, P. Jarratt, A modified regula falsi method for computing the root of an
        equation, BIT 11 (1971) 168-174 (Illinois: an end that stays twice counts half).
    """

    def above(squared: np.ndarray) -> np.ndarray:
        # far above the limit a law may leave what numbers hold: no number is hot
        found = highest(np.sqrt(squared), duty) - limit_degC
        return np.where(np.isnan(found), np.inf, found)

    low, high = np.zeros(num_draws), np.zeros(num_draws)
    at_low = at_high = above(low)
    is_never, usual = at_low >= 0.0, np.maximum(-at_low, 1.0)
    for share in BRACKETS:
        is_cold = at_high < 0.0
        if not is_cold.any():
            break
        low, at_low = np.where(is_cold, high, low), np.where(is_cold, at_high, at_low)
        high = np.where(is_cold, (share * largest_A) ** 2, high)
        at_high = above(high)
    is_beyond = at_high < 0.0

    def bounded(above_K: np.ndarray) -> np.ndarray:
        capped = np.minimum(above_K, 1e30)
        return capped / (np.abs(capped) + usual)

    below_end, above_end = bounded(at_low), bounded(at_high)
    middle, was_hot = high, np.full(num_draws, np.nan)
    for _ in range(MOST_STEPS):
        with np.errstate(invalid="ignore", divide="ignore"):  # of draws without an answer
            line = low - below_end * (high - low) / (above_end - below_end)
        middle = np.where(is_beyond | is_never, high, np.clip(line, low, high))
        found = above(middle)
        if np.all((np.abs(found) < CLOSE_K) | is_beyond | is_never):
            break
        is_hot = found >= 0.0
        stays = np.where(was_hot == is_hot, 0.5, 1.0)
        low, high = np.where(is_hot, low, middle), np.where(is_hot, middle, high)
        below_end = np.where(is_hot, stays * below_end, bounded(found))
        above_end = np.where(is_hot, bounded(found), stays * above_end)
        was_hot = is_hot.astype(float)
    return np.where(is_beyond, np.inf, np.where(is_never, 0.0, np.sqrt(middle)))


SAME_SHAPE = 4
"""Duties are filled up to a multiple of so many phases."""

STEPS_PER_TIME_CONSTANT = 10
"""Steps over the shortest time constant of the median draw [1]."""


@dataclass(frozen=True)
class Rated:
    """A machine that is to be rated."""

    draw_values: DrawValues  # Model and values behind each draw.
    drawn: Machine  # The machine of each draw.
    # Its time constants [s], shape (draw, node), shortest first.
    times: Float[np.ndarray, "draw node"]
    seen: Tested  # Range of the tests.
    # The permitted rise, else the temperature of the class; None if no class is given.
    limit: Limit | None
    surroundings: str  # As `heatrun.runs.machine.Tested.surroundings`.
    rated_A: float = math.nan  # The rated current, else that of the loaded tests [A].
    budget: Budget | None = None  # Gives the budget of draws; None for none.

    @cached_property
    def picked(self) -> Int[np.ndarray, " draw"]:
        """Which draws ratings are simulated with."""
        return np.random.default_rng(0).permutation(self.times.shape[0])[:NUM_DRAWS]

    @cached_property
    def sample(self) -> Sample:
        """The draws that ratings are simulated with."""
        picked = self.picked
        return Sample(
            values={name: draws[picked] for name, draws in self.draw_values.values.items()},
            other=np.asarray(self.drawn.other)[picked],
            longest_s=float(np.median(self.times[picked, 0])) / STEPS_PER_TIME_CONSTANT,
            cold={node: np.full(picked.size, self.seen.sink_degC)
                  for node in self.draw_values.model.form.nodes},
        )  # fmt: skip

    def refusal(self) -> str:
        """Return why nothing can be rated; empty where it can."""
        if self.limit is None:
            return NO_CLASS
        return "" if np.any(self.drawn.copper_slope) else NO_CURRENT


class Sample(NamedTuple):
    """Draws of a machine."""

    values: dict[str, Float[np.ndarray, " draw"]]  # Its parameters by name.
    other: Float[np.ndarray, " draw"]  # Other losses of the loaded part [W].
    longest_s: float  # Longest step of a simulation [s].
    cold: dict[str, Float[np.ndarray, " draw"]]  # Each node at the temperature of the sink [degC].


def duty_current(rated: Rated, duty: Duty) -> DerivedFigure:
    """Return the largest current of a duty at the limit; at rest it stands still without losses."""
    if rated.limit is None or rated.refusal():
        return refused(rated.refusal())
    seen, limit = rated.seen, rated.limit
    values, other, longest_s, cold = rated.sample
    phases = held(duty.phases, seen.loaded, longest_s)

    def highest(current: np.ndarray, duty: Duty) -> np.ndarray:
        factor = jnp.asarray(current) ** 2 / seen.loaded.current_squared
        top = simulated(rated.draw_values.model, values, seen.loaded, other, factor, phases,
                        jnp.asarray(duty.num_cycles), cold, np.ones(other.size))[1]  # fmt: skip
        return np.asarray(top)

    losses = f"other losses {np.median(other):.0f} W under load"
    if duty.num_cycles == 1 or any(phase.other_W == 0.0 for phase in duty.phases):
        losses += ", none at rest"
    losses = f"other losses {duty.losses}" if duty.losses else losses
    current = current_at_limit(duty, highest, limit.degC, LARGEST * seen.current_A, other.size)
    entry = figure(
        current,
        "A",
        f"{duty.words}, {limit}, {losses}, sink {seen.sink_degC:.0f} °C{rated.surroundings}",
    )
    if not math.isfinite(entry.median):
        return refused(f"{rounded(LARGEST * seen.current_A)} A does not reach {limit.degC:.0f} °C")
    if entry.median == 0.0:
        return refused(f"the other losses alone lead to {limit.degC:.0f} °C")
    largest = entry.median * max(phase.current for phase in duty.phases)
    found = extrapolated(entry, seen.short_of(degC=limit.degC, amperes=largest))
    return with_budget(found, current, rated.budget, rated.picked)


SHORT_CYCLE = 0.5
"""Longest cycle over the fastest time constant [1] that counts as short: the winding then peaks by
a sixteenth of its own rise above its mean at most, d (1 - d)/2 of the cycle for a share d under
load."""

SAME_HEAT = 0.05
"""Difference of the mean other losses over all losses [1] up to which the current alone decides."""


def current_by_rms(
    rated: Rated, duty: Duty, exact: DerivedFigure, fast_s: float
) -> DerivedFigure | None:
    """Return the current of a duty by the rms of its cycle; None without an exact one.

    The rms of the cycle is taken for the continuous current, as where a constant load is said to be
    equivalent to a duty: the rating for equivalent loading of IEC 60034-1 (from memory, to be
    compared with the edition in force). IEC 60034-29 is of tests of machines that cannot be loaded,
    and gives no such rule of currents.

    Args:
        rated: The machine.
        duty: The duty.
        exact: Its current by simulation.
        fast_s: Fastest time constant of the network [s].
    """
    if rated.limit is None or known(exact.refused) or not math.isfinite(exact.median):
        return None
    drawn, limit = rated.drawn, rated.limit
    seconds = np.array([phase.seconds for phase in duty.phases])
    share = seconds / np.sum(seconds)
    rms = math.sqrt(np.sum(share * np.array([phase.current for phase in duty.phases]) ** 2))
    at_end = drawn.limit_squared if limit.rise_K is None else drawn.permitted_squared
    square = np.maximum(np.asarray(at_end), 0.0)
    found = figure(
        np.sqrt(square) / rms, "A",
        f"{limit}, rms of the cycle {rounded(100.0 * rms)} % of its largest current",
    )  # fmt: skip
    apart = 100.0 * (found.median / exact.median - 1.0)
    differs = (
        f"it permits {abs(apart):.1f} % {'more' if apart > 0.0 else 'less'} than by simulation"
    )
    other = float(np.median(drawn.other))
    watts = [other if phase.other_W is None else phase.other_W for phase in duty.phases]
    mean = float(np.sum(share * np.array(watts)))
    hot = limit.degC + float(rated.draw_values.model.coefficient)
    copper = float(np.median(np.asarray(drawn.copper_slope) * square)) * hot
    why = []
    if np.sum(seconds) > SHORT_CYCLE * fast_s:
        why.append(f"a cycle of {np.sum(seconds):.0f} s is not short against {fast_s:.0f} s")
    if abs(mean - other) > SAME_HEAT * (copper + other):
        why.append(f"other losses {mean:.0f} W on average, {other:.0f} W at the continuous current")
    if why:
        return refused("; ".join(["the rms of the cycle does not apply", *why, differs]))
    return replace(found, condition=f"{known(found.condition)}, {differs}")


class Phases(NamedTuple):
    """The phases of a duty as arrays, shape (phase,)."""

    step: Float[Array, " phase"]  # Length of a step [s].
    num: Int[Array, " phase"]  # Number of steps.
    squared: Float[Array, " phase"]  # Squared current over the largest [1].
    speed: Float[Array, " phase"]  # Speed over that of the loaded tests [1].
    share: Float[Array, " phase"]  # Losses other than copper over those of the loaded tests [1].
    watts: Float[Array, " phase"]  # What comes to them [W].


def held(phases: Sequence[Phase], loaded: Drive, longest_s: float) -> Phases:
    """Return the phases of a duty in steps of a length at most [s]."""
    rpm = 0.0 if loaded.speed_rad is None else float(loaded.speed_rad) / RAD_PER_S
    rows = []
    for phase in phases:
        num = int(np.ceil(phase.seconds / longest_s))
        speed = 1.0 if phase.rpm is None else abs(phase.rpm) / rpm if rpm else 0.0
        watts = 0.0 if phase.other_W is None else phase.other_W
        rows.append((phase.seconds / num, num, phase.current**2, speed,
                     float(phase.other_W is None), watts))  # fmt: skip
    # of one shape, so that other duties need no other program
    rows += [(1.0, 0, 0.0, 0.0, 0.0, 0.0)] * (-len(rows) % SAME_SHAPE)
    step, num, *rest = (jnp.asarray(each) for each in zip(*rows, strict=True))
    return Phases(step, num, *rest)


@compiled("model")
def simulated(
    model: Model,
    values: dict[str, Float[Array, " draw"]],
    loaded: Drive,
    other: Float[Array, " draw"],
    factor: Float[Array, " draw"],
    phases: Phases,
    num_cycles: Array,
    start: dict[str, Float[Array, " draw"]],
    length: Float[Array, " draw"],
) -> tuple[dict[str, Float[Array, " draw"]], Float[Array, " draw"]]:
    """Return the temperatures of each draw at the end of a duty [degC], and the highest one of the
    copper in its last cycle.

    Args:
        model: Network with effects.
        values: Parameters by name [their units].
        loaded: The loaded part of the tests.
        other: Other losses [W].
        factor: Squared current of load 1 over that of the tests [1].
        phases: From `held`.
        num_cycles: How often they are repeated.
        start: Temperature of each node [degC]; an effect that adds one knows its own.
        length: Length of the phases over that which is stated [1].
    """

    def one(values, other, factor, start, length):
        network, effects = model.network(values), model.built_effects(values)
        losses = fixed_losses(model.losses(values))
        copper = network.copper_node

        def phase(start, at: Phases):
            drive = loaded.scale_current(factor * at.squared)
            if loaded.speed is not None and loaded.speed_rad is not None:
                speed, speed_rad = at.speed * loaded.speed, at.speed * loaded.speed_rad
                drive = replace(drive, speed=speed, speed_rad=speed_rad)
            drive = replace(drive, losses=at.share * other + at.watts)
            found = hold(network, losses, drive, start, step=length * at.step, num_steps=at.num,
                         effects=effects)  # fmt: skip
            return found.last, found.highest[copper]

        def cycle(_, state):
            last, highest = jax.lax.scan(phase, state[0], phases)
            return last, jnp.max(highest)

        zero = jnp.zeros(())
        first = hold(network, losses, replace(loaded, losses=other), start, step=zero, num_steps=0,
                     effects=effects).last  # fmt: skip
        return jax.lax.fori_loop(0, num_cycles, cycle, (first, loaded.ambient))

    return jax.vmap(one)(values, other, factor, start, length)


NO_CLASS = "no insulation class: give [motor] insulation_class in the motor file"

NO_CURRENT = (
    "the current does not enter: the total loss is measured, and all of it heats one node; "
    "calibrate a network with a winding of its own"
)


@dataclass(frozen=True)
class Limit:
    """The limit of an insulation class."""

    insulation: str  # Letter of the class.
    degC: float  # Its temperature, or that which its permitted rise leads to [degC].
    rise_K: float | None = None  # The permitted rise [K]; None for the temperature of the class.

    def __str__(self) -> str:
        """Return the limit as it stands in conditions."""
        if self.rise_K is not None:
            return f"class {self.insulation}, permitted rise {self.rise_K:.0f} K"
        return f"class {self.insulation} ({self.degC:.0f} °C)"


def limits_of(motor: Motor, sink_degC: float) -> tuple[Limit | None, Limit | None]:
    """Return the temperature of the insulation class, and what the permitted rise leads to.

    Args:
        motor: The machine.
        sink_degC: Temperature of the sink [degC].
    """
    letter, permitted = motor.insulation_class, motor.permitted_rise(sink_degC)
    return (
        None if letter is None else Limit(letter, LIMIT_DEGC[letter]),
        None if permitted is None else Limit(permitted[0], sink_degC + permitted[1], permitted[1]),
    )


def at_limit(
    drawn: Machine, seen: Tested, limit: Limit | None, heated: str
) -> dict[str, DerivedFigure]:
    """Return the figures at the limit by name.

    Args:
        drawn: The machine of each draw.
        seen: Range of the tests.
        limit: Limit of the insulation; None if the motor file gives no class.
        heated: Losses and surroundings that the figures hold under.
    """
    names = {"cold": "time_to_limit_cold_s", "hot": "time_to_limit_hot_s"}
    if limit is None:
        return {key: refused(NO_CLASS) for key in ("continuous_current_A", *names.values())}
    text = f"{limit}, {heated}"
    figures = {"continuous_current_A": continuous(drawn, drawn.limit_squared, seen, limit, text)}
    starts = {"cold": "from the sink's temperature",
              "hot": f"from {100 * WARM:.0f} % of the steady rise"}  # fmt: skip
    for name, draws in (("cold", drawn.cold_s), ("hot", drawn.warm_s)):
        entry = figure(np.asarray(draws), "s", f"{rounded(seen.amperes)} A, {starts[name]}, {text}")
        if not np.isfinite(entry.median):
            entry = refused(f"{rounded(seen.amperes)} A does not reach {limit.degC:.0f} °C")
        figures[names[name]] = extrapolated(entry, seen.short_of(degC=limit.degC))
    return figures


def within_rise(
    drawn: Machine, seen: Tested, limit: Limit, at: str, heated: str
) -> dict[str, DerivedFigure]:
    """Return what is left of the permitted rise, and the continuous current that it allows.

    Nothing is left, or lacks, where no steady rise is stated.

    Args:
        drawn: The machine of each draw.
        seen: Range of the tests.
        limit: The permitted rise.
        at: Current of the steady rise.
        heated: Losses and surroundings that the figures hold under.
    """
    assert limit.rise_K is not None
    current = continuous(drawn, drawn.permitted_squared, seen, limit, f"{limit}, {heated}")
    found = {"continuous_current_by_rise_A": current}
    rise = np.asarray(drawn.rise)
    if math.isfinite(number(known(steady_rise(rise, "", seen).sd))):
        chance = f"within it with a probability of {100.0 * np.mean(rise <= limit.rise_K):.0f} %"
        text = f"{limit}, {chance}, {at}"  # the rest stands at the steady rise
        found = {"rise_margin_K": figure(limit.rise_K - rise, "K", text), **found}
    return found


def continuous(
    drawn: Machine, squared: Array, seen: Tested, limit: Limit, text: str
) -> DerivedFigure:
    """Return a continuous current [A].

    Args:
        drawn: The machine of each draw.
        squared: Its square of each draw [A^2].
        seen: Range of the tests.
        limit: The limit.
        text: What it holds under.
    """
    if not np.any(np.asarray(drawn.copper_slope)):
        return refused(NO_CURRENT)
    if np.median(np.asarray(squared)) <= 0.0:
        return refused(f"the other losses alone lead to {limit.degC:.0f} °C")
    entry = figure(np.sqrt(np.maximum(np.asarray(squared), 0.0)), "A", text)
    return extrapolated(entry, seen.short_of(degC=limit.degC, amperes=entry.median))
