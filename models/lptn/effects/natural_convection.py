"""Natural convection: the slow tail of a cool-down is off when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms

REFERENCE_K = 40.0
"""Difference of temperature that Req,sr holds for [K]."""


class NaturalConvection(HeatEffect):
    r"""Part of the conductance to the sink rises with the difference of temperature.

    $$ G_{sr} \to G_{sr}\,[1 - f + f\,(|\theta|/40\,\mathrm{K})^n],\quad \theta = T_{sr} - T_0 $$

    The difference is rounded off below 1 K, where the law has no slope. Req,sr then holds at a
    difference of 40 K.

    Attributes:
        f: Share of the conductance that is by natural convection [1].
        n: Exponent of the difference of temperature [1].
        link: Link that it acts on.

    Valid for: a closed machine in still air; n = 1/4 laminar, 1/3 turbulent.
    Reference: T. L. Bergman et al., Fundamentals of Heat and Mass Transfer, 7th ed., chapter 9.
    """

    f: Float[Array, ""]
    n: Float[Array, ""]
    link: tuple[str, str] = eqx.field(static=True, default=("stator", "ambient"))

    card: ClassVar[EffectCard] = EffectCard(
        id="natural_convection",
        family="surface",
        law="1/Req,sr -> (1/Req,sr)[1 - f + f (|Tsr - T0| / 40 K)^n]",
        needs=(),
        signature="the slow tail of the cool-down does not fit the heating",
        separating_test="a cool-down at standstill from a high rise, 90 minutes long, and a soak "
        "at a small load",
        parameters={
            "f": Quantity(
                "1",
                0.0,
                0.0,
                1.0,
                0.5,
                "share of the conductance that is by natural convection",
                1.0,
            ),
            "n": Quantity("1", None, 0.25, 0.33, 0.29, "exponent of the difference of temperature"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        node = self.link[0]
        theta = temperature[node] - terms.far_end(self.link, temperature)
        # 1 K^2 keeps the slope finite where the difference changes sign
        ratio = ((theta**2 + 1.0) / REFERENCE_K**2) ** (0.5 * self.n)
        return terms.scale_conductance(self.link, 1.0 - self.f + self.f * ratio)
