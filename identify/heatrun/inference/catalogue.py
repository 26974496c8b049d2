"""The effects there are: the catalogue, those of installed packages, and the user's own files."""

from __future__ import annotations

import importlib.util
import inspect
import sys
from collections.abc import Sequence
from importlib.metadata import entry_points
from pathlib import Path

from lptn import EFFECTS
from lptn.effects import AbstractEffect, HeatEffect, NodeEffect, SensorEffect

from ..errors import InputError, did_you_mean
from ..motor import Motor

GROUP = "heatrun.effects"
"""Entry points of this group are effects that other packages add."""


_of_this_process: dict[str, type[AbstractEffect]] = {}
"""Effects of the user's files that were taken in, by id: what is fitted with them is read again."""


def effects_named(
    ids: Sequence[str], where: str = "", files: Sequence[Path] = ()
) -> tuple[type[AbstractEffect], ...]:
    """Return effects by their ids, in order.

    Args:
        ids: Such as `"speed_cooling"`.
        where: Where they are named, for messages.
        files: As `all_effects`.

    Raises:
        InputError: If an id names no effect, or is there twice.
    """
    if not ids:
        return ()
    kinds = {kind.card.id: kind for kind in (*_of_this_process.values(), *all_effects(files))}
    for name in ids:
        if name not in kinds:
            raise InputError(
                f"there is no effect {name!r:.60}.",
                where=where,
                remedy=did_you_mean(name, kinds) or f"There are {', '.join(kinds)}.",
            )
    if len(set(ids)) < len(ids):
        raise InputError(f"an effect is named twice: {', '.join(ids)}.", where=where)
    return tuple(kinds[name] for name in ids)


def known_effects(motor: Motor, words: str = "") -> tuple[type[AbstractEffect], ...]:
    """Return the effects that a machine is known to have.

    Args:
        motor: The machine, whose file may name some.
        words: Further ids, with commas between them, as after `--with`.

    Raises:
        InputError: If an id names no effect.
    """
    further = [word.strip() for word in words.split(",") if word.strip()]
    ids = tuple(dict.fromkeys([*motor.effects, *further]))
    return effects_named(ids, motor.path or motor.name)


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
            _of_this_process[kind.card.id] = kind
    return tuple(kinds)


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
