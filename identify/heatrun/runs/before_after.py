"""Two runs of one machine, before and after: what changed, by how much, and how surely.

The tests of the two runs are independent, so that one draw of each posterior is a draw of both, and
of their difference. What is compared is one quantity at one load: parameters of one network, and
what follows from them under the load of the tests before. After, that is the run's own network at
the current, other losses, sink, speed and flow of the tests before; the other losses keep their
uncertainty, and their median alone is moved.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float

from lptn import time_constants

from ..errors import InputError
from ..io.quantities import percent, rounded
from ..model.parameters import EXTRA_NODE
from ..results.model import AT_REST, LOADED, DerivedFigure
from ..results.values import Interval, Probability, known
from .duties import at_limit, limits_of, within_rise
from .figures_of_draws import DrawValues, alone, figure, steady_rise, with_effects
from .machine import RAD_PER_S, SAME_LOAD, Machine, Tested, machines
from .ratings_figures import names_of_times, rates, resistances
from .run import Run
from .verdict import favoured, headline

SURE = 0.95
"""Probability from which on a change, or that there is none, counts as shown [1]."""

SIZE = 0.05
"""Change that is asked for if nothing else is said [1]."""

NUM_PAIRS = 4000
"""Pairs of draws: a limit of the interval is good to a twentieth of its half width."""

UNDER_LOAD = "time constants, steady rise, continuous current"

RATED_BY = ("continuous_current_A", "continuous_current_by_rise_A", "steady_rise_K")
"""What a machine is rated by, whatever its network."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A value with its 95 % interval."""

    value: float
    interval_95: Interval


@dataclass(frozen=True, kw_only=True)
class Change:
    """One quantity before and after."""

    name: str  # As in `fit.json`.
    unit: str  # Its unit.
    condition: str  # What both values hold under; empty for a parameter of the network as it is.
    before: Estimate  # Before [unit].
    after: Estimate  # After [unit].
    difference: Estimate  # After less before [unit].
    relative: Estimate  # The difference over the value before [1].
    grew: Probability  # Probability that it grew [1].
    # Probability that it changed by more than the size asked for, up or down [1].
    changed: Probability


@dataclass(frozen=True, kw_only=True)
class BeforeAfter:
    """What changed between two runs."""

    format: Literal["heatrun-compare/1"]  # Of this object.
    before: str  # Folder of the run before.
    after: str  # Folder of the run after.
    networks: tuple[str, str]  # The network that was taken of each.
    size: float  # The change that the probabilities ask for [1].
    sentence: str  # The one thing that decides.
    changes: tuple[Change, ...]  # What was compared.
    not_compared: Mapping[str, str]  # Why not, by name of what was not.
    notes: tuple[str, ...]  # What bears on all of it.


_Drawn = tuple[Float[np.ndarray, " draw"], DerivedFigure]
"""Draws of a quantity, and what is stated of them or why nothing is."""


