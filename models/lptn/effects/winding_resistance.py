"""Winding resistance: a residual with I^2 when it is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms


class WindingResistance(HeatEffect):
    r"""The phase resistance is another than the motor file says.

    $$ R_{s0} \to (1+g)\,R_{s0} $$

    Attributes:
        g: Relative error of the resistance [1].

    Valid for: measuring errors, and gross ones where a line resistance was taken for that of a
        phase; under a balance it moves heat, under a map it adds.
    """

    g: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="winding_resistance",
        family="copper",
        law="Rs0 -> (1 + g) Rs0; under a balance sr loses what w gains, under a map it adds",
        needs=(),
        signature="a residual with the square of the current",
        separating_test="a four-wire measurement of the phase resistance at a known temperature",
        parameters={
            "g": Quantity("1", 0.0, -0.5, 1.0, 0.1, "relative error of the resistance"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        return terms.add_copper(self.g * terms.copper)
