"""The search for effects that the machines of a type share, one after the other.

A round tests all effects at one stage: which are seen, and how large they are. A claim is what is
said of a shared effect: its size, what it cannot be told from, and whether it stands; the text for
the terminal is made here too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import stdtrit

from heatrun.io.quantities import printed_unit, rounded
from heatrun.model.catalogue import all_effects
from heatrun.model.parameters import effect_parameters
from heatrun.results.discovery import ValueWithInterval
from lptn.effects import AbstractEffect, Quantity

from ..results import (
    FleetDiscoveryResult,
    InstrumentRival,
    ScreenedEffect,
    SharedEffect,
    TypeDiscovery,
)
from .pooled import CLIP, FREE, Pool, Tested, largest_by_chance, one_sided, score_test, shape_of

BEYOND = 1.5
"""Largest plausible amplitude over that of the catalogue [1]."""


@dataclass(frozen=True)
class Column:
    """An amplitude at a setting of its shape.

    Attributes:
        kind: The effect.
        parameter: Name of the amplitude.
        shape: Values of the shape parameters, by name.
        quantity: The amplitude's range and unit.
        scale: Amplitude at a score of one [its unit].
    """

    kind: type[AbstractEffect]
    parameter: str
    shape: dict[str, float]
    quantity: Quantity
    scale: float

    @classmethod
    def of(cls, label: str, scale: float, catalogue: Mapping[str, type[AbstractEffect]]) -> Column:
        """Return what a label of `Evidence.effects` stands for.

        Args:
            label: Such as `"natural_convection.f|n=0.29"`.
            scale: Amplitude at a score of one in a machine of this size [its unit].
            catalogue: Effects by id.
        """
        name = label.partition("|")[0]
        id, _, parameter = name.partition(".")
        kind = catalogue[id]
        own = next(p for p in effect_parameters([kind], 1.0, [kind]) if p.name == name)
        usual, larger = kind.card.parameters[parameter], scale / own.sd
        null = usual.null or 0.0
        low, high = (null + larger * (end - null) for end in (usual.low, usual.high))
        quantity = usual._replace(low=low, high=high)
        return cls(kind, parameter, shape_of(label), quantity, scale)

    @property
    def id(self) -> str:
        """Id of the effect."""
        return self.kind.card.id

    @property
    def is_two_sided(self) -> bool:
        """Whether the amplitude may have either sign."""
        null = self.quantity.null or 0.0
        return self.quantity.low < null < self.quantity.high

    def is_plausible(self, score: float) -> bool:
        """Whether the amplitude of a score is one that a machine may have."""
        size = self.scale * score
        null = self.quantity.null or 0.0
        low = min(self.quantity.low - null, 0.0)
        return BEYOND * low <= size <= BEYOND * (self.quantity.high - null)


@dataclass(frozen=True)
class Round:
    """The tests of all effects with some in the model.

    Attributes:
        pool: The machines.
        columns: What the effects stand for.
        is_two_sided: Of each.
        precision: Of what is known of each shared parameter, of its score [1].
        accepted: Effects in the model, by their places.
        test: Of each effect.
        chance: Largest statistics by chance.
        critical: That of them which is exceeded with the probability of the level.
        information: Precision of each effect's score, by what the fits state.
    """

    pool: Pool
    columns: list[Column]
    is_two_sided: Bool[np.ndarray, " effect"]
    precision: np.ndarray
    accepted: tuple[int, ...]
    test: Tested
    chance: np.ndarray
    critical: float
    information: Float[np.ndarray, " effect"]

    @classmethod
    def of(
        cls, pool: Pool, columns: list[Column], both: np.ndarray, precision: np.ndarray,
        accepted: Sequence[int], level: float, seed: int,
    ) -> Round:  # fmt: skip
        """Return the round; arguments as the attributes, and the level and seed of its chance."""
        test = score_test(pool, precision, accepted)
        chance = largest_by_chance(test, both, seed)
        critical = float(np.quantile(chance, 1.0 - level))
        stated = information(pool, precision, accepted)
        return cls(pool, columns, both, precision, tuple(accepted), test, chance, critical, stated)

    @property
    def strength(self) -> np.ndarray:
        """Statistics, of one-sided effects with their sign."""
        return one_sided(self.test.statistic, self.is_two_sided)

    def left_K(self) -> float:
        """Return what the largest effect beyond chance leaves, plausible or not [K]; 0 for none."""
        visible = np.abs(self.scores()) * np.nanmedian(self.pool.visible_K, axis=0)
        return float(np.max(np.where(self.strength >= self.critical, visible, 0.0)))

    def scores(self) -> np.ndarray:
        """Return the amplitudes to first order, in scores."""
        return self.test.statistic * self.test.scale / np.maximum(self.information, 1e-12)

    def gain(self) -> np.ndarray:
        """Return the drop of the sum of squares that each effect would bring."""
        return self.strength.clip(0.0) * self.test.scale * np.abs(self.scores())

    def usable(self) -> list[int]:
        """Return the effects that are seen and plausible, the one that explains most first."""
        known = {self.columns[each].id for each in self.accepted}
        score, gain = self.scores(), self.gain()
        seen = [
            place for place, column in enumerate(self.columns)
            if 0.0 < self.strength[place] >= self.critical and column.is_plausible(score[place])
            and column.id not in known
        ]  # fmt: skip
        return sorted(seen, key=lambda place: -gain[place])

    def best(self) -> int | None:
        """Return the first of them, None where there is none."""
        return next(iter(self.usable()), None)

    def p(self, place: int) -> float:
        """Return the family-wise p-value of an effect [1]."""
        return float((1 + np.sum(self.chance >= self.strength[place])) / (1 + self.chance.size))


def information(pool: Pool, precision: np.ndarray, accepted: Sequence[int]) -> np.ndarray:
    """Return the precision of each effect's score over all machines, by what the fits state."""
    num = pool.num_parameters
    given = [*range(num), *(num + each for each in accepted)]
    whole = pool.information.sum(axis=0)
    H = whole[np.ix_(given, given)] + np.diag([*precision, *([FREE] * len(accepted))])
    across = whole[given, num:]
    return np.diag(whole)[num:] - np.einsum("ea,ea->a", across, np.linalg.solve(H, across))


