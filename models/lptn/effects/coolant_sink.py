"""Coolant as sink: the residual is the lagged coolant temperature when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from ..network import Network
from .base import EffectCard, HeatEffect, Quantity, Terms, require


class CoolantSink(HeatEffect):
    r"""Part of the heat goes to the coolant instead of the ambient.

    $$ T_0 \to (1-a)\,T_0 + a\,T_{coolant} $$

    Attributes:
        a: Share of the coolant in the sink [1].

    Valid for: one path to the sink that air and coolant share.
    """

    a: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="coolant_sink",
        family="sink",
        law="sink temperature -> (1 - a) T0 + a Tcoolant",
        needs=("coolant",),
        signature="the residual is the lagged coolant temperature",
        separating_test="a constant load while the coolant is stepped by 15 K and held for 40 "
        "minutes",
        parameters={
            "a": Quantity("1", 0.0, 0.0, 1.0, 0.5, "share of the coolant in the sink", 1.0),
        },
    )

    @classmethod
    def fits(cls, network: Network) -> bool:
        """Whether the network has one sink: with two of them each has its own resistance."""
        return not network.second_boundary

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        coolant = require(drive.coolant, "coolant_sink", "coolant_degC")
        return terms.with_sink(terms.sink + self.a * (coolant - terms.sink))