class _Side:
    """One of the two runs, with the network that is taken of it."""

    def __init__(self, word: str, run: Run, network: str) -> None:
        self.word, self.run = word, run
        self.said = run.result.models[network]
        self.draws = run.draws(network)
        self.model, self.free = self.draws.model, self.draws.values()
        load = known(self.said.load)
        self.seen = None if load is None else Tested.of(load)
        form = self.model.form
        nodes = [(node, p.name) for node, p in form.capacitance]
        links = [(link, p.name) for link, p in form.resistance]
        self.structure = (nodes, links, form.copper, form.sinks)
        self.to_sink = [name for link, name in links if set(link) & set(form.sinks)]

    @cached_property
    def base(self) -> DrawValues:
        """The network alone; events are those of the first test."""
        return alone(self.draws)

    def draw_values(self, seen: Tested) -> DrawValues:
        """Return the network with the effects behind its draws, under a load."""
        return with_effects(self.draws, self.base, seen)

    def machine(
        self, draw_values: DrawValues, seen: Tested, amperes: float, degC: float, permitted: float
    ) -> Machine:
        scale = (amperes / seen.amperes) ** 2 if seen.amperes else 1.0
        at = map(np.asarray, (seen.loaded_winding_degC, degC, scale, permitted))
        return machines(draw_values.model, draw_values.values, seen.loaded, *at)

    def other_losses_W(self, seen: Tested) -> float:
        drawn = self.machine(self.draw_values(seen), seen, seen.amperes, np.nan, np.nan)
        return float(np.median(drawn.other))

    def stated(self, name: str) -> _Drawn:
        """Return the draws of a parameter, as wide as its interval.

        That is wider where it holds models which the tests do not tell apart.
        """
        entry, draws = self.said.parameters[name], self.free[name]
        own = np.quantile(draws, [0.025, 0.975]) - entry.value
        wider = (np.array(entry.interval_95) - entry.value) / np.where(own == 0.0, np.nan, own)
        wider = np.fmax(wider, 1.0)
        draws = entry.value + (draws - entry.value) * np.where(draws < entry.value, *wider)
        return draws, DerivedFigure(value=entry.value, unit=entry.unit, sd=entry.sd,
                                    interval_95=entry.interval_95, condition="")  # fmt: skip

    def refusal(self, name: str) -> str:
        """Return why the run says nothing of a parameter; empty if it does."""
        entry = self.said.parameters.get(name)
        if entry is None:
            return f"not in the network {self.word}"
        if entry.fixed:
            return f"given {self.word}, not estimated"
        if entry.identifiability == "not identifiable":
            return f"not identifiable {self.word}: the prior decides"
        return "" if name in self.free else f"of each test apart {self.word}"

    def figures(self, seen: Tested, amperes: float, before: Tested) -> dict[str, _Drawn]:
        """Return resistances, time constants, steady rise and continuous currents under a load.

        Args:
            seen: The load, with the range of the run's own tests.
            amperes: Current of the steady rise [A].
            before: The load whose winding temperature the time constants are told for.
        """
        draw_values, model = self.draw_values(seen), self.model
        motor, sink = self.run.motor, seen.sink_degC
        limit, by_rise = limits_of(motor, sink)
        ends = (np.nan if each is None else each.degC for each in (limit, by_rise))
        drawn = self.machine(draw_values, seen, amperes, *ends)
        winding = np.asarray(before.loaded_winding_degC)
        network = rates(model, self.base.values, seen.loaded, winding)
        times = time_constants(network.A)
        around = seen.surroundings(
            model.effects, follows_time=bool(np.any(network.follows_time)),
            second_sink=model.form.second_sink, likely=draw_values.likely,
        )  # fmt: skip
        heated = f"other losses {np.median(drawn.other):.0f} W, sink {sink:.0f} °C"
        found = {
            f"{name}{ending}": (draws, figure(draws, "K/W", words, self.draws.plausible))
            for name, at in (resistances(draw_values, seen) if model.effects else {}).items()
            for ending, (draws, words) in at.items()
        }
        found |= {
            name: (draws, figure(draws, "s", f"constant copper loss{around}"))
            for name, draws in zip(names_of_times(times.shape[-1]), times.T, strict=True)
        }
        rise, heated = np.asarray(drawn.rise), f"{heated}{around}"
        at = f"{rounded(amperes)} A"
        at = f"rated current {at}" if amperes == motor.rated_current_A else f"{at} rms"
        found["steady_rise_K"] = rise, steady_rise(rise, f"{at}, {heated}", seen)
        currents = {
            "continuous_current_A": (drawn.limit_squared, at_limit(drawn, seen, limit, heated))
        }
        if by_rise is not None:
            currents["continuous_current_by_rise_A"] = (
                drawn.permitted_squared, within_rise(drawn, seen, by_rise, at, heated),
            )  # fmt: skip
        for name, (square, entries) in currents.items():
            found[name] = np.sqrt(np.maximum(np.asarray(square), 0.0)), entries[name]
        return found


def compare_runs(
    before: Run, after: Run, *, network: str | None = None, size: float = SIZE
) -> BeforeAfter:
    """Compare two runs of one machine, parameter by parameter at one load.

    Args:
        before: The run before.
        after: The run after.
        network: Network of both; if None the favoured one of either that both hold, else each
            one's own.
        size: Change that the probabilities ask for [1].

    Raises:
        InputError: If a run is damaged, lacks the network, or both are one and the same.
    """
    runs = before, after
    if before.file("fit.json") == after.file("fit.json"):
        raise InputError(
            "the two runs are one and the same.",
            where=f"{before.path}, {after.path}",
            remedy="Give the run before and the run after: heatrun compare RUN_BEFORE RUN_AFTER.",
        )
    own = [favoured(run.result) for run in runs]
    both = [name for name in own if all(name in run.networks for run in runs)]
    names = [run.choose(network or (both or [its])[0]) for run, its in zip(runs, own, strict=True)]
    one, other = sides = _Side("before", before, names[0]), _Side("after", after, names[1])
    left: dict[str, str] = {}
    pairs = _under_one_load(one, other, left)
    parameters: dict[str, tuple[_Drawn, _Drawn]] = {}
    for name in dict.fromkeys((*one.said.parameters, *other.said.parameters)):
        if name in left or f"{name}{LOADED}" in pairs:
            continue
        if why := one.refusal(name) or other.refusal(name) or _not_one_quantity(name, one, other):
            left[name] = why
        else:
            parameters[name] = one.stated(name), other.stated(name)
    rng = np.random.default_rng(0)
    changes = []
    for name, pair in (parameters | pairs).items():
        refused = [known(entry.refused) for _, entry in pair]
        if any(refused):
            told = zip(sides, refused, strict=True)
            left[name] = "; ".join(f"{side.word}: {why}" for side, why in told if why)
        else:
            changes.append(_change(name, pair, size, rng))
    return BeforeAfter(
        format="heatrun-compare/1",
        before=str(before.path),
        after=str(after.path),
        networks=(names[0], names[1]),
        size=size,
        sentence=_sentence(changes, size),
        changes=tuple(changes),
        not_compared=left,
        notes=tuple(_notes(one, other)),
    )


