"""Folds over the simulated reading, without storing it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import jax
from jaxtyping import Array, Float

from .effects.base import AbstractEffect, SensorEffect
from .inputs import Inputs
from .losses import CopperLosses
from .march import prepare, sensed_march
from .network import Network
from .sensor import Sensor

Carry = TypeVar("Carry")


def accumulate(
    network: Network,
    losses: CopperLosses,
    inputs: Inputs,
    start: Mapping[str, Float[Array, ""] | float],
    *,
    update: Callable[[Carry, Float[Array, ""], Float[Array, ""], Any], Carry],
    carry: Carry,
    data: Any,
    effects: Sequence[AbstractEffect] = (),
    sensor: Sensor = Sensor(),
) -> Carry:
    """Fold a function over the readings while simulating, without storing them.

    A likelihood over many samples and many parameter sets is bound by memory as soon as the
    temperatures are written out; here they stay in registers.

    Args:
        network: As `simulate`.
        losses: As `simulate`.
        inputs: As `simulate`.
        start: As `simulate`.
        update: Called as `update(carry, before, after, item)` with the readings [degC] at both
            edges of an interval and that interval's item of `data`; returns the next carry.
        carry: What `update` starts from.
        data: Arrays with a leading axis of shape (time,).
        effects: As `simulate`; effects on the sensor keep a state of their own and are refused.
        sensor: As `simulate`.

    Returns:
        The last carry.

    Raises:
        ValueError: As `reading`, and if an effect acts on the sensor.
    """
    if any(isinstance(effect, SensorEffect) for effect in effects):
        raise ValueError("accumulate() carries no sensor effects: use reading() for them.")
    network, full_start = prepare(network, losses, inputs, start, effects, (sensor,))
    first, advance, intervals = sensed_march(
        network, losses, inputs, full_start, effects, (sensor,)
    )

    def fold(state, x):
        before, carry = state
        interval, item = x
        after = advance(before, interval)
        return (after, update(carry, before.reading[0], after.reading[0], item)), None

    last, _ = jax.lax.scan(fold, (first, carry), (intervals, data))
    return last[1]
