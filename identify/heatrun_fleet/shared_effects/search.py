"""The search for effects that the machines of a type share, one after the other.

A round tests all effects at one stage: which are seen, and how large they are. A claim is what is
said of a shared effect: its size, what it cannot be told from, and whether it stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import stdtrit

from heatrun.results.discovery import ValueWithInterval

from ..results import (
    FleetVerdict,
    InstrumentRival,
    LeftOutOfDiscovery,
    ScreenedEffect,
    SharedEffect,
    TypeDiscovery,
)
from .pooled import CLIP, FREE, Evidence, Pool, Tested, pool, score_test, shape_of

LEVEL = 0.05
"""Probability of finding anything in a fleet without effects, over all its types [1]."""

FEWEST = 10
"""Machines from which on signs can speak: of fewer, chance alone is too often of one sign."""

MOST = 3
"""Effects that are accepted."""

LEAST_K = 0.02
"""What an effect must leave of a refitted network to matter [K], at the lower end of its interval:
less comes of blocks, clocks and sheets that get warm in any fleet, and a fleet is large enough to
see it."""


def discover_type(
    name: str,
    evidence: Sequence[Evidence],
    thermal: set[str],
    left_out: Sequence[LeftOutOfDiscovery] = (),
    *,
    level: float = LEVEL,
    seed: int = 0,
) -> TypeDiscovery:
    """Return the effects that machines of a type share.

    Args:
        name: Of the type.
        evidence: Of each machine.
        thermal: Names of the parameters of the network and its known effects.
        left_out: Machines that take no part.
        level: Probability of finding anything where there is nothing [1].
        seed: Of what is drawn.
    """
    num = len(evidence)
    if num < FEWEST:
        return TypeDiscovery(
            type=name, verdict="too_few",
            sentence=f"Effects that machines share are sought from {FEWEST} machines on; "
            f"{num} can be used.",
            effects=[], traces=[], critical=None, num_machines=num, num_alone=0,
            left_out=list(left_out), screened=[],
        )  # fmt: skip
    whole = pool(evidence)
    is_instrument = np.array([n not in thermal and "_start[" not in n for n in whole.parameters])
    accepted: list[int] = []
    effects: list[SharedEffect] = []
    traces: list[SharedEffect] = []
    first = found = Round.of(whole, accepted, level, seed)
    while usable := found.usable():
        if len(effects) == MOST or len(accepted) == 2 * MOST:
            break
        said = claim(found, usable[0], is_instrument, level, seed)
        (effects if said.visible_K.interval_95[0] >= LEAST_K else traces).append(said)
        accepted.append(usable[0])
        found = Round.of(whole, accepted, level, seed)
    is_left = bool(usable) or found.left_K() >= LEAST_K
    verdict, sentence = _verdict(effects, len(traces), num, is_left=is_left)
    return TypeDiscovery(
        type=name,
        verdict=verdict,
        sentence=sentence,
        effects=effects,
        traces=traces,
        critical=first.critical,
        num_machines=num,
        num_alone=num_alone(whole, seed),
        left_out=list(left_out),
        screened=_screened(first),
    )


def _verdict(
    effects: Sequence[SharedEffect], num_traces: int, num: int, *, is_left: bool
) -> tuple[FleetVerdict, str]:
    if not effects and is_left:
        return "unexplained", (
            f"The {num} machines share something that no effect of the catalogue explains at a "
            "plausible size."
        )
    if not effects:
        seen = f" {num_traces} too small to matter." if num_traces else ""
        return "nothing_found", (
            f"No effect that matters is shared by the {num} machines, as far as their tests "
            f"together can show.{seen}"
        )
    names = " and ".join(
        f"one of {', '.join([each.id, *each.equivalents])}" if each.equivalents else each.id
        for each in effects
    )
    if is_left:
        return "unexplained", (
            f"The {num} machines share something that the catalogue does not explain: {names} "
            "helps, and more is left, so no cause is claimed."
        )
    if any(not each.is_beyond_instruments for each in effects):
        return "instrument", (
            f"The {num} machines share {names}, or an instrument of their bench is off: no number "
            "of machines tells the two apart."
        )
    if any(each.equivalents for each in effects):
        return "ambiguous", (
            f"The {num} machines share {names}; their tests together do not say which."
        )
    return "named", f"The {num} machines share {names}."


@dataclass(frozen=True)
class Round:
    """The tests of all effects with some in the model."""

    pool: Pool  # The machines.
    accepted: tuple[int, ...]  # Effects in the model, by their places.
    test: Tested  # Of each effect.
    chance: np.ndarray  # Largest statistics by chance.
    critical: float  # That of them which is exceeded with the probability of the level.
    # Precision of each effect's score over all machines, by what the fits state.
    information: Float[np.ndarray, " effect"]

    @classmethod
    def of(cls, pool: Pool, accepted: Sequence[int], level: float, seed: int) -> Round:
        """Return the round; arguments as `discover_type`."""
        test = score_test(pool, accepted)
        chance = test.largest_by_chance(seed)
        given, D = pool.given(accepted)
        whole, num = pool.information.sum(axis=0), len(pool.parameters)
        across = whole[given, num:]
        taken = np.linalg.solve(whole[np.ix_(given, given)] + np.diag(D), across)
        information = np.diag(whole)[num:] - np.einsum("ea,ea->a", across, taken)
        critical = float(np.quantile(chance, 1.0 - level))
        return cls(pool, tuple(accepted), test, chance, critical, information)

    def left_K(self) -> float:
        """Return what the largest effect beyond chance leaves, plausible or not [K]; 0 for none."""
        visible = np.abs(self.scores()) * np.nanmedian(self.pool.visible_K, axis=0)
        return float(np.max(np.where(self.test.strength >= self.critical, visible, 0.0)))

    def scores(self) -> np.ndarray:
        """Return the amplitudes to first order, in scores."""
        return self.test.statistic * self.test.scale / np.maximum(self.information, 1e-12)

    def usable(self) -> list[int]:
        """Return the effects that are seen and plausible, the one that explains most first."""
        known = {self.pool.columns[each].id for each in self.accepted}
        score, strength = self.scores(), self.test.strength
        gain = strength.clip(0.0) * self.test.scale * np.abs(score)  # drop of the sum of squares
        seen = [
            place for place, column in enumerate(self.pool.columns)
            if 0.0 < strength[place] >= self.critical and column.is_plausible(score[place])
            and column.id not in known
        ]  # fmt: skip
        return sorted(seen, key=lambda place: -gain[place])


SEEN = 2.0
"""Standard deviations beyond what tests leave open, from which on machines differ [1]."""


def amplitude(found: Round, best: int) -> tuple[float, float, float]:
    """Return amplitude, its standard deviation, and the spread over machines, in scores."""
    pool, at = found.pool, len(found.pool.parameters) + best
    given, D = pool.given(found.accepted)
    L_ee = pool.information[:, given][:, :, given]
    L_ea = pool.information[:, given, at]
    shared = found.test.shared
    A = np.linalg.solve(L_ee.sum(axis=0) + np.diag(D), L_ea.sum(axis=0))
    own = pool.information[:, at, at]
    m = own - 2.0 * L_ea @ A + np.einsum("e,ief,f->i", A, L_ee, A)
    total = float(found.information[best])
    of_prior = float(np.sum(D * A**2))
    shares = pool.score[:, at] - L_ea @ shared - (pool.score[:, given] - L_ee @ shared) @ A
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
    """Return what is said of an effect that was found, by its place; `level` as `discover_type`."""
    pool, column = found.pool, found.pool.columns[best]
    score, sd, spread = amplitude(found, best)
    half = float(stdtrit(len(pool.score) - 1, 0.975)) * sd
    visible, strength = float(np.nanmedian(pool.visible_K[:, best])), found.test.strength[best]
    at = abs(score)
    # with all instruments less known, and with each one alone not known at all
    among = score_test(pool, found.accepted, np.where(is_instrument, WIDER**-2, 1.0))
    critical = float(np.quantile(among.largest_by_chance(seed), 1.0 - level))
    rivals = _instruments(found, best, is_instrument)
    size = column.null + column.scale * score
    return SharedEffect(
        id=column.id,
        equivalents=_equivalents(found, best),
        is_beyond_instruments=bool(among.strength[best] >= critical) and not rivals,
        instruments=rivals,
        parameter=column.label.partition("|")[0].partition(".")[2],
        shape=shape_of(column.label),
        unit=column.quantity.unit,
        size=ValueWithInterval(
            value=size, interval_95=(size - column.scale * half, size + column.scale * half)
        ),
        spread=column.scale * spread,
        visible_K=ValueWithInterval(
            value=at * visible, interval_95=(max(0.0, at - half) * visible, (at + half) * visible)
        ),
        statistic=float(found.test.statistic[best]),
        familywise_p=float((1 + np.sum(found.chance >= strength)) / (1 + found.chance.size)),
        num_machines=int(np.sum(np.isfinite(pool.visible_K[:, best]))),
        separating_test=column.kind.card.separating_test,
    )


def _equivalents(found: Round, best: int) -> list[str]:
    """Return the effects that, in its place, leave nothing that asks for it."""
    columns = found.pool.columns
    same = [i for i, column in enumerate(columns) if column.id == columns[best].id]
    first: dict[str, int] = {}  # of each effect, the setting that suits best
    for place in found.usable():
        first.setdefault(columns[place].id, place)
    return [
        id for id, place in first.items() if id != columns[best].id
        and np.max(score_test(found.pool, [*found.accepted, place]).strength[same]) < found.critical
    ]  # fmt: skip


def _instruments(found: Round, best: int, is_instrument: np.ndarray) -> list[InstrumentRival]:
    """Return the instruments whose error alone would leave nothing that asks for the effect."""
    rivals = []
    for place in np.flatnonzero(is_instrument):
        unknown = np.where(np.arange(is_instrument.size) == place, FREE, 1.0)
        given = score_test(found.pool, found.accepted, unknown)
        off = float(given.shared[place])
        if given.strength[best] < found.critical and abs(off) < IMPOSSIBLE:
            rivals.append(InstrumentRival(name=found.pool.parameters[place], stated_sds=off))
    return sorted(rivals, key=lambda rival: abs(rival.stated_sds))


ALONE = 0.05
"""Probability that a machine without effects shows one by itself [1]."""

NUM_DRAWS = 4000
"""Draws for the level of a single machine."""


def num_alone(pool: Pool, seed: int) -> int:
    """Return the number of machines whose own tests alone show an effect."""
    num = len(pool.parameters)
    own = np.einsum("iaa->ia", pool.information)[:, num:]
    usable = own > 1e-9
    values = np.where(usable, pool.score[:, num:] / np.sqrt(np.where(usable, own, 1.0)), 0.0)
    mean = pool.information.mean(axis=0)[num:, num:]
    size = np.sqrt(np.maximum(np.diag(mean), 1e-12))
    strength, turn = np.linalg.eigh(mean / size / size[:, None])
    rng = np.random.default_rng([seed, 37])
    draws = rng.standard_normal((NUM_DRAWS, size.size)) @ (turn * np.sqrt(strength.clip(0.0))).T
    critical = np.quantile(pool.one_sided(draws).max(axis=1), 1.0 - ALONE)
    return int(np.sum(pool.one_sided(values).max(axis=1) >= critical))


def _screened(first: Round) -> list[ScreenedEffect]:
    result, pool = [], first.pool
    with np.errstate(divide="ignore"):
        least = first.critical * first.test.scale / first.information
    for id in dict.fromkeys(column.id for column in pool.columns):
        places = [i for i, column in enumerate(pool.columns) if column.id == id]
        seen = [i for i in places if first.information[i] > 1e-9]
        best = max(places, key=lambda i: first.test.strength[i])
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
