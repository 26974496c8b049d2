"""The effects there are: the catalogue, those of installed packages, and the user's own files.

Behind them stands what effects and networks need: channels of the records, a place in the network.
"""

from __future__ import annotations

import importlib.util
import inspect
import sys
from collections.abc import Sequence
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError, did_you_mean
from ..record.blocks import Blocks
from ..record.motor import Motor

if TYPE_CHECKING:  # JAX, which stands behind them, is loaded where there are effects
    from lptn import Network
    from lptn.effects import AbstractEffect

GROUP = "heatrun.effects"
"""Entry points of this group are effects that other packages add."""


_of_this_process: dict[str, type[AbstractEffect]] = {}
"""Effects of the user's files that were taken in, by id: what is fitted with them is read again."""


def effects_named(
    ids: Sequence[str], where: str = "", files: Sequence[Path] = ()
) -> tuple[type[AbstractEffect], ...]:
    """Return effects by their ids, in order.

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
    from lptn import EFFECTS

    kinds = list(EFFECTS)
    for entry in entry_points(group=GROUP):
        _add(kinds, entry.load(), f"entry point {entry.name}")
    for path in files:
        for kind in _load(path):
            _add(kinds, kind, str(path))
            _of_this_process[kind.card.id] = kind
    return tuple(kinds)


def _load(path: Path) -> list[type[AbstractEffect]]:
    from lptn.effects import AbstractEffect

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
    from lptn.effects import HeatEffect, NodeEffect, SensorEffect

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


CHANNELS = {"speed": "speed_rpm", "speed_rad": "speed_rpm", "coolant": "coolant_degC", "fan": "fan"}
"""Channel of the record behind each optional input."""


def lacking(kind: type[AbstractEffect], test: Blocks) -> tuple[str, ...]:
    """Return the channels that an effect needs and a test does not have."""
    needs = (need.replace("speed_rad", "speed") for need in kind.card.needs)
    lacks = [need for need in needs if getattr(test.inputs, need, 0.0) is None]
    return tuple(dict.fromkeys(CHANNELS.get(need, need) for need in lacks))


def refuse_lacking(kinds: Sequence[type[AbstractEffect]], tests: Sequence[Blocks]) -> None:
    """Refuse effects whose channels a test does not have.

    Args:
        kinds: The effects.
        tests: The reduced records that a model with them is to explain or to predict.

    Raises:
        InputError: With the effect, the channel and the test.
    """
    for kind in kinds:
        for test in tests:
            missing = lacking(kind, test)
            if missing:
                raise InputError(
                    f"the effect {kind.card.id} needs the channel {', '.join(missing)}, which "
                    "this test does not have.",
                    where=test.name,
                    remedy="Map the channel in [columns], leave the test out, or drop the effect.",
                )


def refuse_unmeasured_current(tests: Sequence[Blocks], network: str) -> None:
    """Refuse tests without a current where it says how much of the losses heats the winding.

    Raises:
        InputError: With the test.
    """
    for test in tests:
        if not test.has_current:
            raise InputError(
                f"phase_current_A is missing, from which the copper loss of the {network} follows.",
                where=test.name,
                remedy='Map it in the motor file: [columns] phase_current_A = "COLUMN [A]"; the '
                "current of a DC link is none. Where no current flows, as beside a heater: "
                "[constants] phase_current_A = 0. Or calibrate with --model first, which needs "
                "none.",
            )


def refuse_unmeasured_sink(sink: str, tests: Sequence[Blocks], title: str) -> None:
    """Refuse tests that do not say how warm the second sink of a network is.

    Args:
        sink: Its name, `"ambient"` or `"coolant"`; empty where the network has no second sink.
        tests: The reduced records.
        title: The network in a sentence.

    Raises:
        InputError: With the test and the channel.
    """
    for test in tests:
        if sink and "second_sink" not in test.means:
            raise InputError(
                f"the {title} loses heat to the {sink} too, and this test has no {sink}_degC.",
                where=test.name,
                remedy=f'Map the channel: [columns] {sink}_degC = "name in the file [unit]"; or '
                f"give its mean: [constants] {sink}_degC = 20.0.",
            )


def refuse_unmeasured_speed(kinds: Sequence[str], tests: Sequence[Blocks], title: str) -> None:
    """Refuse tests without a speed where losses of a network follow it.

    Raises:
        InputError: With the test and the channel.
    """
    for test in tests:
        if kinds and "speed" not in test.means:
            raise InputError(
                f"in the {title} the {' and the '.join(kinds)} loss follows the speed, "
                "and this test has no speed_rpm.",
                where=test.name,
                remedy='Map the channel: [columns] speed_rpm = "name in the file [unit]"; give it '
                "where it is held: [constants] speed_rpm = 3000; or take by_speed out of the "
                "network.",
            )


def refuse_unplaced(kinds: Sequence[type[AbstractEffect]], network: Network, title: str) -> None:
    """Refuse effects that a network has no place for.

    Raises:
        InputError: With the links of the network.
    """
    reason = unplaced(kinds, network)
    if reason:
        raise InputError(
            reason, where=title, remedy="Drop the effect, or choose another network with --model."
        )


def unplaced(kinds: Sequence[type[AbstractEffect]], network: Network) -> str:
    """Return why a network has no place for effects, empty if it has one for all of them."""
    import jax

    from lptn.effects import build_all, extended

    wanted = [(kind, dict.fromkeys(kind.card.parameters, 1.0)) for kind in kinds]

    def place_all() -> tuple[str, ...]:
        extended(network, build_all(wanted, network))
        return ()

    try:
        jax.eval_shape(place_all)  # no number is of interest, and none is computed
    except ValueError as error:
        return str(error)
    return ""
