"""The model with all effects that the tests allow, of which a search picks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lptn.effects import AbstractEffect

from ..bench.blocks import Blocks
from ..inference.catalogue import all_effects
from ..inference.model import Model
from ..motor import Motor
from .library import Library, library, without_resistance


def with_catalogue(
    model: Model,
    motor: Motor,
    tests: Sequence[Blocks],
    kinds: Sequence[type[AbstractEffect]] | None = None,
    held_out: Sequence[Blocks] = (),
) -> tuple[Library, Model]:
    """Return the effects that tests allow to be searched, and the model with all of them.

    Args:
        model: Network with its known effects.
        motor: The machine.
        tests: Reduced records to calibrate on.
        kinds: The effects that are wanted; by default the catalogue and installed ones.
        held_out: Tests that must have what an effect needs too.
    """
    wanted = [kind for kind in kinds or all_effects() if kind not in model.effects]
    blocked = without_resistance(wanted, motor)
    usable = library(
        [kind for kind in wanted if kind.card.id not in blocked],
        model.topology(),
        [*tests, *held_out],
        num_events=len(tests),
    )
    usable = replace(usable, unavailable={**usable.unavailable, **blocked})
    return usable, with_effects(model, usable.kinds)


def with_effects(model: Model, kinds: Sequence[type[AbstractEffect]]) -> Model:
    """Return a model with further effects, in the order of the catalogue."""
    order = {kind: number for number, kind in enumerate(all_effects())}
    joined = sorted(
        dict.fromkeys([*model.effects, *kinds]), key=lambda kind: order.get(kind, len(order))
    )
    return replace(model, effects=tuple(joined))
