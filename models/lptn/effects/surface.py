"""Effects of the surface: what it loses goes not in proportion to its rise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms

STEFAN_BOLTZMANN = 5.670374419e-8
"""[W/(m^2 K^4)]"""

KELVIN = 273.15
"""0 degC on the absolute scale [K]."""


class Radiation(HeatEffect):
    r"""The surface of the stator radiates to walls at the temperature of the sink.

    $$ P_{sr} \mathrel{-}= \varepsilon\sigma A\,[(T_{sr}+273.15)^4 - (T_0+273.15)^4] $$

    Attributes:
        eA: Emissivity times surface [m^2].
        node: Node that it acts on.

    Valid for: walls at the temperature of the sink and a grey surface of one temperature.
    Reference: Stefan-Boltzmann constant: CODATA 2018, 5.670374419e-8 W/(m^2 K^4).
    """

    eA: Float[Array, ""]
    node: str = eqx.field(static=True, default="stator")

    card: ClassVar[EffectCard] = EffectCard(
        id="radiation",
        family="surface",
        law="sr += -eps sigma A [(Tsr + 273.15)^4 - (T0 + 273.15)^4]",
        needs=(),
        signature="the model is too hot at the highest stator temperatures",
        separating_test="a cool-down at standstill from the highest rise, 60 minutes long, in a "
        "room of steady temperature",
        parameters={
            "eA": Quantity("m^2", 0.0, 0.01, 1.4, 0.3, "emissivity times surface"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        hot = temperature[self.node] + KELVIN
        cold = terms.sink + KELVIN
        return terms.add_heat(self.node, -STEFAN_BOLTZMANN * self.eA * (hot**4 - cold**4))


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
