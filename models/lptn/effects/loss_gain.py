"""Gain of the losses: mostly absorbed by C and R."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms


class LossGain(HeatEffect):
    r"""The loss channel is off by a factor.

    $$ P_d \to (1+g)\,P_d $$

    Attributes:
        g: Relative error of the losses [1].

    Valid for: an error in proportion; the scale of losses is not to be had from temperatures alone.
    """

    g: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="loss_gain",
        family="total loss",
        law="Pd -> (1 + g) Pd under a balance, Pol -> (1 + g) Pol under a map: changes the total",
        needs=(),
        signature="hardly anything: heat capacities and resistances absorb it",
        separating_test="a calorimetric test, or the same load with a second power analyser",
        parameters={
            "g": Quantity("1", 0.0, -0.1, 0.1, 0.05, "relative error of the losses"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        is_balance = terms.losses.kind == "balance"
        channel = terms.copper + terms.other if is_balance else terms.other
        return terms.add_other(self.g * channel)
