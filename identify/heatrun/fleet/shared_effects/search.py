"""The search for effects that the machines of a type share, one after the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import t as student

from lptn.effects import AbstractEffect, Quantity

from ...inference.catalogue import all_effects
from ...inference.effect_parameters import effect_parameters
from ...results.fleet_discovery import InstrumentRival, ScreenedEffect, SharedEffect
from ...results.gap import ValueWithInterval
from .pooled import CLIP, FREE, Pool, Tested, largest_by_chance, one_sided, score_test

FEWEST = 10
"""Machines from which on signs can speak: of fewer, chance alone is too often of one sign."""

MOST = 3
"""Effects that are accepted."""

LEAST_K = 0.02
"""What an effect must leave of a refitted network to matter [K], at the lower end of its interval:
less comes of blocks, clocks and sheets that get warm in any fleet, and a fleet is large enough to
see it."""

WIDER = 3.0
"""An effect is claimed against instruments that may be off so many times as far as stated [1]."""

BEYOND = 1.5
"""Largest plausible amplitude over that of the catalogue [1]."""

IMPOSSIBLE = 6.0
"""Stated standard deviations from which on one instrument's error is no explanation [1]."""

SEEN = 2.0
"""Standard deviations beyond what tests leave open, from which on machines differ [1]."""

ALONE = 0.05
"""Probability that a machine without effects shows one by itself [1]."""

NUM_DRAWS = 4000
"""Draws for the level of a single machine."""


