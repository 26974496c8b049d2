"""The values behind each draw: of the network, and of the effect that it may miss.

Where a posterior is averaged over effects that the network may miss, the parameters of a draw are
where its effect puts them. The figures of that draw are then those of the network with the effect:
without it, the machine would have another rise than the tests show.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int

from lptn.effects import AbstractEffect

from ..model.draws import Draws, PlausibleEffect
from ..model.model import Model
from ..model.parameters import Parameter, amplitudes, effect_parameters, override, qualified
from .machine import Tested

LIKELY = 0.5
"""Probability from which on a condition names an effect that the network misses [1]."""


class DrawValues(NamedTuple):
    """What the figures are computed from.

    Attributes:
        model: The network with all effects that stand behind one of the draws.
        values: By parameter name [their units], shape (draw,) each; an effect that does not stand
            behind a draw is at its null.
        likely: Effects that the network is likely to miss.
    """

    model: Model
    values: dict[str, Float[np.ndarray, " draw"]]
    likely: tuple[type[AbstractEffect], ...]


def alone(draws: Draws) -> DrawValues:
    """Return the network without effects that it may miss; events are those of the first test."""
    values = draws.of_test(draws.parameters.tests[0])
    return DrawValues(draws.model, draws.model.in_general(values), ())


def with_effects(draws: Draws, base: DrawValues, seen: Tested) -> DrawValues:
    """Return the network with the effects behind the draws; `base` itself if there are none.

    An effect of one test is none of the machine in general.

    Args:
        draws: Draws.
        base: The network alone.
        seen: The load of the tests; an effect that needs what it does not tell is left out.
    """
    plausible = draws.plausible
    if plausible is None:
        return base
    used = {
        index: each
        for index, each in enumerate(plausible.effects)
        if each.test is None and np.any(plausible.size[:, index]) and not seen.lacks(each.kind)
    }
    if not used:
        return base
    kinds = tuple(dict.fromkeys(effect.kind for effect in used.values()))
    model = replace(base.model, effects=(*base.model.effects, *kinds))
    # where an effect is absent its amplitude alone counts, which no machine's size moves
    own = override(effect_parameters(kinds, 1.0, searched=kinds), draws.motor)
    known = {**draws.parameters.by_test[0], **own}
    values = {name: np.array(draws) for name, draws in base.values.items()}
    for kind in kinds:
        for name in kind.card.parameters:
            of_effect = qualified(kind, name)
            values[of_effect] = np.full(plausible.size.shape[0], known[of_effect].centre)
    for index, effect in used.items():
        rows = np.flatnonzero(plausible.size[:, index])
        _add(effect, plausible.size[rows, index], rows, known, values)
    likely = tuple(each.kind for each in used.values() if each.probability >= LIKELY)
    return DrawValues(model, jax.tree.map(np.asarray, values), likely)


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