def _not_one_quantity(name: str, before: _Side, after: _Side) -> str:
    """Return why a parameter means something else in either network; empty if it does not."""
    if "." in name:  # of an effect, whose amplitudes are those at rated speed and current
        loads = [side.seen for side in (before, after) if side.seen is not None]
        rated = {(round(load.rated_speed, 6), round(load.rated_current, 6)) for load in loads}
        return "scaled with another rated speed or current" if len(rated) > 1 else ""
    kinds = set(before.model.effects) ^ set(after.model.effects)
    bodies = [kind.card.id for kind in kinds if kind.card.family == EXTRA_NODE]
    if name != "Rs0" and (bodies or before.structure != after.structure):
        by = f" by {', '.join(sorted(bodies))}" if bodies else ""
        return f"the networks differ{by}: {before.said.title} before, {after.said.title} after"
    return ""


def _under_one_load(
    before: _Side, after: _Side, left: dict[str, str]
) -> dict[str, tuple[_Drawn, _Drawn]]:
    """Return what is compared under the load of the tests before, by name.

    `left` takes up what is not, and why.
    """
    seen, own = before.seen, after.seen
    if seen is None or own is None:
        word = "before" if seen is None else "after"
        is_stated = before.model.effects or after.model.effects
        of_effects = [name for _, name in before.structure[1]] if is_stated else []
        why = f"the run {word} is of an earlier version: calibrate again"
        left |= dict.fromkeys([*of_effects, UNDER_LOAD], why)
        return {}
    if why := "; ".join(_other_load(before, after, seen, own)):
        left |= dict.fromkeys([*before.to_sink, *after.to_sink, UNDER_LOAD], why)
        return {}
    amperes = before.run.motor.rated_current_A or seen.amperes
    moved = before.other_losses_W(seen) - after.other_losses_W(own)
    speed = seen.loaded.speed_rad
    load = replace(
        seen.loaded,
        losses=own.loaded.losses + moved,  # those of the tests after, at their current
        current_squared=own.loaded.current_squared,
        current_ratio_squared=own.loaded.current_ratio_squared,
        speed=None if speed is None else speed / own.rated_speed,
    )
    first = before.figures(seen, amperes, seen)
    second = after.figures(replace(own, loaded=load), amperes, seen)
    if before.structure != after.structure:
        first, second = ({n: f[n] for n in RATED_BY if n in f} for f in (first, second))
    for name in [n for n in (first | second) if n.endswith(LOADED)]:
        bare = name.removesuffix(LOADED)
        if why := before.refusal(bare) or after.refusal(bare):
            left[name] = why
            continue
        for side, found in ((before, first), (after, second)):
            found.setdefault(name, side.stated(bare))  # without effects it is the parameter
    if ("Rs0" in before.base.values) != ("Rs0" in after.base.values):
        left["steady_rise_K"] = "the copper loss enters one of the networks alone"
    motors = [side.run.motor for side in (before, after)]
    letters = [motor.insulation_class for motor in motors]
    used = [(motor.permitted_rise(seen.sink_degC) or (None,))[0] for motor in motors]
    for name, pair in (("continuous_current_A", letters), ("continuous_current_by_rise_A", used)):
        if pair[0] != pair[1]:
            left[name] = f"class {pair[0]} before, class {pair[1]} after"
    names = sorted(first | second, key=lambda name: not name.endswith((LOADED, AT_REST)))
    alone = [name for name in names if name not in left and (name in first) != (name in second)]
    left |= dict.fromkeys(alone, "of one of the two networks alone")
    return {name: (first[name], second[name]) for name in names if name not in left}


