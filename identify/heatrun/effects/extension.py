"""The model with all effects that the tests allow, of which a search or a screening picks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lptn.effects import AbstractEffect

from ..bench.blocks import Blocks
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
    searched = [kind for kind in kinds if kind not in bare.effects]
    blocked = without_resistance(searched, motor)
    found = library(
        [kind for kind in searched if kind.card.id not in blocked],
        bare.topology(),
        [*tests, *held_out],
        num_events=len(tests),
    )
    found = replace(found, unavailable={**found.unavailable, **blocked})
    extended = replace(bare, effects=(*bare.effects, *found.kinds))
    return found, Engine(Problem.of(extended, motor, tests, searched=found.kinds))
