"""Fan cooling: the slope kinks with the fan when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms, require


class FanCooling(HeatEffect):
    r"""A separate fan or the flow of coolant raises the conductance to the sink.

    $$ 1/R_{eq,sr} \to (1/R_{eq,sr})\,(1 + g\,\varphi) $$

    Attributes:
        g: Gain of conductance at the rated fan [1].
        link: Link that it acts on.

    Valid for: a conductance that rises in proportion to the fan or flow channel.
    """

    g: Float[Array, ""]
    link: tuple[str, str] = eqx.field(static=True, default=("stator", "ambient"))

    card: ClassVar[EffectCard] = EffectCard(
        id="fan_cooling",
        family="cooling",
        law="1/Req,sr -> (1/Req,sr)(1 + g fan), fan over its rated value",
        needs=("fan",),
        signature="the slope kinks whenever the fan or the flow changes",
        separating_test="a cool-down in which the fan is switched every 15 minutes",
        parameters={
            "g": Quantity("1", 0.0, 0.0, 3.0, 0.5, "gain of conductance at the rated fan"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        fan = require(drive.fan, "fan_cooling", "fan")
        return terms.scale_conductance(self.link, 1.0 + self.g * fan)
