"""Effects of the path from winding to stator: its resistance changes with temperature or time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms

REFERENCE_DEGC = 60.0
"""Temperature that Req,w holds for [degC]."""


class InsulationConductivity(HeatEffect):
    r"""The insulation conducts better or worse as it warms.

    $$ 1/R_{eq,w} \to (1/R_{eq,w})\,(1 + b\,(T_w - 60\,^\circ\mathrm{C})) $$

    Attributes:
        b: Temperature coefficient of the conductivity [1/K].
        link: Link that it acts on.

    Valid for: impregnation whose conductivity is about linear over the range of the test.
    """

    b: Float[Array, ""]
    link: tuple[str, str] = eqx.field(static=True, default=("winding", "stator"))

    card: ClassVar[EffectCard] = EffectCard(
        id="insulation_conductivity",
        family="winding path",
        law="1/Req,w -> (1/Req,w)(1 + b (Tw - 60 degC))",
        needs=(),
        signature="a residual in proportion to the copper loss at hot windings",
        separating_test="the same step of current from cold and from hot, 10 minutes each",
        parameters={
            "b": Quantity(
                "1/K", 0.0, -0.002, 0.006, 0.003, "temperature coefficient of the conductivity"
            ),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        rise = temperature[self.link[0]] - REFERENCE_DEGC
        return terms.scale_conductance(self.link, 1.0 + self.b * rise)


class ContactDrift(HeatEffect):
    r"""The contact between winding and core gets worse in the course of a test.

    $$ R_{eq,w} \to R_{eq,w}\,(1 + d\,t) $$

    Attributes:
        d: Relative rise of the resistance per hour [1/h].
        link: Link that it acts on.

    Valid for: a steady change from the start of each test.
    """

    d: Float[Array, ""]
    link: tuple[str, str] = eqx.field(static=True, default=("winding", "stator"))

    card: ClassVar[EffectCard] = EffectCard(
        id="contact_drift",
        family="winding path",
        law="Req,w -> Req,w (1 + d t)",
        needs=(),
        signature="a residual in proportion to copper loss times time",
        separating_test="the same step of current at the beginning and at the end of the test, "
        "equally warm",
        parameters={
            "d": Quantity("1/h", 0.0, 0.0, 0.15, 0.05, "relative rise of the resistance per hour"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        return terms.scale_conductance(self.link, 1.0 / (1.0 + self.d * drive.time / 3600.0))