SEEN = 2.0
"""Standard deviations beyond what tests leave open, from which on machines differ [1]."""


def amplitude(found: Round, best: int) -> tuple[float, float, float]:
    """Return amplitude, its standard deviation, and the spread over machines, in scores.

    Args:
        found: The tests.
        best: Place of the effect.
    """
    pool = found.pool
    num = pool.num_parameters
    given = [*range(num), *(num + each for each in found.accepted)]
    D = np.array([*found.precision, *([FREE] * len(found.accepted))])
    L_ee = pool.information[:, given][:, :, given]
    L_ea = pool.information[:, given, num + best]
    H = L_ee.sum(axis=0) + np.diag(D)
    shared = np.linalg.solve(H, pool.score[:, given].sum(axis=0))
    A = np.linalg.solve(H, L_ea.sum(axis=0))
    own = pool.information[:, num + best, num + best]
    m = own - 2.0 * L_ea @ A + np.einsum("e,ief,f->i", A, L_ee, A)
    total = float(found.information[best])
    of_prior = float(np.sum(D * A**2))
    shares = pool.score[:, num + best] - L_ea @ shared - (pool.score[:, given] - L_ee @ shared) @ A
    pulled = float(A @ (D * shared))
    score = (float(np.sum(shares)) + pulled) / total
    left = shares
    for _ in range(5):
        # what a machine says of the effect once shared parameters have moved with it
        left = shares - m * score
        limit = CLIP * 1.4826 * np.median(np.abs(left - np.median(left)))
        left = np.clip(left, -limit, limit)
        score += (float(np.sum(left)) + pulled - of_prior * score) / total
    variance = float(np.sum(left**2)) * left.size / (left.size - 1) + of_prior
    beyond = float(np.sum(left**2 - m))
    is_seen = beyond > SEEN * float(np.sqrt(2.0 * np.sum(m**2)))
    answer = own - L_ea @ A  # to an amplitude of its own, shared parameters held
    spread = beyond / float(np.sum(answer**2)) if is_seen else 0.0
    return score, float(np.sqrt(variance)) / total, float(np.sqrt(spread))


