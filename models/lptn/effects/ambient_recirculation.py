"""Recirculated air: a larger resistance without a lag when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms


class AmbientRecirculation(HeatEffect):
    r"""The machine breathes its own warm air: the sink rises with the losses at once.

    $$ T_0 \to T_0 + r\,P $$

    Attributes:
        r: Rise of the intake per watt of losses [K/W].

    Valid for: air paths that are short against the slow time constant.
    """

    r: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="ambient_recirculation",
        family="sink",
        law="T0 -> T0 + r P, P all losses",
        needs=(),
        signature="it behaves as a larger Req,sr that has no lag",
        separating_test="a step of load with a second ambient sensor at the intake, 10 minutes "
        "before and after",
        parameters={
            "r": Quantity("K/W", 0.0, 0.0, 0.05, 0.01, "rise of the intake per watt of losses"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        total = terms.copper + terms.other
        return terms.with_sink(terms.sink + self.r * total)
