"""What effects and networks need: channels of the records, and a place in the network."""

from __future__ import annotations

from collections.abc import Sequence

from lptn import Network
from lptn.effects import AbstractEffect, NodeEffect, build_all

from ..bench.blocks import Blocks
from ..errors import InputError

CHANNELS = {
    "speed": "speed_rpm",
    "speed_rad": "speed_rpm",
    "coolant": "coolant_degC",
    "fan": "fan",
}
"""Channel of the record behind each optional input."""


def lacking(kind: type[AbstractEffect], test: Blocks) -> tuple[str, ...]:
    """Return the channels that an effect needs and a test does not have."""
    needs = [need for need in kind.card.needs if _is_absent(test, need)]
    return tuple(dict.fromkeys(CHANNELS.get(need, need) for need in needs))


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

    Args:
        tests: The reduced records.
        network: The network as the subject of a sentence.

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
        if sink and test.inputs.second_sink is None:
            raise InputError(
                f"the network {title!r} loses heat to the {sink} too, and this test has no "
                f"{sink}_degC.",
                where=test.name,
                remedy=f'Map the channel: [columns] {sink}_degC = "name in the file [unit]"; or '
                f"give its mean: [constants] {sink}_degC = 20.0.",
            )


def refuse_unmeasured_speed(kinds: Sequence[str], tests: Sequence[Blocks], title: str) -> None:
    """Refuse tests without a speed where losses of a network follow it.

    Args:
        kinds: The losses that do, such as `"mechanical"`.
        tests: The reduced records.
        title: The network in a sentence.

    Raises:
        InputError: With the test and the channel.
    """
    for test in tests:
        if kinds and test.inputs.speed is None:
            raise InputError(
                f"in the network {title!r} the {' and the '.join(kinds)} loss follows the speed, "
                "and this test has no speed_rpm.",
                where=test.name,
                remedy='Map the channel: [columns] speed_rpm = "name in the file [unit]"; give it '
                "where it is held: [constants] speed_rpm = 3000; or take by_speed out of the "
                "network.",
            )


def refuse_unplaced(kinds: Sequence[type[AbstractEffect]], network: Network, title: str) -> None:
    """Refuse effects that a network has no place for.

    Args:
        kinds: The effects.
        network: The network.
        title: The network in a sentence.

    Raises:
        InputError: With the links of the network.
    """
    reason = unplaced(kinds, network)
    if reason:
        raise InputError(
            reason,
            where=title,
            remedy="Drop the effect, or choose another network with --model.",
        )


def unplaced(kinds: Sequence[type[AbstractEffect]], network: Network) -> str:
    """Return why a network has no place for effects, empty if it has one for all of them."""
    wanted = [(kind, dict.fromkeys(kind.card.parameters, 1.0)) for kind in kinds]
    try:
        for effect in build_all(wanted, network):
            if isinstance(effect, NodeEffect):
                network = effect.extend(network)
    except ValueError as error:
        return str(error)
    return ""


def _is_absent(test: Blocks, need: str) -> bool:
    name = "speed" if need == "speed_rad" else need
    return getattr(test.inputs, name, 0.0) is None
