"""The library that a discovery searches: the effects that the tests have the inputs for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lptn import Network
from lptn.effects import AbstractEffect, applies

from ..bench.blocks import Blocks
from ..inference.effect_needs import lacking, unplaced
from ..inference.effect_parameters import EVENT
from ..motor import Motor


@dataclass(frozen=True)
class Candidate:
    """An effect that could be missing; an event counts once for each test.

    Attributes:
        kind: The effect.
        test: Index of the test that an event happens in; None for all other effects.
    """

    kind: type[AbstractEffect]
    test: int | None = None

    @property
    def id(self) -> str:
        """Id of the effect."""
        return self.kind.card.id

    def test_name(self, tests: Sequence[Blocks]) -> str | None:
        """Return the test that an event happens in, None for all other effects."""
        return None if self.test is None else tests[self.test].name


@dataclass(frozen=True)
class Library:
    """What is searched, and what cannot be.

    Attributes:
        kinds: Effects that the tests have the inputs for, in order.
        candidates: These as candidates.
        unavailable: Reason by id why an effect is not searched.
    """

    kinds: tuple[type[AbstractEffect], ...]
    candidates: tuple[Candidate, ...]
    unavailable: dict[str, str]


def library(
    kinds: Sequence[type[AbstractEffect]],
    network: Network,
    tests: Sequence[Blocks],
    *,
    num_events: int | None = None,
) -> Library:
    """Return which effects the tests allow to be searched.

    Args:
        kinds: All effects.
        network: The base network.
        tests: The reduced records.
        num_events: Tests that an event can be sought in, the first ones; all by default.
    """
    num_events = len(tests) if num_events is None else num_events
    usable: list[type[AbstractEffect]] = []
    unavailable: dict[str, str] = {}
    for kind in kinds:
        missing = dict.fromkeys(channel for test in tests for channel in lacking(kind, test))
        if missing:
            unavailable[kind.card.id] = f"needs the channel {', '.join(missing)} in every test"
        elif not kind.fits(network):
            unavailable[kind.card.id] = "splits a network of one node, and this one has more"
        elif not applies(kind, network):
            unavailable[kind.card.id] = "acts on a link that this network does not have"
        elif unplaced([kind], network):
            unavailable[kind.card.id] = "adds a node that this network already has"
        else:
            usable.append(kind)
    candidates: list[Candidate] = []
    for kind in usable:
        if kind.card.family == EVENT:
            candidates += [Candidate(kind, index) for index in range(num_events)]
        else:
            candidates.append(Candidate(kind))
    return Library(tuple(usable), tuple(candidates), unavailable)


def without_resistance(kinds: Sequence[type[AbstractEffect]], motor: Motor) -> dict[str, str]:
    """Return the effects, with the reason, that bring in a copper loss which cannot be reckoned."""
    if motor.phase_resistance_ohm is not None or "Rs0" in motor.parameters:
        return {}
    reason = "needs [winding] phase_resistance_ohm in the motor file"
    return {kind.card.id: reason for kind in kinds if kind.rebuilds}
