"""Coefficient of the copper: grows with the winding temperature and I^2 when it is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms


class CopperCoefficient(HeatEffect):
    r"""The resistance of the winding rises otherwise than the material says.

    $$ R(T) = R_{s0}\,\frac{B + \Delta B + T}{B + \Delta B + T_{ref}} $$

    Attributes:
        dB: Deviation of B from the material value [degC].

    Valid for: alloys and other materials; under a balance it moves heat, under a map it adds.
    """

    dB: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="copper_coefficient",
        family="copper",
        law="B -> B + dB of the R(T) law; under a balance sr loses what w gains, under a map it "
        "adds",
        needs=(),
        signature="a residual that grows with the winding temperature and the square of the "
        "current",
        separating_test="resistance by DC at three known temperatures",
        parameters={
            "dB": Quantity("degC", 0.0, -15.0, 15.0, 9.5, "deviation of B from the material value"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        losses = terms.losses
        T = temperature[terms.network.copper_node]
        B, reference = losses.coefficient, losses.reference_temperature
        ratio = (B + self.dB + T) * (B + reference) / ((B + self.dB + reference) * (B + T))
        return terms.add_copper((ratio - 1.0) * terms.copper)
