"""The search for effects that the machines of a type share, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heatrun.model.catalogue import all_effects

from ..results.fleet_discovery import ScreenedEffect, SharedEffect
from .claims import claim, num_alone
from .pooled import Pool
from .rounds import Column, Round

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
