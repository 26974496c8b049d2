"""The parameters of effects beside those of the network: names, priors, transforms."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lptn import EFFECTS
from lptn.effects import AbstractEffect, Quantity

from .parameters import Parameter

WIDE = 4.0
"""A shape parameter whose range spans more than this factor is carried as a logarithm [1]."""

EVENT = "event"
"""Family of the effects that happen once, at their own time in each test."""


def qualified(kind: type[AbstractEffect], name: str) -> str:
    """Return the name of an effect's parameter among all, such as `"speed_cooling.g"`."""
    return f"{kind.card.id}.{name}"


def effect_names(effects: Sequence[type[AbstractEffect]] = ()) -> tuple[str, ...]:
    """Return the qualified names of the catalogue's parameters and of further effects'."""
    kinds = dict.fromkeys([*EFFECTS, *effects])
    return tuple(qualified(kind, name) for kind in kinds for name in kind.card.parameters)


def amplitudes(kind: type[AbstractEffect]) -> tuple[str, ...]:
    """Return the names of the parameters whose null value makes the effect vanish."""
    return tuple(n for n, q in kind.card.parameters.items() if q.null is not None)


def effect_parameters(
    effects: Sequence[type[AbstractEffect]], duration_s: float
) -> list[Parameter]:
    """Return the parameters of effects for one test.

    The score 0 of an amplitude is its null value, so that a vector of zeros leaves the network
    as it was. The physical range is four prior standard deviations wide for a shape parameter,
    and reaches to two of them for an amplitude.

    Args:
        effects: In order.
        duration_s: Length of the test, which bounds when an event can happen [s].
    """
    result = []
    for kind in effects:
        for name, quantity in kind.card.parameters.items():
            transform, centre, sd = _prior(kind, quantity, duration_s)
            result.append(
                Parameter(
                    qualified(kind, name), quantity.unit, quantity.meaning, "effect",
                    transform, centre, sd,
                    f"plausible from {quantity.low:g} to {quantity.high:g} {quantity.unit}",
                    per_test=kind.card.family == EVENT,
                )
            )  # fmt: skip
    return result


def _prior(kind: type[AbstractEffect], quantity: Quantity, duration_s: float):
    low, high = quantity.low, quantity.high
    if quantity.null is not None:
        reach = max(high - quantity.null, quantity.null - low)
        return "linear", quantity.null, 0.5 * reach
    if kind.card.family == EVENT and quantity.unit == "s":
        return "linear", 0.5 * duration_s, 0.25 * duration_s
    if low > 0.0 and high / low > WIDE:
        return "log", math.sqrt(low * high), 0.25 * math.log(high / low)
    return "linear", 0.5 * (low + high), 0.25 * (high - low)
