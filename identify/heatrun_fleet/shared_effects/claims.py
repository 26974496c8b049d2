"""What is said of a shared effect: its size, what it cannot be told from, and whether it stands.

The text for the terminal is made here too.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool
from scipy.special import stdtrit

from heatrun.io.quantities import printed_unit, rounded
from heatrun.results.discovery import ValueWithInterval

from ..results.fleet_discovery import (
    FleetDiscoveryResult,
    InstrumentRival,
    SharedEffect,
    TypeDiscovery,
)
from .pooled import FREE, Pool, largest_by_chance, one_sided, score_test
from .rounds import Round, amplitude

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


MOST = 5
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
        names = ", ".join(f"{each.machine} ({each.reason})" for each in found.left_out[:MOST])
        more = f" and {len(found.left_out) - MOST} more" if len(found.left_out) > MOST else ""
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
