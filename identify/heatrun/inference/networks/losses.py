"""Where the losses of a network enter: the copper's node, and the shares of all other losses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ...errors import InputError
from ..parameters import Parameter
from .form import SpeedLossForm
from .priors import prior, said_of

_SHARE = "equal shares, known to half of that"

SPEED_LOSS = "log-normal, 95 % within a factor of 19: unknown until a test is looked at"
SD_SPEED_LOSS = 1.5
BY_SPEED = ("iron", "mechanical")
"""Kinds of loss that may follow the speed."""

_TERMS = (("n", "the speed"), ("n2", "the square of the speed"))

Shares = tuple[tuple[str, float | Parameter | None], ...]


def losses_of(
    network: Mapping[str, Any],
    nodes: Sequence[str],
    said: Mapping,
    at: str,
    where: str,
    *,
    of: str = "",
) -> tuple[str, Shares]:
    """Return the copper's node, and the shares of the other losses.

    Those under `by_speed` are left out; with `of`, the shares are those of one such kind, and
    their parameters are named after it.
    """
    losses = network.get("losses")
    if isinstance(losses, dict):
        by_speed = network.get("by_speed", [])
        losses = {kind: to for kind, to in losses.items() if kind not in by_speed}
    if not isinstance(losses, dict) or "copper" not in losses or len(losses) < 2:
        raise InputError(
            "expected losses with copper and at least one of other, iron, mechanical.",
            where=at,
            remedy='Write losses = { copper = "winding", other = "stator" }.',
        )
    copper = losses["copper"]
    if copper not in nodes:
        raise InputError(f"losses: copper = {copper!r:.40} names no node of {list(nodes)}.",
                         where=at)  # fmt: skip
    given: dict[str, float] = {}
    heated: list[str] = []
    for kind, target in losses.items():
        if kind == "copper":
            continue
        if not isinstance(target, str | dict) and not (
            isinstance(target, list) and all(isinstance(node, str) for node in target)
        ):
            raise InputError(
                f"losses: {kind} = {target!r:.40}; expected a node, a list of nodes, or shares by "
                "node.",
                where=at,
            )
        if isinstance(target, dict):
            given |= {str(node): share for node, share in target.items()}
            heated += [str(node) for node in target]
        else:
            heated += [target] if isinstance(target, str) else list(target)
    heated = list(dict.fromkeys(heated))
    unknown = [node for node in heated if node not in nodes]
    if unknown or not heated:
        raise InputError(
            f"losses name {', '.join(map(repr, unknown)) or 'no node'}, expected nodes of "
            f"{list(nodes)}.",
            where=at,
        )
    if given:
        numbers = [given.get(node) for node in heated]
        are_numbers = all(isinstance(n, int | float) and not isinstance(n, bool) for n in numbers)
        if not are_numbers or not math.isclose(math.fsum(given.values()), 1.0, abs_tol=1e-9):
            raise InputError(
                "losses: shares are to be given for every heated node and to add up to 1.",
                where=at,
                remedy="Write other = { tooth = 0.5, yoke = 0.5 }, or a list to have the shares "
                "estimated.",
            )
        return copper, tuple((node, float(given[node])) for node in heated)
    if len(heated) == 1:
        return copper, ((heated[0], 1.0),)
    what = f"the {of} loss by speed" if of else "the losses other than copper"
    equal = 1.0 / len(heated)
    shares: list[tuple[str, float | Parameter | None]] = [(heated[0], None)]
    for node in heated[1:]:
        name = f"share_{of}_{node}" if of else said_of(said, "share", node) or f"share_{node}"
        default = Parameter(
            name, "1", f"share of {what} that heats {node}", "network",
            "linear", equal, 0.5 * equal, _SHARE,
        )  # fmt: skip
        at_parameter = f"{where}, [parameters.{name}]"
        shares.append((node, prior(default, said.get(name, {}), at_parameter)))
    return copper, tuple(shares)


def speed_losses(
    network: Mapping[str, Any], nodes: Sequence[str], said: Mapping, at: str, where: str
) -> tuple[SpeedLossForm, ...]:
    """Return the kinds of loss under `by_speed`, with the watts of each and where they go."""
    kinds = network.get("by_speed", [])
    losses = network.get("losses")
    if not isinstance(kinds, list) or any(kind not in BY_SPEED for kind in kinds):
        raise InputError(
            f"by_speed = {kinds!r:.60}; expected a list with iron, mechanical or both.",
            where=at,
            remedy='Write by_speed = ["mechanical"], for example.',
        )
    if not kinds:
        return ()
    if not isinstance(losses, dict) or any(kind not in losses for kind in kinds):
        raise InputError(
            f"by_speed names {', '.join(kinds)}, and losses do not say which node each heats.",
            where=at,
            remedy='Write losses = { copper = "winding", iron = "stator", mechanical = "rotor" }.',
        )
    if not set(losses) - {"copper", *kinds}:
        raise InputError(
            "by_speed names all losses beside the copper's, and none is left to take what they "
            "leave of the measured losses.",
            where=at,
            remedy="Leave one kind out of by_speed: what the losses hold beyond the laws goes "
            'there; or add other = "stator" to losses.',
        )
    found = []
    for kind in dict.fromkeys(kinds):
        alone = {"losses": {"copper": losses.get("copper"), kind: losses[kind]}}
        _, share = losses_of(alone, nodes, said, at, where, of=kind)
        watts = []
        for term, words in _TERMS:
            name = f"P_{kind}_{term}"
            default = Parameter(
                name, "W", f"{kind} loss that grows with {words}, at 1000 rpm", "network",
                "log", 100.0, SD_SPEED_LOSS, SPEED_LOSS,
            )  # fmt: skip
            at_parameter = f"{where}, [parameters.{name}]"
            watts.append(prior(default, said.get(name, {}), at_parameter))
        found.append(SpeedLossForm(kind, watts[0], watts[1], share))
    return tuple(found)
