"""Radiation: the model is too hot at the highest temperatures when it is missing."""

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
