"""External loss: the residual follows the speed when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms, power, require


class ExternalLoss(HeatEffect):
    r"""Part of the mechanical loss never heats the stator.

    $$ P_{sr} \mathrel{-}= k\, s^m P_{ol} $$

    Attributes:
        k: Share of the other losses at rated speed that stays outside [1].
        m: Exponent of the speed [1].

    Valid for: a balance that holds bearing, seal or gear losses outside of the stator; it takes
        heat out under a balance and under a map.
    """

    k: Float[Array, ""]
    m: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="external_loss",
        family="total loss",
        law="sr -= k s^m Pol: takes heat out",
        needs=("speed",),
        signature="the residual follows the speed, much as an error of the losses",
        separating_test="a spin without load at three speeds, 20 minutes each, with the torque "
        "measured",
        parameters={
            "k": Quantity(
                "1",
                0.0,
                0.02,
                0.4,
                0.15,
                "share of the other losses at rated speed that stays outside",
            ),
            "m": Quantity("1", None, 0.0, 2.0, 1.0, "exponent of the speed"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        speed = require(drive.speed, "external_loss", "speed_rpm")
        return terms.add_other(-self.k * terms.other * power(speed, self.m))
