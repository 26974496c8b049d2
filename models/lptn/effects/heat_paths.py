"""Effects of the paths that heat takes, from the winding to the stator and on to the sink.

The winding path changes with temperature or time. The cooling has a fan on the shaft, one of its
own, or changes within a test. What the surface loses goes not in proportion to its rise. The sink
is not at the temperature that the bench records.
"""

from __future__ import annotations

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Drive
from ..network import Network
from .base import EffectCard, HeatEffect, Quantity, Temperatures, Terms, power, require

REFERENCE_DEGC = 60.0
"""Temperature that Req,w holds for [degC]."""


class InsulationConductivity(HeatEffect):
    r"""The insulation conducts better or worse as it warms.

    $$ 1/R_{eq,w} \to (1/R_{eq,w})\,(1 + b\,(T_w - 60\,^\circ\mathrm{C})) $$

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
            )
        },
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        rise = temperature[self.link[0]] - REFERENCE_DEGC
        return terms.scale_conductance(self.link, 1.0 + self.b * rise)


class ContactDrift(HeatEffect):
    r"""The contact between winding and core gets worse in the course of a test.

    $$ R_{eq,w} \to R_{eq,w}\,(1 + d\,t) $$

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
            "d": Quantity("1/h", 0.0, 0.0, 0.15, 0.05, "relative rise of the resistance per hour")
        },
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        return terms.scale_conductance(self.link, 1.0 / (1.0 + self.d * drive.time / 3600.0))


class SpeedCooling(HeatEffect):
    r"""Heat leaves the stator more easily as the machine turns.

    $$ 1/R_{eq,sr} \to (1/R_{eq,sr})\,(1 + g\, s^m), \quad s = n/n_{rated} $$

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

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        speed = require(drive.speed, "speed_cooling", "speed_rpm")
        return terms.scale_conductance(self.link, 1.0 + self.g * power(speed, self.m))


class FanCooling(HeatEffect):
    r"""A separate fan or the flow of coolant raises the conductance to the sink.

    $$ 1/R_{eq,sr} \to (1/R_{eq,sr})\,(1 + g\,\varphi) $$

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
        parameters={"g": Quantity("1", 0.0, 0.0, 3.0, 0.5, "gain of conductance at the rated fan")},
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        fan = require(drive.fan, "fan_cooling", "fan")
        return terms.scale_conductance(self.link, 1.0 + self.g * fan)


WIDTH_S = 15.0
"""Width of the logistic course of the change [s]."""


class CoolingStep(HeatEffect):
    r"""From some moment on the conductance to the sink is another.

    $$ 1/R_{eq,sr} \to k/R_{eq,sr} \quad (t > t^*) $$

    The change takes about a minute, so that the moment can be fitted.

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

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        after = 0.5 * (1.0 + jnp.tanh(0.5 * (drive.time - self.t_star) / WIDTH_S))
        return terms.scale_conductance(self.link, 1.0 + (self.k - 1.0) * after)


STEFAN_BOLTZMANN = 5.670374419e-8
"""[W/(m^2 K^4)]"""

KELVIN = 273.15
"""0 degC on the absolute scale [K]."""


class Radiation(HeatEffect):
    r"""The surface of the stator radiates to walls at the temperature of the sink.

    $$ P_{sr} \mathrel{-}= \varepsilon\sigma A\,[(T_{sr}+273.15)^4 - (T_0+273.15)^4] $$

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
        parameters={"eA": Quantity("m^2", 0.0, 0.01, 1.4, 0.3, "emissivity times surface")},
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
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

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        node = self.link[0]
        theta = temperature[node] - terms.far_end(self.link, temperature)
        # 1 K^2 keeps the slope finite where the difference changes sign
        ratio = ((theta**2 + 1.0) / REFERENCE_K**2) ** (0.5 * self.n)
        return terms.scale_conductance(self.link, 1.0 - self.f + self.f * ratio)


class CoolantSink(HeatEffect):
    r"""Part of the heat goes to the coolant instead of the ambient.

    $$ T_0 \to (1-a)\,T_0 + a\,T_{coolant} $$

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
            "a": Quantity("1", 0.0, 0.0, 1.0, 0.5, "share of the coolant in the sink", 1.0)
        },
    )

    @classmethod
    def fits(cls, network: Network) -> bool:
        """Whether the network has one sink: with two of them each has its own resistance."""
        return not network.second_boundary

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        coolant = require(drive.coolant, "coolant_sink", "coolant_degC")
        return terms.with_sink(terms.sink + self.a * (coolant - terms.sink))


class AmbientDrift(HeatEffect):
    r"""The true sink drifts away from the sensor that stands for it, and levels off.

    $$ T_0 \to T_0 + d\,\tau\,(1 - e^{-t/\tau}) $$

    Valid for: a room, a flange or a tank that takes up heat from the start of each test.
    """

    d: Float[Array, ""]
    tau: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="ambient_drift",
        family="sink",
        law="T0 -> T0 + d tau (1 - exp(-t / tau))",
        needs=(),
        signature="a slow ramp that levels off, delayed by the slow time constant",
        separating_test="an hour at rest with a second ambient sensor at the intake of the "
        "cooling air",
        parameters={
            "d": Quantity("K/h", 0.0, -5.0, 5.0, 2.0, "drift of the sink at the start"),
            "tau": Quantity("h", None, 0.5, 8.0, 2.0, "time constant with which it levels off"),
        },
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        risen = self.tau * -jnp.expm1(-drive.time / (3600.0 * self.tau))
        return terms.with_sink(terms.sink + self.d * risen)


class AmbientRecirculation(HeatEffect):
    r"""The machine breathes its own warm air: the sink rises with the losses at once.

    $$ T_0 \to T_0 + r\,P $$

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
            "r": Quantity("K/W", 0.0, 0.0, 0.05, 0.01, "rise of the intake per watt of losses")
        },
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        total = terms.copper + terms.other
        return terms.with_sink(terms.sink + self.r * total)
