"""AC copper loss: a fast residual with I^2 s^2 when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms, require


class AcCopperLoss(HeatEffect):
    r"""Skin and proximity effects raise the copper loss with the square of the frequency.

    $$ P_{js} \to P_{js}\,(1 + k s^2) $$

    Under a measured balance the total is known: the winding gains what the other losses lose.
    Under a map it comes on top.

    Attributes:
        k: AC over DC loss less one, at rated speed [1].

    Valid for: conductors that are small against the skin depth.
    """

    k: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="ac_copper_loss",
        family="copper split",
        law="w += k Pjs s^2; under a balance sr -= the same, under a map it adds",
        needs=("speed",),
        signature="a fast residual that goes with current squared and speed squared",
        separating_test="the same current at standstill (DC), at half and at full speed, 20 "
        "minutes each",
        parameters={
            "k": Quantity("1", 0.0, 0.02, 3.0, 0.3, "AC over DC loss less one, at rated speed"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        speed = require(drive.speed, "ac_copper_loss", "speed_rpm")
        return terms.add_copper(self.k * terms.copper * speed**2)
