"""Contact of the sensor: the fast part of the response is too small or too large."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..inputs import Inputs
from .base import EffectCard, Quantity, SensorEffect


class SensorContact(SensorEffect):
    r"""The sensor sits between winding and stator, or at a spot hotter than the mean.

    $$ T_m = (1-k)\,T_w + k\,T_{sr} $$

    Attributes:
        k: Share of the stator in the reading [1]; negative at a hot spot.
        node: Node that it touches beside the winding.

    Valid for: a sensor that is small against both.
    """

    k: Float[Array, ""]
    node: str = eqx.field(static=True, default="stator")

    card: ClassVar[EffectCard] = EffectCard(
        id="sensor_contact",
        family="sensor",
        law="Tm = (1 - k) Tw + k Tsr",
        needs=(),
        signature="the fast part of the response to a step of current is too small, or too large",
        separating_test="temperature by resistance right after a step of current, by the sensor",
        parameters={
            "k": Quantity("1", 0.0, -0.2, 0.5, 0.15, "share of the stator in the reading", 1.0),
        },
    )

    def observe(
        self,
        reading: Float[Array, " edge"],
        temperature: Mapping[str, Float[Array, " edge"]],
        inputs: Inputs,
    ) -> Float[Array, " edge"]:
        """As `SensorEffect.observe`."""
        return reading + self.k * (temperature[self.node] - temperature["winding"])
