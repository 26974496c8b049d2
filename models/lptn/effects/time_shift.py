"""A shift of time: spikes at all steps of the inputs when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Inputs
from .base import EffectCard, Quantity, SensorEffect


class TimeShift(SensorEffect):
    r"""The temperature is recorded late: another logger, a filter, a slow bus.

    $$ T_m(t) = T_w(t - d) $$

    Straight lines between the edges; before the start the first temperature holds.

    Attributes:
        d: Delay [s].

    Valid for: one delay throughout the tests.
    """

    d: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="time_shift",
        family="sensor",
        law="Tm(t) = Tw(t - d)",
        needs=(),
        signature="spikes of zero mean at all steps of the inputs",
        separating_test="a steep step of current, with current and temperature on one logger",
        parameters={"d": Quantity("s", 0.0, 0.0, 60.0, 9.0, "delay of the temperature")},
    )

    def observe(
        self,
        reading: Float[Array, " edge"],
        temperature: Mapping[str, Float[Array, " edge"]],
        inputs: Inputs,
    ) -> Float[Array, " edge"]:
        """As `SensorEffect.observe`."""
        edges = inputs.edges()
        # a nanosecond puts d = 0 on the side from which the slope by d is true
        return jnp.interp(edges - (self.d + 1e-9), edges, reading)
