"""Standby loss: the machine stays above ambient at rest when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms


class StandbyLoss(HeatEffect):
    r"""The inverter switches at rest too: ripple heats the stator all the time.

    $$ P_{sr} \mathrel{+}= P_0 $$

    Attributes:
        P0: Loss at rest [W].

    Valid for: an inverter that is on throughout; it adds heat. The same trace as an offset of the
        sink.
    """

    P0: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="standby_loss",
        family="total loss",
        law="sr += P0 while the inverter is on: adds heat",
        needs=(),
        signature="the machine stays above ambient at rest, as an offset of the ambient sensor "
        "would have it",
        separating_test="an hour at rest with the inverter on, and an hour with it off",
        parameters={
            "P0": Quantity("W", 0.0, 1.0, 200.0, 20.0, "loss at rest"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        return terms.add_other(self.P0)
