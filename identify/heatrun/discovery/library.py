"""The library that a discovery searches: the catalogue, and the user's own effects."""

from __future__ import annotations

import importlib.util
import inspect
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path

from lptn import EFFECTS, Network
from lptn.effects import AbstractEffect, HeatEffect, NodeEffect, SensorEffect, applies

from ..bench.blocks import Blocks
from ..errors import InputError
from ..inference.effect_parameters import EVENT

GROUP = "heatrun.effects"
"""Entry points of this group are effects that other packages add."""

CHANNELS = {
    "speed": "speed_rpm",
    "speed_rad": "speed_rpm",
    "coolant": "coolant_degC",
    "fan": "fan",
}
"""Channel of the record behind each optional input."""


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
        missing = [need for need in kind.card.needs if any(_lacks(test, need) for test in tests)]
        if missing:
            channels = ", ".join(dict.fromkeys(CHANNELS.get(need, need) for need in missing))
            unavailable[kind.card.id] = f"needs the channel {channels} in every test"
        elif not kind.fits(network):
            unavailable[kind.card.id] = "splits a network of one node, and this one has more"
        elif not applies(kind, network):
            unavailable[kind.card.id] = "acts on a link that this network does not have"
        else:
            usable.append(kind)
    candidates: list[Candidate] = []
    for kind in usable:
        if kind.card.family == EVENT:
            candidates += [Candidate(kind, index) for index in range(num_events)]
        else:
            candidates.append(Candidate(kind))
    return Library(tuple(usable), tuple(candidates), unavailable)


def all_effects(files: Sequence[Path] = ()) -> tuple[type[AbstractEffect], ...]:
    """Return the catalogue, the effects of installed packages, and those of the user's files.

    Args:
        files: Python files that define effects; they are run, so they must be trusted.

    Raises:
        InputError: If a file cannot be loaded, holds no effect, or an id is taken.
    """
    kinds = list(EFFECTS)
    for entry in entry_points(group=GROUP):
        _add(kinds, entry.load(), f"entry point {entry.name}")
    for path in files:
        for kind in _load(path):
            _add(kinds, kind, str(path))
    return tuple(kinds)


def _lacks(test: Blocks, need: str) -> bool:
    name = "speed" if need == "speed_rad" else need
    return getattr(test.inputs, name, 0.0) is None


def _load(path: Path) -> list[type[AbstractEffect]]:
    if not path.is_file():
        raise InputError("the file of effects is not there.", where=str(path),
                         remedy="Check the path after --effects.")  # fmt: skip
    name = f"heatrun_user_effects_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InputError("the file is no Python file.", where=str(path),
                         remedy="Give one that ends in .py.")  # fmt: skip
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise InputError(
            f"the file of effects does not run: {type(error).__name__}: {error}",
            where=str(path),
            remedy="Start from one of the catalogue's files in lptn/effects.",
        ) from error
    found = [
        item
        for item in vars(module).values()
        if inspect.isclass(item)
        and issubclass(item, AbstractEffect)
        and item.__module__ == name
        and not inspect.isabstract(item)
    ]
    if not found:
        raise InputError(
            "the file defines no effect.",
            where=str(path),
            remedy="Define a class that inherits from HeatEffect, NodeEffect or SensorEffect of "
            "lptn.effects and has a `card`.",
        )
    return found


def _add(kinds: list[type[AbstractEffect]], kind: type[AbstractEffect], where: str) -> None:
    """Add an effect after it has been looked at."""
    if not (inspect.isclass(kind) and issubclass(kind, HeatEffect | NodeEffect | SensorEffect)):
        raise InputError(f"{kind!r} is no effect.", where=where,
                         remedy="Inherit from an effect class of lptn.effects.")  # fmt: skip
    card = getattr(kind, "card", None)
    if card is None or not any(q.null is not None for q in card.parameters.values()):
        raise InputError(
            f"{kind.__name__} has no card with a parameter whose null value makes it vanish.",
            where=where,
            remedy="Give it `card = EffectCard(...)` as the catalogue's effects have.",
        )
    if card.id in {other.card.id for other in kinds}:
        raise InputError(f"the id {card.id!r} is taken.", where=where, remedy="Choose another id.")
    kinds.append(kind)
