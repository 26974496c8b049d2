"""Where the losses of a network enter: the copper's node, and the shares of all other losses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ...errors import InputError
from ..parameters import Parameter
from .priors import prior, said_of

_SHARE = "equal shares, known to half of that"

Shares = tuple[tuple[str, float | Parameter | None], ...]


def losses_of(
    network: Mapping[str, Any], nodes: Sequence[str], said: Mapping, at: str, where: str
) -> tuple[str, Shares]:
    """Return the copper's node, and the shares of the other losses."""
    losses = network.get("losses")
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
    equal = 1.0 / len(heated)
    shares: list[tuple[str, float | Parameter | None]] = [(heated[0], None)]
    for node in heated[1:]:
        name = said_of(said, "share", node) or f"share_{node}"
        default = Parameter(
            name, "1", f"share of the losses other than copper that heats {node}", "network",
            "linear", equal, 0.5 * equal, _SHARE,
        )  # fmt: skip
        at_parameter = f"{where}, [parameters.{name}]"
        shares.append((node, prior(default, said.get(name, {}), at_parameter)))
    return copper, tuple(shares)
