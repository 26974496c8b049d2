"""What is said of a shared effect: its size, what it cannot be told from, and whether it stands."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool
from scipy.stats import t as student

from heatrun.results.gap import ValueWithInterval

from ..results.fleet_discovery import InstrumentRival, SharedEffect
from .pooled import FREE, largest_by_chance, one_sided, score_test
from .rounds import Round
from .size import amplitude

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
    half = float(student.ppf(0.975, len(pool.machines) - 1)) * sd
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
