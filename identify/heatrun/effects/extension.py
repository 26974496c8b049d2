"""The model with all effects that the tests allow, of which a search or a screening picks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lptn.effects import AbstractEffect

from ..bench.blocks import Blocks
from ..inference.catalogue import all_effects
from ..inference.model import Model
from ..inference.problem import Problem
from ..motor import Motor
from .engine import Engine
from .library import Library, library, without_resistance


def extended_engine(
    bare: Model,
    motor: Motor,
    tests: Sequence[Blocks],
    kinds: Sequence[type[AbstractEffect]],
    held_out: Sequence[Blocks] = (),
) -> tuple[Library, Engine]:
    """Return the effects that can be searched, and the engine with all of them.

    Args:
        bare: Network with its known effects.
        motor: The machine.
        tests: Reduced records to calibrate on.
        kinds: The effects that are wanted; those of the network are left out.
        held_out: Tests that must have what an effect needs too.
    """
    found, extended = with_catalogue(bare, motor, tests, kinds, held_out)
    return found, Engine(Problem.of(extended, motor, tests, searched=found.kinds))


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