def _other_load(before: _Side, after: _Side, seen: Tested, own: Tested) -> Iterator[str]:
    """Yield why the network after cannot be set under the load of the tests before."""
    if before.structure[3] != after.structure[3]:
        yield "the heat goes to another sink after"
    for kind in after.model.effects:
        for need in seen.lacks(kind):
            yield f"the tests before do not tell the {need}, which {kind.card.id} after needs"
    cooling = [kind for kind in after.model.effects if kind.card.family == "cooling"]
    at = {"speed": ("speed_rad", 1.0 / RAD_PER_S, "rpm"), "fan": ("fan", 100.0, "% of rated flow")}
    for need, (name, scale, unit) in at.items():
        pair = [getattr(each.loaded, name) for each in (seen, own)]
        if None in pair or any(need in kind.card.needs for kind in cooling):
            continue
        one, other = (scale * float(each) for each in pair)
        if abs(one - other) > SAME_LOAD * max(abs(one), abs(other)):
            yield f"{one:.0f} {unit} before, {other:.0f} after, which the network does not follow"


def _change(
    name: str, pair: tuple[_Drawn, _Drawn], size: float, rng: np.random.Generator
) -> Change:
    (first, before), (second, after) = pair
    one, other = (rng.choice(draws, NUM_PAIRS) for draws in (first, second))
    # what runs away has no steady rise, and is neither more nor less of it
    is_there = np.isfinite(one) & np.isfinite(other) & (one != 0.0)
    one, apart = one[is_there], (other - one)[is_there]

    def estimate(value: float, draws: np.ndarray) -> Estimate:
        low, high = np.quantile(draws, [0.025, 0.975])
        return Estimate(value=value, interval_95=(float(low), float(high)))

    return Change(
        name=name,
        unit=known(before.unit) or "",
        condition=_condition(known(before.condition) or "", known(after.condition) or ""),
        before=Estimate(value=before.median, interval_95=before.ends),
        after=Estimate(value=after.median, interval_95=after.ends),
        difference=estimate(after.median - before.median, apart),
        relative=estimate(after.median / before.median - 1.0, apart / one),
        grew=float(np.mean(apart > 0.0)),
        changed=float(np.mean(np.abs(apart) > size * np.abs(one))),
    )


def _condition(before: str, after: str) -> str:
    """Return what both values hold under, and whether that after alone lies beyond its tests."""
    beyond, own = (text.partition(", extrapolated, ")[2] for text in (after, before))
    words = before or after
    return f"{words}; after: extrapolated, {beyond}" if own != beyond and beyond else words


def _notes(before: _Side, after: _Side) -> Iterator[str]:
    results = before.run.result, after.run.result
    names = [result.motor.name for result in results]
    if names[0] != names[1]:
        yield f"The machines have different names: {names[0]!r} before, {names[1]!r} after."
    currents = [side.run.motor.rated_current_A for side in (before, after)]
    if None not in currents and currents[0] != currents[1]:
        one, other = (rounded(float(each or 0.0)) for each in currents)
        yield f"Rated current {one} A before, {other} A after: the steady rise is that at {one} A."
    files = [{t.sha256 for t in r.tests if t.role == "calibration"} - {""} for r in results]
    if files[0] & files[1]:
        yield "Both runs were fitted to one file: intervals and probabilities do not hold."
    for side in (before, after):
        use = headline(side.run.result)
        if use.use != "usable":
            yield f"The run {side.word} is {use.use}. {use.sentence}"


def _sentence(changes: Sequence[Change], size: float) -> str:
    """Return the one thing that decides: of what surely changed, the largest of the network."""
    if not changes:
        return "Nothing can be compared: see what is not, and why."
    asked = f"changed by more than {rounded(100.0 * size)} %"
    sure = [each for each in changes if each.changed >= SURE]
    network = [each for each in sure if each.unit in ("J/K", "K/W")] or sure
    if network:
        first = max(network, key=lambda each: abs(each.relative.value))
        others = ", ".join(each.name for each in sure if each is not first)
        more = f" So did {others}." if others else ""
        return f"{_moved(first)}: probability {percent(first.changed)} that it {asked}.{more}"
    first = max(changes, key=lambda each: each.changed)
    said = f"{_moved(first)}, probability {percent(first.changed)}"
    if first.changed <= 1.0 - SURE:
        return f"Nothing {asked}. The likeliest: {said}."
    return f"It is not decided whether anything {asked}. The likeliest: {said}."


def _moved(change: Change) -> str:
    """Return by how much a quantity moved, such as `Req_w fell by 18 % (8 … 27 %)`."""
    sign = -100.0 if change.relative.value < 0.0 else 100.0
    low, high = sorted(sign * end for end in change.relative.interval_95)
    places = 0 if high - low >= 4.0 else 1
    amount, *ends = (f"{x:.{places}f}" for x in (sign * change.relative.value, low, high))
    verb = "moved" if not float(amount) else "fell" if sign < 0.0 else "grew"
    return f"{change.name} {verb} by {amount} % ({' … '.join(ends)} %)"
