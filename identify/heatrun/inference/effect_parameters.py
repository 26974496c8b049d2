"""The parameters of effects beside those of the network: names, priors, transforms.

The catalogue gives sizes as they are usual in one machine, of some ten kilowatts. A body beside a
drone's motor weighs grams, one beside a ship's weighs tons, and both are ordinary. So a quantity
with a dimension goes with the machine: heat capacities, conductances and what follows from them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from lptn import EFFECTS
from lptn.effects import AbstractEffect, Quantity

from .parameters import Parameter, Transform

WIDE = 4.0
"""A shape parameter whose range spans more than this factor is carried as a logarithm [1]."""

EVENT = "event"
"""Family of the effects that happen once, at their own time in each test."""

EXTRA_NODE = "extra node"
"""Family of the effects whose times are those of bodies; other times are those of sensors."""


FASTEST_S = 5.0
"""Time constant below which no body is sought [s]: the steps of a record do not resolve it, and a
simulation with them would not be stable."""


class Size(NamedTuple):
    """The size of a machine, as far as effects go with it.

    Attributes:
        capacity: Heat capacity of the whole machine as one node [J/K].
        resistance: Its resistance to the sink [K/W].
        speed: Rated speed [rad/s].
    """

    capacity: float
    resistance: float
    speed: float


CATALOGUE = Size(capacity=10e3, resistance=0.18, speed=600.0)
"""The machine that the catalogue's sizes are usual in, as the heat balance of its tests has it."""


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


def null_values(effects: Sequence[type[AbstractEffect]]) -> dict[str, float]:
    """Return the values of amplitudes at which effects vanish, by qualified name [their units]."""
    return {
        qualified(kind, name): quantity.null
        for kind in effects
        for name, quantity in kind.card.parameters.items()
        if quantity.null is not None
    }


def effect_parameters(
    effects: Sequence[type[AbstractEffect]],
    duration_s: float,
    searched: Sequence[type[AbstractEffect]] = (),
    size: Size = CATALOGUE,
) -> list[Parameter]:
    """Return the parameters of effects for one test.

    An effect that is searched may be absent: the score 0 of its amplitude is the null value, so
    that a vector of zeros leaves the network as it was. One that is known to be there has a
    log-normal amplitude around its typical value where it cannot change sign. The physical range
    is four prior standard deviations wide for a shape parameter, and reaches to two of them for
    an amplitude.

    Args:
        effects: In order.
        duration_s: Length of the test, which bounds when an event can happen [s].
        searched: Those of them that may be absent; the others are known.
        size: Of the machine.
    """
    result = []
    for kind in effects:
        is_searched = kind in searched
        for name, of_catalogue in kind.card.parameters.items():
            quantity = sized(kind, of_catalogue, size)
            transform, centre, sd = _prior(kind, quantity, duration_s, is_searched=is_searched)
            result.append(
                Parameter(
                    qualified(kind, name), quantity.unit, quantity.meaning,
                    "effect" if is_searched else "known",
                    transform, centre, sd,
                    f"plausible from {quantity.low:.3g} to {quantity.high:.3g} {quantity.unit}",
                    per_test=kind.card.family == EVENT,
                )
            )  # fmt: skip
    return result


def sized(kind: type[AbstractEffect], quantity: Quantity, size: Size) -> Quantity:
    """Return a quantity as it is usual in a machine of a size."""
    capacity = size.capacity / CATALOGUE.capacity
    resistance = size.resistance / CATALOGUE.resistance
    factor = {
        "J/K": capacity,
        "K/W": resistance,
        "W": 1.0 / resistance,  # at one rise
        "m^2": 1.0 / resistance,
        "N m": CATALOGUE.speed / (resistance * size.speed),
        "s": capacity * resistance if kind.card.family == EXTRA_NODE else 1.0,
    }.get(quantity.unit, 1.0)
    low, high, typical = (factor * each for each in (quantity.low, quantity.high, quantity.typical))
    if quantity.unit == "s" and kind.card.family == EXTRA_NODE:
        low = max(low, FASTEST_S)
        high = max(high, 10.0 * low)
        typical = min(max(typical, low), high)
    return quantity._replace(low=low, high=high, typical=typical)


def _prior(
    kind: type[AbstractEffect], quantity: Quantity, duration_s: float, *, is_searched: bool
) -> tuple[Transform, float, float]:
    """Return transform, centre and standard deviation of a prior."""
    low, high = quantity.low, quantity.high
    has_one_sign = quantity.null is not None and quantity.null <= low and quantity.null == 0.0
    if not is_searched and has_one_sign and quantity.typical > 0.0:
        return "log", quantity.typical, max(0.5 * math.log(high / quantity.typical), 0.5)
    if not is_searched and quantity.null is not None and quantity.null > 0.0:
        return "log", quantity.null, 0.5 * math.log(high / quantity.null)
    if quantity.null is not None:
        reach = max(high - quantity.null, quantity.null - low)
        return "linear", quantity.null, 0.5 * reach
    if kind.card.family == EVENT and quantity.unit == "s":
        return "linear", 0.5 * duration_s, 0.25 * duration_s
    if low > 0.0 and high / low > WIDE:
        return "log", math.sqrt(low * high), 0.25 * math.log(high / low)
    return "linear", 0.5 * (low + high), 0.25 * (high - low)