WIDER = 3.0
"""An effect is claimed against instruments that may be off so many times as far as stated [1]."""

IMPOSSIBLE = 6.0
"""Stated standard deviations from which on one instrument's error is no explanation [1]."""


def claim(
    found: Round, best: int, is_instrument: Bool[np.ndarray, " parameter"], level: float, seed: int
) -> SharedEffect:
    """Return what is said of an effect that was found.

    Args:
        found: The tests.
        best: Place of the effect.
        is_instrument: Which of the shared parameters are errors of instruments.
        level: Probability of finding anything where there is nothing [1].
        seed: Of what is drawn.
    """
    pool = found.pool
    column = found.columns[best]
    score, sd, spread = amplitude(found, best)
    half = float(stdtrit(len(pool.machines) - 1, 0.975)) * sd
    visible = float(np.nanmedian(pool.visible_K[:, best]))
    at = abs(score)
    # with all instruments less known, and with each one alone not known at all
    wider = np.where(is_instrument, WIDER**-2, found.precision)
    among = score_test(pool, wider, found.accepted)
    chance = largest_by_chance(among, found.is_two_sided, seed)
    critical = float(np.quantile(chance, 1.0 - level))
    stands = one_sided(among.statistic, found.is_two_sided)[best] >= critical
    rivals = _instruments(found, best, is_instrument)
    null = column.quantity.null or 0.0
    return SharedEffect(
        id=column.id,
        equivalents=_equivalents(found, best),
        is_beyond_instruments=bool(stands) and not rivals,
        instruments=rivals,
        parameter=column.parameter,
        shape=column.shape,
        unit=column.quantity.unit,
        size=_ranged(null + column.scale * score, column.scale * half),
        spread=column.scale * spread,
        visible_K=ValueWithInterval(
            value=at * visible,
            interval_95=(max(0.0, at - half) * visible, (at + half) * visible),
        ),
        statistic=float(found.test.statistic[best]),
        familywise_p=found.p(best),
        num_machines=int(np.sum(np.isfinite(pool.visible_K[:, best]))),
        separating_test=column.kind.card.separating_test,
    )


def _ranged(value: float, half: float) -> ValueWithInterval:
    return ValueWithInterval(value=value, interval_95=(value - half, value + half))


def _equivalents(found: Round, best: int) -> list[str]:
    """Return the effects that, in its place, leave nothing that asks for it."""
    own = found.columns[best].id
    tied: list[str] = []
    tried: set[str] = set()
    for place in found.usable():  # of each effect, the setting that suits best
        id = found.columns[place].id
        if id == own or id in tried:
            continue
        tried.add(id)
        given = score_test(found.pool, found.precision, [*found.accepted, place])
        same = [i for i, column in enumerate(found.columns) if column.id == own]
        left = one_sided(given.statistic, found.is_two_sided)[same]
        if np.max(left) < found.critical:
            tied.append(id)
    return tied


def _instruments(found: Round, best: int, is_instrument: np.ndarray) -> list[InstrumentRival]:
    """Return the instruments whose error alone would leave nothing that asks for the effect."""
    rivals = []
    for place in np.flatnonzero(is_instrument):
        free = found.precision.copy()
        free[place] = FREE
        given = score_test(found.pool, free, found.accepted)
        left = one_sided(given.statistic, found.is_two_sided)[best]
        off = float(given.shared[place])
        if left < found.critical and abs(off) < IMPOSSIBLE:
            rivals.append(InstrumentRival(name=found.pool.parameters[place], stated_sds=off))
    return sorted(rivals, key=lambda rival: abs(rival.stated_sds))


