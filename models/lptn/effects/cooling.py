"""Effects of the cooling: a fan on the shaft, one of its own, a change within a test."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms, power, require


class SpeedCooling(HeatEffect):
    r"""Heat leaves the stator more easily as the machine turns.

    $$ 1/R_{eq,sr} \to (1/R_{eq,sr})\,(1 + g\, s^m), \quad s = n/n_{rated} $$

    Attributes:
        g: Gain of conductance at rated speed [1].
        m: Exponent of the speed [1].
        link: Link that it acts on.

    Valid for: a shaft-mounted fan or windage over a closed frame; m = 0.8 where the flow is
        turbulent, 0.5 where it is laminar.
    Reference: T. L. Bergman et al., Fundamentals of Heat and Mass Transfer, 7th ed., section 7.2:
        Nu ~ Re^0.5 along a plate in laminar flow, Re^0.8 in turbulent flow.
    """

    g: Float[Array, ""]
    m: Float[Array, ""]
    link: tuple[str, str] = eqx.field(static=True, default=("stator", "ambient"))

    card: ClassVar[EffectCard] = EffectCard(
        id="speed_cooling",
        family="cooling",
        law="1/Req,sr -> (1/Req,sr)(1 + g s^m), s = speed / rated speed",
        needs=("speed",),
        signature="the sign of the residual follows the speed",
        separating_test="two cool-downs from the same temperature, one at standstill and one at "
        "rated speed",
        parameters={
            "g": Quantity("1", 0.0, 0.0, 5.0, 0.5, "gain of conductance at rated speed"),
            "m": Quantity("1", None, 0.5, 1.0, 0.8, "exponent of the speed"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        speed = require(drive.speed, "speed_cooling", "speed_rpm")
        return terms.scale_conductance(self.link, 1.0 + self.g * power(speed, self.m))


class FanCooling(HeatEffect):
    r"""A separate fan or the flow of coolant raises the conductance to the sink.

    $$ 1/R_{eq,sr} \to (1/R_{eq,sr})\,(1 + g\,\varphi) $$

    Attributes:
        g: Gain of conductance at the rated fan [1].
        link: Link that it acts on.

    Valid for: a conductance that rises in proportion to the fan or flow channel.
    """

    g: Float[Array, ""]
    link: tuple[str, str] = eqx.field(static=True, default=("stator", "ambient"))

    card: ClassVar[EffectCard] = EffectCard(
        id="fan_cooling",
        family="cooling",
        law="1/Req,sr -> (1/Req,sr)(1 + g fan), fan over its rated value",
        needs=("fan",),
        signature="the slope kinks whenever the fan or the flow changes",
        separating_test="a cool-down in which the fan is switched every 15 minutes",
        parameters={
            "g": Quantity("1", 0.0, 0.0, 3.0, 0.5, "gain of conductance at the rated fan"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        fan = require(drive.fan, "fan_cooling", "fan")
        return terms.scale_conductance(self.link, 1.0 + self.g * fan)


WIDTH_S = 15.0
"""Width of the logistic course of the change [s]."""


class CoolingStep(HeatEffect):
    r"""From some moment on the conductance to the sink is another.

    $$ 1/R_{eq,sr} \to k/R_{eq,sr} \quad (t > t^*) $$

    The change takes about a minute, so that the moment can be fitted.

    Attributes:
        k: Conductance after the moment over before [1].
        t_star: The moment [s].
        link: Link that it acts on.

    Valid for: one change within a test: a door, a pump, a cover, a filter.
    """

    k: Float[Array, ""]
    t_star: Float[Array, ""]
    link: tuple[str, str] = eqx.field(static=True, default=("stator", "ambient"))

    card: ClassVar[EffectCard] = EffectCard(
        id="cooling_step",
        family="event",
        law="1/Req,sr -> k/Req,sr for t > t*",
        needs=(),
        signature="the slope kinks at one moment and another slow constant holds after it",
        separating_test="the same load held for 40 minutes before and after the moment, with the "
        "cooling watched",
        parameters={
            "k": Quantity("1", 1.0, 0.3, 3.0, 1.5, "conductance after the moment over before"),
            "t_star": Quantity("s", None, 0.0, 14400.0, 1800.0, "the moment"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        after = 0.5 * (1.0 + jnp.tanh(0.5 * (drive.time - self.t_star) / WIDTH_S))
        return terms.scale_conductance(self.link, 1.0 + (self.k - 1.0) * after)
