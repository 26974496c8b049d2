"""Speed cooling: the sign of the residual follows the speed when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms


class SpeedCooling(HeatEffect):
    r"""Heat leaves the stator more easily as the machine turns.

    $$ 1/R_{eq,sr} \to (1/R_{eq,sr})\,(1 + g\, s^m), \quad s = n/n_{rated} $$

    Attributes:
        g: Relative gain of conductance at rated speed [1].
        m: Exponent [1].
        link: Link whose conductance rises.

    Valid for: a shaft-mounted fan or windage over a closed frame; m = 0.8 where the flow is
        turbulent, 0.5 where it is laminar.
    Reference: T. L. Bergman, A. S. Lavine, F. P. Incropera, D. P. DeWitt, Fundamentals of Heat
        and Mass Transfer, 7th ed., section 7.2: Nu ~ Re^0.5 along a plate in laminar flow and
        Re^0.8 in turbulent flow.
    """

    g: Float[Array, ""]
    m: Float[Array, ""] | float = 0.8
    link: tuple[str, str] = eqx.field(static=True, default=("stator", "ambient"))

    card: ClassVar[EffectCard] = EffectCard(
        id="speed_cooling",
        family="cooling",
        law="1/Req,sr -> (1/Req,sr)(1 + g s^m), s = speed / rated speed",
        needs=("speed",),
        signature="the sign of the residual follows the speed",
        separating_test="cool-downs from the same temperature at two speeds",
        parameters={
            "g": Quantity("1", 0.0, 0.0, 5.0, 0.5, "gain of conductance at rated speed"),
            "m": Quantity("1", None, 0.5, 1.0, 0.8, "exponent of the speed"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        if drive.speed is None:
            raise ValueError(
                "speed_cooling needs the channel speed_rpm: map it, or drop the effect."
            )
        return terms.scale_conductance(self.link, 1.0 + self.g * abs(drive.speed) ** self.m)