ALONE = 0.05
"""Probability that a machine without effects shows one by itself [1]."""

NUM_DRAWS = 4000
"""Draws for the level of a single machine."""


def num_alone(pool: Pool, both: np.ndarray, seed: int) -> int:
    """Return the number of machines whose own tests alone show an effect.

    Args:
        pool: The machines.
        both: Which amplitudes may have either sign, shape (effect,).
        seed: Of what is drawn.
    """
    num = pool.num_parameters
    own = np.einsum("iaa->ia", pool.information)[:, num:]
    usable = own > 1e-9
    values = np.where(usable, pool.score[:, num:] / np.sqrt(np.where(usable, own, 1.0)), 0.0)
    mean = pool.information.mean(axis=0)[num:, num:]
    size = np.sqrt(np.maximum(np.diag(mean), 1e-12))
    strength, turn = np.linalg.eigh(mean / size / size[:, None])
    rng = np.random.default_rng([seed, 37])
    draws = rng.standard_normal((NUM_DRAWS, size.size)) @ (turn * np.sqrt(strength.clip(0.0))).T
    critical = np.quantile(one_sided(draws, both).max(axis=1), 1.0 - ALONE)
    return int(np.sum(one_sided(values, both).max(axis=1) >= critical))


MOST_NAMED = 5
"""Machines that are named; all stand in the file."""


def discovery_text(found: FleetDiscoveryResult) -> str:
    """Return what the machines of each type share.

    Args:
        found: The discovery.
    """
    return "\n\n".join("\n".join(_type(each)) for each in found.types)


def _type(found: TypeDiscovery) -> list[str]:
    lines = [f"{'Type ' + found.type if found.type else 'All machines'}: {found.sentence}"]
    for effect in found.effects:
        lines += _effect(effect)
    for effect in found.traces:
        lines.append(f"  trace: {effect.id}, {rounded(effect.visible_K.value, 2)} K")
    if found.effects:
        lines.append(f"  {found.num_alone} of {found.num_machines} machines would show something "
                     f"by their own tests alone; {rounded(ALONE * found.num_machines, 2)} would "
                     "by chance")  # fmt: skip
    elif found.screened:
        seen = [each.could_show_K for each in found.screened if each.could_show_K is not None]
        if seen:
            seen.sort()
            lines.append(f"  half of the catalogue would have been seen from "
                         f"{rounded(seen[len(seen) // 2], 2)} K on")  # fmt: skip
    if found.left_out:
        names = ", ".join(f"{each.machine} ({each.reason})" for each in found.left_out[:MOST_NAMED])
        more = (
            f" and {len(found.left_out) - MOST_NAMED} more"
            if len(found.left_out) > MOST_NAMED
            else ""
        )
        lines.append(f"  without {names}{more}")
    return lines


def _effect(effect: SharedEffect) -> list[str]:
    unit = printed_unit(effect.unit)
    low, high = effect.size.interval_95
    shape = ", ".join(f"{name} = {rounded(value, 3)}" for name, value in effect.shape.items())
    lines = [
        f"  {effect.id}: {effect.parameter} = {rounded(effect.size.value, 3)} {unit}".rstrip()
        + f" ({rounded(low, 3)} … {rounded(high, 3)}){' with ' + shape if shape else ''}",
        f"    leaves {rounded(effect.visible_K.value, 2)} K "
        f"({rounded(effect.visible_K.interval_95[0], 2)} … "
        f"{rounded(effect.visible_K.interval_95[1], 2)} K) of a refitted network; by chance with "
        f"p = {rounded(effect.familywise_p, 2)} over all effects; {effect.num_machines} machines",
    ]
    if effect.spread > 0.0:
        lines.append(f"    from machine to machine by {rounded(effect.spread, 2)} {unit}".rstrip())
    if effect.equivalents:
        lines.append(f"    not told apart from {', '.join(effect.equivalents)}")
    for rival in effect.instruments:
        lines.append(f"    or {rival.name} off, for all machines, by "
                     f"{rounded(abs(rival.stated_sds), 2)} times its stated standard "
                     "deviation")  # fmt: skip
    if not effect.is_beyond_instruments:
        lines.append("    not claimed: instruments off three times as far as stated would do")
    lines.append(f"    what would tell: {effect.separating_test}")
    return lines


