"""Currents of the duty types S2 and S3 at the insulation limit, where they are asked for.

The values behind each draw: of the network, and of the effect that it may miss.

Where a posterior is averaged over effects that the network may miss, the parameters of a draw are
where its effect puts them. The figures of that draw are then those of the network with the effect:
without it, the machine would have another rise than the tests show.

The current of a duty type at the insulation limit, by simulating the duty.

Continuous current and time to the limit of the insulation class.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from lptn import Drive, hold
from lptn.effects import AbstractEffect

from ..errors import UsageError
from ..io.programs import compiled
from ..io.quantities import rounded
from ..model.catalogue import lacking
from ..model.draws import PlausibleEffect, PlausibleEffects
from ..model.model import Model
from ..model.model_parameters import parameters
from ..model.parameters import Parameter, amplitudes, qualified
from ..posterior.posterior import Posterior
from ..results.model import DerivedFigure
from ..results.values import known, number
from .machine import (
    WARM,
    Machine,
    Tested,
    extrapolated,
    figure,
    fixed_losses,
    refused,
    steady_rise,
)

LIKELY = 0.5
"""Probability from which on a condition names an effect that the network misses [1]."""


class Behind(NamedTuple):
    """What the figures are computed from.

    Attributes:
        model: The network with all effects that stand behind one of the draws.
        values: By parameter name [their units], shape (draw,) each; an effect that does not stand
            behind a draw is at its null.
        likely: Effects that the network is likely to miss.
    """

    model: Model
    values: dict[str, Float[Array, " draw"]]
    likely: tuple[type[AbstractEffect], ...]


def alone(posterior: Posterior) -> Behind:
    """Return the network without effects that it may miss; events are those of the first test."""
    problem = posterior.fit.problem
    structure, priors = problem.structure, problem.data.priors
    z = posterior.flat[:, : problem.num_parameters]
    values = jax.vmap(lambda z: priors.values(structure.form, z, 0))(z)
    return Behind(structure.model, structure.model.in_general(values), ())


def with_effects(posterior: Posterior, base: Behind) -> Behind:
    """Return the network with the effects behind the draws; `base` itself if there are none.

    An effect of one test is none of the machine in general, nor is one whose channel is lacking.

    Args:
        posterior: Draws.
        base: The network alone.
    """
    problem = posterior.fit.problem
    tests = [test.winding for test in problem.tests]

    def known(model: Model, kinds: tuple[type[AbstractEffect], ...]) -> Mapping[str, Parameter]:
        return parameters(model, problem.motor, tests, searched=kinds).by_test[0]

    def lacks(kind: type[AbstractEffect]) -> bool:
        return any(lacking(kind, test) for test in tests)

    return extended(posterior.plausible, base, known, lacks)


def extended(
    plausible: PlausibleEffects | None,
    base: Behind,
    known_of: Callable[[Model, tuple[type[AbstractEffect], ...]], Mapping[str, Parameter]],
    lacks: Callable[[type[AbstractEffect]], bool],
) -> Behind:
    """Return the network with the effects behind its draws, as `with_effects`.

    Args:
        plausible: The effects; None for none.
        base: The network alone.
        known_of: Gives the parameters of a model by name, of which some effects may be absent.
        lacks: Says of an effect whether its channel is lacking.
    """
    if plausible is None:
        return base
    used = {
        index: each
        for index, each in enumerate(plausible.effects)
        if each.test is None and np.any(plausible.size[:, index]) and not lacks(each.kind)
    }
    if not used:
        return base
    kinds = tuple(dict.fromkeys(effect.kind for effect in used.values()))
    model = replace(base.model, effects=(*base.model.effects, *kinds))
    known = known_of(model, kinds)
    values = {name: np.array(draws) for name, draws in base.values.items()}
    for kind in kinds:
        for name in kind.card.parameters:
            own = qualified(kind, name)
            values[own] = np.full(plausible.size.shape[0], known[own].centre)
    for index, effect in used.items():
        rows = np.flatnonzero(plausible.size[:, index])
        _add(effect, plausible.size[rows, index], rows, known, values)
    likely = tuple(each.kind for each in used.values() if each.probability >= LIKELY)
    return Behind(model, jax.tree.map(np.asarray, values), likely)


def _add(
    effect: PlausibleEffect,
    size: Float[np.ndarray, " row"],
    rows: Int[np.ndarray, " row"],
    known: Mapping[str, Parameter],
    values: Mapping[str, Float[np.ndarray, " draw"]],
) -> None:
    """Put an effect of given sizes behind some draws.

    A resistance that it acts on stands in the draws for its mean over the tests, and moves to where
    the effect has it.
    """
    strong = {qualified(effect.kind, name) for name in amplitudes(effect.kind)}
    own = {qualified(effect.kind, name) for name in effect.kind.card.parameters}
    for name, value in effect.with_effect.items():
        parameter = known.get(name)
        if parameter is None or name not in values:
            continue
        if name in strong:
            values[name][rows] = parameter.centre + size * (value - parameter.centre)
        elif name in own:
            values[name][rows] = value
        elif value != effect.without[name]:
            apart = parameter.score(value) - parameter.score(effect.without[name])
            values[name][rows] = parameter.value(parameter.score(values[name][rows]) + size * apart)


CYCLE_S = 600.0
"""Length of a cycle of S3 [s]; IEC 60034-1, 4.2.3, if not agreed otherwise."""

NUM_DRAWS = 300
"""Draws behind a rating: each is a search over simulated duties."""

LARGEST, NUM_HALVINGS = 6.0, 16
"""Largest current of the search over the largest one tested [1], and halvings of its range: to
2^-16 of it, far below the uncertainty."""

PATTERN = re.compile(r"^S2-(?P<minutes>\d+(?:\.\d+)?)$|^S3-(?P<percent>\d+(?:\.\d+)?)$")


@dataclass(frozen=True)
class Duty:
    """A duty type of IEC 60034-1.

    Attributes:
        name: As asked for: `"S2-30"` is 30 minutes from cold, `"S3-40"` 40 % of each cycle.
        on_s: Time under load [s].
        off_s: Time at rest, de-energised, after it [s]; 0 for S2.
        num_cycles: Cycles until the last one counts.
    """

    name: str
    on_s: float
    off_s: float
    num_cycles: int


def parse_duty(text: str, slow_s: float) -> Duty:
    """Return a duty by its name.

    Args:
        text: `"S2-MINUTES"` or `"S3-PERCENT"`.
        slow_s: Slow time constant [s]; a cycled duty runs for five of them.

    Raises:
        UsageError: If the name is none of these, or the share is not inside 0…100 %.
    """
    found = PATTERN.match(text)
    if found and found["minutes"] and float(found["minutes"]) > 0:
        return Duty(text, 60.0 * float(found["minutes"]), 0.0, 1)
    if found and found["percent"] and 0 < float(found["percent"]) < 100:
        on = CYCLE_S * float(found["percent"]) / 100.0
        return Duty(text, on, CYCLE_S - on, max(2, round(5 * slow_s / CYCLE_S)))
    raise UsageError(f"rating {text!r}: expected S2-MINUTES or S3-PERCENT, such as S2-30 or S3-40.")


def current_at_limit(
    duty: Duty,
    highest: Callable[[np.ndarray, Duty], np.ndarray],
    limit_degC: float,
    largest_A: float,
    num_draws: int,
) -> np.ndarray:
    """Return the rms current at which the winding just reaches its limit [A], shape (draw,).

    Args:
        duty: The duty.
        highest: Returns the highest winding temperature [degC] for currents [A] of each draw.
        limit_degC: Limit of the insulation class.
        largest_A: Upper end of the search; draws that stay below the limit there return inf.
        num_draws: Number of draws.
    """
    low, high = np.zeros(num_draws), np.full(num_draws, largest_A)
    beyond = highest(high, duty) < limit_degC
    for _ in range(NUM_HALVINGS):
        middle = 0.5 * (low + high)
        is_hot = highest(middle, duty) >= limit_degC
        low, high = np.where(is_hot, low, middle), np.where(is_hot, middle, high)
    return np.where(beyond, np.inf, 0.5 * (low + high))


STEPS_PER_TIME_CONSTANT = 10
"""Steps over the shortest time constant [1]: the third-order steps then err by 4e-5 of a change."""


@dataclass(frozen=True)
class Rated:
    """A machine that is to be rated.

    Attributes:
        behind: Model and values behind each draw.
        drawn: The machine of each draw.
        times: Its time constants [s], shape (draw, node), shortest first.
        seen: Range of the tests.
        limit: Limit of the insulation, None if no class is given.
        surroundings: As `heatrun.runs.machine.Tested.surroundings`.
    """

    behind: Behind
    drawn: Machine
    times: Float[np.ndarray, "draw node"]
    seen: Tested
    limit: Limit | None
    surroundings: str


def duty_current(rated: Rated, text: str) -> DerivedFigure:
    """Return the current of a duty type at the limit; at rest it stands still without losses.

    Args:
        rated: The machine.
        text: The duty, such as `"S2-30"`.

    Raises:
        UsageError: As `heatrun.runs.duties.parse_duty`.
    """
    duty = parse_duty(text, float(np.median(rated.times[:, -1])))
    if rated.limit is None:
        return refused(NO_CLASS)
    if not np.any(rated.drawn.copper_slope):
        return refused(NO_CURRENT)
    seen, limit = rated.seen, rated.limit
    picked = np.random.default_rng(0).permutation(rated.times.shape[0])[:NUM_DRAWS]
    other = rated.drawn.other[picked]
    values = {name: draws[picked] for name, draws in rated.behind.values.items()}
    longest = float(np.min(rated.times[picked])) / STEPS_PER_TIME_CONSTANT

    def highest(current: np.ndarray, duty: Duty) -> np.ndarray:
        factor = jnp.asarray(current) ** 2 / seen.loaded.current_squared
        phases = []
        for length in (duty.on_s, duty.off_s):
            num = int(np.ceil(length / longest))
            phases.append((jnp.asarray(length / max(num, 1)), jnp.asarray(num)))
        on, off = phases
        top = _highest(rated.behind.model, values, seen.loaded, other, factor, on, off,
                       jnp.asarray(duty.num_cycles))  # fmt: skip
        return np.asarray(top)

    current = current_at_limit(duty, highest, limit.degC, LARGEST * seen.current_A, picked.size)
    entry = figure(
        current,
        "A",
        f"{text}, {limit}, other losses {np.median(other):.0f} W under load, none at rest, "
        f"sink {seen.sink_degC:.0f} °C{rated.surroundings}",
    )
    if not math.isfinite(entry.median):
        return refused(f"{rounded(LARGEST * seen.current_A)} A does not reach {limit.degC:.0f} °C")
    return extrapolated(entry, seen.short_of(degC=limit.degC, amperes=entry.median))


@compiled("model")
def _highest(
    model: Model,
    values: dict[str, Float[Array, " draw"]],
    loaded: Drive,
    other: Float[Array, " draw"],
    factor: Float[Array, " draw"],
    on: tuple[Array, Array],
    off: tuple[Array, Array],
    num_cycles: Array,
) -> Float[Array, " draw"]:
    """Return the highest copper temperature in the last cycle of each draw [degC]."""
    zero = jnp.zeros(())
    standing = None if loaded.speed is None else zero

    def one(values, other, factor):
        network, effects = model.network(values), model.built_effects(values)
        losses = fixed_losses(model.losses(values))
        under_load = replace(loaded.scale_current(factor), losses=other)
        at_rest = replace(
            loaded.scale_current(0.0), losses=zero, speed=standing, speed_rad=standing
        )
        copper = network.copper_node

        def phase(drive, start, lengths):
            step, num = lengths
            return hold(network, losses, drive, start, step=step, num_steps=num, effects=effects)

        def cycle(_, state):
            warm = phase(under_load, state[0], on)
            rest = phase(at_rest, warm.last, off)
            return rest.last, jnp.maximum(warm.highest[copper], rest.highest[copper])

        sink = dict.fromkeys(network.nodes, loaded.ambient)
        cold = hold(network, losses, at_rest, sink, step=zero, num_steps=0, effects=effects).last
        return jax.lax.fori_loop(0, num_cycles, cycle, (cold, loaded.ambient))[1]

    return jax.vmap(one)(values, other, factor)


NO_CLASS = "no insulation class: give [motor] insulation_class in the motor file"

NO_CURRENT = (
    "the current does not enter: the total loss is measured, and all of it heats one node; "
    "calibrate a network with a winding of its own"
)


@dataclass(frozen=True)
class Limit:
    """The limit of an insulation class.

    Attributes:
        insulation: Letter of the class.
        degC: Its temperature, or that which its permitted rise leads to [degC].
        rise_K: The permitted rise [K]; None for the temperature of the class.
    """

    insulation: str
    degC: float
    rise_K: float | None = None

    def __str__(self) -> str:
        """Return the limit as it stands in conditions."""
        if self.rise_K is not None:
            return f"class {self.insulation}, permitted rise {self.rise_K:.0f} K"
        return f"class {self.insulation} ({self.degC:.0f} °C)"


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
    figures = {"continuous_current_A": _continuous(drawn, drawn.limit_squared, seen, limit, text)}
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
    current = _continuous(drawn, drawn.permitted_squared, seen, limit, f"{limit}, {heated}")
    found = {"continuous_current_by_rise_A": current}
    rise = np.asarray(drawn.rise)
    if math.isfinite(number(known(steady_rise(rise, "", seen).sd))):
        chance = f"within it with a probability of {100.0 * np.mean(rise <= limit.rise_K):.0f} %"
        text = f"{limit}, {chance}, {at}"  # the rest stands at the steady rise
        found = {"rise_margin_K": figure(limit.rise_K - rise, "K", text), **found}
    return found


def _continuous(
    drawn: Machine, squared: Array, seen: Tested, limit: Limit, text: str
) -> DerivedFigure:
    if not np.any(drawn.copper_slope):
        return refused(NO_CURRENT)
    entry = figure(np.sqrt(np.maximum(np.asarray(squared), 0.0)), "A", text)
    return extrapolated(entry, seen.short_of(degC=limit.degC, amperes=entry.median))
