"""Speed cooling: the sign of the residual follows the speed when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms, power, require


class SpeedCooling(HeatEffect):
    r"""Heat leaves the stator more easily as the machine turns.

    $$ 1/R_{eq,sr} \to (1/R_{eq,sr})\,(1 + g\, s^m), \quad s = n/n_{rated} $$

    Attributes:
        g: Gain of conductance at rated speed [1].
        m: Exponent of the speed [1].
        link: Link that it acts on.

    Valid for: a shaft-mounted fan or windage over a closed frame; m = 0.8 where the flow is
        turbulent, 0.5 where it is laminar.
    Reference: T. L. Bergman et al., Fundamentals of Heat and Mass Transfer, 7th ed., section 7.2:
        Nu ~ Re^0.5 along a plate in laminar flow, Re^0.8 in turbulent flow.
    """

    g: Float[Array, ""]
    m: Float[Array, ""]
    link: tuple[str, str] = eqx.field(static=True, default=("stator", "ambient"))

    card: ClassVar[EffectCard] = EffectCard(
        id="speed_cooling",
        family="cooling",
        law="1/Req,sr -> (1/Req,sr)(1 + g s^m), s = speed / rated speed",
        needs=("speed",),
        signature="the sign of the residual follows the speed",
        separating_test="two cool-downs from the same temperature, one at standstill and one at "
        "rated speed",
        parameters={
            "g": Quantity("1", 0.0, 0.0, 5.0, 0.5, "gain of conductance at rated speed"),
            "m": Quantity("1", None, 0.5, 1.0, 0.8, "exponent of the speed"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        speed = require(drive.speed, "speed_cooling", "speed_rpm")
        return terms.scale_conductance(self.link, 1.0 + self.g * power(speed, self.m))
