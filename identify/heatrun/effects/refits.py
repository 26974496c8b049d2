"""A candidate refitted with everything else, from more than one start where one may get stuck.

An effect with a state has a body with a time constant of its own: its signature at the null is
that of a small body, and what a large one does is far from it. Equivalent effects come out alike
only if none of them stays at its start.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from lptn.effects import NodeEffect

from .engine import Engine, Refit
from .screen import Score, typical

FIRST_LOOK = 6
"""Evaluations after which the starts are compared; the best of them goes on to its end."""

AWAY = 0.05
"""Scores within this of the null count as no start [1]: there the shape of an effect has no slope,
and a search that starts at its bound hardly leaves it."""


def refit_with(engine: Engine, present: Refit, score: Score) -> Refit:
    """Return the joint fit of the present model and a candidate.

    Args:
        engine: The extended model.
        present: Fit of the model without the candidate.
        score: How the candidate fared in the screening, with its starts.
    """
    free = (*present.free, *score.start)
    starts = _starts(engine, score)
    if len(starts) == 1:
        return engine.refit(_at(present.z, starts[0]), free, present.noise)
    looks = [
        engine.refit(_at(present.z, start), free, present.noise, most=FIRST_LOOK)
        for start in starts
    ]
    best = min(looks, key=lambda look: look.chi2)
    return engine.refit(best.z, free, present.noise)


def _starts(engine: Engine, score: Score) -> list[dict[int, float]]:
    """Return the settings that the screening liked best, the amplitudes off their null."""
    if not issubclass(score.candidate.kind, NodeEffect):
        return [score.start]
    started = []
    for start in (score.start, *score.other_starts):
        moved = dict(start)
        for slot in _amplitudes(engine, start):
            if abs(moved[slot]) < AWAY:
                moved[slot] = typical(engine, slot)
        started.append(moved)
    return started


def _amplitudes(engine: Engine, slots: Iterable[int]) -> list[int]:
    chosen = []
    for slot in slots:
        effect, name = engine.slots[slot].parameter.name.split(".", 1)
        if engine.kinds[effect].card.parameters[name].null is not None:
            chosen.append(slot)
    return chosen


def _at(z: np.ndarray, start: dict[int, float]) -> np.ndarray:
    moved = z.copy()
    for slot, value in start.items():
        moved[slot] = value
    return moved