@dataclass(frozen=True)
class Search:
    """What was found.

    Attributes:
        effects: Accepted, in that order.
        traces: There, and too small to matter.
        critical: Statistic that is reached by chance with the probability of the level.
        is_left: Whether more is there than was accepted.
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
    columns = [_Column.of(name, catalogue) for name in pool.effects]
    both = np.array([each.is_two_sided for each in columns])
    is_instrument = np.array([name in instruments for name in pool.parameters])
    stated = np.ones(pool.num_parameters)
    accepted: list[int] = []
    effects: list[SharedEffect] = []
    traces: list[SharedEffect] = []
    first = _Round.of(pool, columns, both, stated, accepted, level, seed)
    found, is_left = first, False
    while True:
        best = found.best()
        if best is None:
            break
        if len(effects) == MOST or len(accepted) == 2 * MOST:
            is_left = True
            break
        claim = _claim(pool, found, best, is_instrument, level, seed)
        (effects if claim.visible_K.interval_95[0] >= LEAST_K else traces).append(claim)
        accepted.append(best)
        found = _Round.of(pool, columns, both, stated, accepted, level, seed)
    return Search(
        effects=effects,
        traces=traces,
        critical=first.critical,
        is_left=is_left or (bool(effects) and found.is_anything),
        num_alone=_alone(pool, both, seed),
        screened=_screened(pool, first),
    )


@dataclass(frozen=True)
class _Column:
    """An amplitude at a setting of its shape."""

    kind: type[AbstractEffect]
    parameter: str
    shape: dict[str, float]
    quantity: Quantity
    scale: float

    @classmethod
    def of(cls, label: str, catalogue: Mapping[str, type[AbstractEffect]]) -> _Column:
        name, _, said = label.partition("|")
        id, _, parameter = name.partition(".")
        kind = catalogue[id]
        shape = {n: float(v) for n, _, v in (s.partition("=") for s in said.split(",") if s)}
        own = next(p for p in effect_parameters([kind], 1.0, [kind]) if p.name == name)
        return cls(kind, parameter, shape, kind.card.parameters[parameter], own.sd)

    @property
    def id(self) -> str:
        return self.kind.card.id

    @property
    def is_two_sided(self) -> bool:
        null = self.quantity.null or 0.0
        return self.quantity.low < null < self.quantity.high

    def is_plausible(self, score: float) -> bool:
        size = self.scale * score
        null = self.quantity.null or 0.0
        low = min(self.quantity.low - null, 0.0)
        return BEYOND * low <= size <= BEYOND * (self.quantity.high - null)


@dataclass(frozen=True)
class _Round:
    """The tests of all effects with some in the model."""

    pool: Pool
    columns: list[_Column]
    is_two_sided: Bool[np.ndarray, " effect"]
    precision: np.ndarray
    accepted: tuple[int, ...]
    test: Tested
    chance: np.ndarray
    critical: float
    information: Float[np.ndarray, " effect"]

    @classmethod
    def of(
        cls, pool: Pool, columns: list[_Column], both: np.ndarray, precision: np.ndarray,
        accepted: Sequence[int], level: float, seed: int,
    ) -> _Round:  # fmt: skip
        test = score_test(pool, precision, accepted)
        chance = largest_by_chance(test, both, seed)
        critical = float(np.quantile(chance, 1.0 - level))
        information = _information(pool, precision, accepted)
        return cls(pool, columns, both, precision, tuple(accepted), test, chance, critical,
                   information)  # fmt: skip

    @property
    def strength(self) -> np.ndarray:
        return one_sided(self.test.statistic, self.is_two_sided)

    @property
    def is_anything(self) -> bool:
        return bool(np.max(self.strength) >= self.critical)

    def scores(self) -> np.ndarray:
        """Amplitudes to first order, in scores."""
        return self.test.statistic * self.test.scale / np.maximum(self.information, 1e-12)

    def gain(self) -> np.ndarray:
        """Drop of the sum of squares that each effect would bring."""
        return self.strength.clip(0.0) * self.test.scale * np.abs(self.scores())

    def usable(self) -> list[int]:
        """Effects that are seen and plausible, the one that explains most first."""
        known = {self.columns[each].id for each in self.accepted}
        score, gain = self.scores(), self.gain()
        seen = [
            place for place, column in enumerate(self.columns)
            if self.strength[place] >= self.critical and column.is_plausible(score[place])
            and column.id not in known
        ]  # fmt: skip
        return sorted(seen, key=lambda place: -gain[place])

    def best(self) -> int | None:
        return next(iter(self.usable()), None)

    def p(self, place: int) -> float:
        return float((1 + np.sum(self.chance >= self.strength[place])) / (1 + self.chance.size))


def _claim(
    pool: Pool, found: _Round, best: int, is_instrument: np.ndarray, level: float, seed: int
) -> SharedEffect:
    column = found.columns[best]
    score, sd, spread = _amplitude(pool, found, best)
    half = float(student.ppf(0.975, len(pool.machines) - 1)) * sd
    visible = float(np.nanmedian(pool.visible_K[:, best]))
    at = abs(score)
    # with all instruments less known, and with each one alone not known at all
    wider = np.where(is_instrument, WIDER**-2, found.precision)
    among = score_test(pool, wider, found.accepted)
    chance = largest_by_chance(among, found.is_two_sided, seed)
    critical = float(np.quantile(chance, 1.0 - level))
    stands = one_sided(among.statistic, found.is_two_sided)[best] >= critical
    rivals = _instruments(pool, found, best, is_instrument)
    null = column.quantity.null or 0.0
    return SharedEffect(
        id=column.id,
        equivalents=_equivalents(pool, found, best),
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


def _equivalents(pool: Pool, found: _Round, best: int) -> list[str]:
    """Return the effects that, in its place, leave nothing that asks for it."""
    own = found.columns[best].id
    tied: list[str] = []
    tried: set[str] = set()
    for place in found.usable():  # of each effect, the setting that suits best
        id = found.columns[place].id
        if id == own or id in tried:
            continue
        tried.add(id)
        given = score_test(pool, found.precision, [*found.accepted, place])
        same = [i for i, column in enumerate(found.columns) if column.id == own]
        left = one_sided(given.statistic, found.is_two_sided)[same]
        if np.max(left) < found.critical:
            tied.append(id)
    return tied


def _instruments(
    pool: Pool, found: _Round, best: int, is_instrument: np.ndarray
) -> list[InstrumentRival]:
    """Return the instruments whose error alone would leave nothing that asks for the effect."""
    rivals = []
    for place in np.flatnonzero(is_instrument):
        free = found.precision.copy()
        free[place] = FREE
        given = score_test(pool, free, found.accepted)
        left = one_sided(given.statistic, found.is_two_sided)[best]
        off = float(given.shared[place])
        if left < found.critical and abs(off) < IMPOSSIBLE:
            rivals.append(InstrumentRival(name=pool.parameters[place], stated_sds=off))
    return sorted(rivals, key=lambda rival: abs(rival.stated_sds))


def _information(pool: Pool, precision: np.ndarray, accepted: Sequence[int]) -> np.ndarray:
    """Return the precision of each effect's score over all machines, by what the fits state."""
    num = pool.num_parameters
    given = [*range(num), *(num + each for each in accepted)]
    whole = pool.information.sum(axis=0)
    H = whole[np.ix_(given, given)] + np.diag([*precision, *([FREE] * len(accepted))])
    across = whole[given, num:]
    return np.diag(whole)[num:] - np.einsum("ea,ea->a", across, np.linalg.solve(H, across))


def _amplitude(pool: Pool, found: _Round, best: int) -> tuple[float, float, float]:
    """Return amplitude, its standard deviation, and the spread over machines, in scores."""
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


def _alone(pool: Pool, both: np.ndarray, seed: int) -> int:
    """Return the number of machines whose own tests alone show an effect."""
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


def _screened(pool: Pool, first: _Round) -> list[ScreenedEffect]:
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
