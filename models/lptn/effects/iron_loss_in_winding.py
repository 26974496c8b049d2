"""Iron loss in the winding: it warms with speed at no current when this is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms, require


class IronLossInWinding(HeatEffect):
    r"""Part of the other losses arises next to the slots and warms the winding first.

    $$ P_w \mathrel{+}= q P_{ol}, \quad P_{sr} \mathrel{-}= q P_{ol} $$

    Attributes:
        q: Share of the other losses that warms the winding first [1].

    Valid for: losses in the teeth; heat is moved at a constant sum under a balance and under a map.
    """

    q: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="iron_loss_in_winding",
        family="iron split",
        law="w += q Pol, sr -= q Pol: moves heat at a constant sum",
        needs=("speed",),
        signature="the winding steps with the speed at no current",
        separating_test="a spin without load at rated speed for 20 minutes, from cold",
        parameters={
            "q": Quantity(
                "1",
                0.0,
                0.02,
                0.45,
                0.15,
                "share of the other losses that warms the winding first",
                1.0,
            ),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        require(drive.speed, "iron_loss_in_winding", "speed_rpm")
        moved = self.q * terms.other
        return terms.add_other(-moved).add_heat(terms.network.copper_node, moved)