FEWEST = 10
"""Machines from which on signs can speak: of fewer, chance alone is too often of one sign."""

MOST = 3
"""Effects that are accepted."""

LEAST_K = 0.02
"""What an effect must leave of a refitted network to matter [K], at the lower end of its interval:
less comes of blocks, clocks and sheets that get warm in any fleet, and a fleet is large enough to
see it."""


@dataclass(frozen=True)
class Search:
    """What was found.

    Attributes:
        effects: Accepted, in that order.
        traces: There, and too small to matter.
        critical: Statistic that is reached by chance with the probability of the level.
        is_left: Whether something that matters is there beyond what was accepted.
        num_alone: Machines that show an effect by themselves.
        screened: All effects.
    """

    effects: list[SharedEffect]
    traces: list[SharedEffect]
    critical: float
    is_left: bool
    num_alone: int
    screened: list[ScreenedEffect]


def search(pool: Pool, instruments: Sequence[str], level: float, seed: int = 0) -> Search:
    """Return the effects that machines share.

    Args:
        pool: Their evidence.
        instruments: Those of the shared parameters that are errors of instruments.
        level: Probability of finding anything where there is nothing [1].
        seed: Of the flipped signs.
    """
    catalogue = {kind.card.id: kind for kind in all_effects()}
    columns = [
        Column.of(name, scale, catalogue)
        for name, scale in zip(pool.effects, pool.scale.tolist(), strict=True)
    ]
    both = np.array([each.is_two_sided for each in columns])
    is_instrument = np.array([name in instruments for name in pool.parameters])
    stated = np.ones(pool.num_parameters)
    accepted: list[int] = []
    effects: list[SharedEffect] = []
    traces: list[SharedEffect] = []
    first = Round.of(pool, columns, both, stated, accepted, level, seed)
    found, is_left = first, False
    while True:
        best = found.best()
        if best is None:
            break
        if len(effects) == MOST or len(accepted) == 2 * MOST:
            is_left = True
            break
        said = claim(found, best, is_instrument, level, seed)
        (effects if said.visible_K.interval_95[0] >= LEAST_K else traces).append(said)
        accepted.append(best)
        found = Round.of(pool, columns, both, stated, accepted, level, seed)
    return Search(
        effects=effects,
        traces=traces,
        critical=first.critical,
        is_left=is_left or found.left_K() >= LEAST_K,
        num_alone=num_alone(pool, both, seed),
        screened=_screened(pool, first),
    )


def _screened(pool: Pool, first: Round) -> list[ScreenedEffect]:
    result = []
    with np.errstate(divide="ignore"):
        least = first.critical * first.test.scale / first.information
    for id in dict.fromkeys(column.id for column in first.columns):
        places = [i for i, column in enumerate(first.columns) if column.id == id]
        seen = [i for i in places if first.information[i] > 1e-9]
        best = max(places, key=lambda i: first.strength[i])
        visible = [float(least[i] * np.nanmedian(pool.visible_K[:, i])) for i in seen]
        result.append(
            ScreenedEffect(
                id=id,
                statistic=float(first.test.statistic[best]),
                could_show_K=min(visible) if visible else None,
                num_machines=int(np.sum(np.isfinite(pool.visible_K[:, best]))),
            )
        )
    return result
