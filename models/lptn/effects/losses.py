"""Effects of the losses: where they arise, how large they are, the copper's resistance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Temperatures, Terms, at_load, power, require


class AcCopperLoss(HeatEffect):
    r"""Skin and proximity effects raise the copper loss with the square of the frequency.

    $$ P_{js} \to P_{js}\,(1 + k s^2 r^{-2}), \quad r = (B + T_w)/(B + T_{ref}) $$

    The eddies are driven by a voltage: their loss falls as the resistance rises, that of the
    current rises. Under a measured balance the total is known: the winding gains what the other
    losses lose. Under a map it comes on top.

    Valid for: conductors that are small against the skin depth.
    Reference: R. Wrobel, D. E. Salt, A. Griffo, N. Simpson, P. H. Mellor, Derivation and scaling of
        AC copper loss in thermal modeling of electrical machines, IEEE Transactions on Industrial
        Electronics 61 (2014) 4412-4420.
    """

    k: Float[Array, ""]  # At the temperature that the phase resistance holds for.

    card: ClassVar[EffectCard] = EffectCard(
        id="ac_copper_loss",
        family="copper split",
        law="w += k Pjs s^2/r^2, r = R/R0; under a balance sr -= the same, under a map it adds",
        needs=("speed",),
        signature="a fast residual that goes with current squared and speed squared",
        separating_test="the same current at standstill (DC), at half and at full speed, 20 "
        "minutes each",
        parameters={
            "k": Quantity(
                "1", 0.0, 0.02, 3.0, 0.3, "AC over DC loss less one, at rated speed, cold"
            )
        },
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        speed = require(drive.speed, "ac_copper_loss", "speed_rpm")
        losses, hot = terms.losses, temperature[terms.network.copper_node]
        risen = (losses.coefficient + hot) / (losses.coefficient + losses.reference_temperature)
        return terms.add_copper(self.k * terms.copper * (speed / risen) ** 2)


class IronLossInWinding(HeatEffect):
    r"""Loss of the teeth arises next to the slots and warms the winding first.

    $$ P_w \mathrel{+}= k\,s^n (1 - m + m\,i^2), \quad P_{sr} \mathrel{-}= \text{the same} $$

    It goes with speed and flux, and little with the load, unlike the rest of the other losses: as
    a share of those, a step of load would heat the winding too much, and its heat capacity and
    conductance would come out too large by the same factor.

    Valid for: losses in the teeth; heat is moved at a constant sum under a balance and under a map.
    """

    k: Float[Array, ""]
    n: Float[Array, ""]
    m: Float[Array, ""]  # 0 not at all, 1 in proportion to the squared current.

    card: ClassVar[EffectCard] = EffectCard(
        id="iron_loss_in_winding",
        family="iron split",
        law="w += k s^n (1 - m + m i^2), sr -= the same: moves heat at a constant sum",
        needs=("speed",),
        signature="the winding steps with the speed at no current",
        separating_test="a spin without load at rated speed for 20 minutes, from cold",
        parameters={
            "k": Quantity("W", 0.0, 1.0, 120.0, 30.0, "loss that warms the winding first, rated"),
            "n": Quantity("1", None, 1.0, 2.0, 1.5, "exponent of the speed"),
            "m": Quantity("1", None, -0.4, 0.6, 0.1, "how far it goes with the load"),
        },
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        moved = self.k * at_load(drive, "iron_loss_in_winding", self.n, self.m)
        return terms.add_other(-moved).add_heat(terms.network.copper_node, moved)


class ExternalLoss(HeatEffect):
    r"""Part of the mechanical loss never heats the stator.

    $$ P_{sr} \mathrel{-}= k\, s^m P_{ol} $$

    Valid for: a balance that holds bearing, seal or gear losses outside of the stator; it takes
        heat out under a balance and under a map.
    """

    k: Float[Array, ""]
    m: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="external_loss",
        family="total loss",
        law="sr -= k s^m Pol: takes heat out",
        needs=("speed",),
        signature="the residual follows the speed, much as an error of the losses",
        separating_test="a spin without load at three speeds, 20 minutes each, with the torque "
        "measured",
        parameters={
            "k": Quantity(
                "1",
                0.0,
                0.02,
                0.4,
                0.15,
                "share of the other losses at rated speed that stays outside",
            ),
            "m": Quantity("1", None, 0.0, 2.0, 1.0, "exponent of the speed"),
        },
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        speed = require(drive.speed, "external_loss", "speed_rpm")
        return terms.add_other(-self.k * terms.other * power(speed, self.m))


class BearingFriction(HeatEffect):
    r"""Grease is stiff when cold: friction heats the stator early and fades as it warms.

    $$ P_{sr} \mathrel{+}= T_f\,\omega\,e^{-\kappa (T_{sr}-T_0)} $$

    T_f holds all of what reaches the stator: a share c of it could not be told from its size.

    Valid for: friction that the losses do not hold, so it adds heat, under a map. A balance of
        electrical power and that of the shaft holds it.
    """

    T_f: Float[Array, ""]
    kappa: Float[Array, ""]
    node: str = eqx.field(static=True, default="stator")

    card: ClassVar[EffectCard] = EffectCard(
        id="bearing_friction",
        family="total loss",
        law="sr += Tf omega exp(-kappa (Tsr - T0)): adds heat",
        needs=("speed_rad",),
        signature="early heat that fades within 10 to 30 minutes",
        separating_test="a cold start at rated speed without load for 30 minutes, and the same "
        "again warm",
        parameters={
            "T_f": Quantity("N m", 0.0, 0.005, 1.0, 0.1, "friction torque of the cold bearings"),
            "kappa": Quantity(
                "1/K", None, 0.02, 0.04, 0.03, "fall of the friction with temperature"
            ),
        },
        is_in_balance=True,
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        speed = abs(require(drive.speed_rad, "bearing_friction", "speed_rpm"))
        fading = jnp.exp(-self.kappa * (temperature[self.node] - terms.sink))
        return terms.add_heat(self.node, self.T_f * speed * fading)


class StrayLoadLoss(HeatEffect):
    r"""Loss that only a loaded machine has, with the square of the current and a power of speed.

    $$ k\,(I/I_r)^2 s^{1.5} $$

    Valid for: load-dependent losses beyond copper and no-load iron.
    """

    k: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="stray_load_loss",
        family="copper split",
        law="k i^2 s^1.5: under a balance it moves from the other losses to the winding, under a "
        "map it adds to the other losses",
        needs=("speed",),
        signature="a residual that grows with load and speed together, opposite to speed cooling",
        separating_test="the same current at low and at rated speed, 30 minutes each, with a "
        "cool-down at speed between",
        parameters={
            "k": Quantity("W", 0.0, 2.0, 3000.0, 200.0, "stray loss at rated current and speed")
        },
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        watts = self.k * at_load(drive, "stray_load_loss", 1.5, 1.0)
        is_balance = terms.losses.kind == "balance"
        return terms.add_copper(watts) if is_balance else terms.add_other(watts)


class StandbyLoss(HeatEffect):
    r"""The inverter switches at rest too: ripple heats the stator all the time.

    $$ P_{sr} \mathrel{+}= P_0 $$

    Valid for: an inverter that is on throughout, and losses from a map: it adds heat, which a
        balance of the powers holds. The same trace as an offset of the sink.
    """

    P0: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="standby_loss",
        family="total loss",
        law="sr += P0 while the inverter is on: adds heat",
        needs=(),
        signature="the machine stays above ambient at rest, as an offset of the ambient sensor "
        "would have it",
        separating_test="an hour at rest with the inverter on, and an hour with it off",
        parameters={"P0": Quantity("W", 0.0, 1.0, 200.0, 20.0, "loss at rest")},
        is_in_balance=True,
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        return terms.add_other(self.P0)


class LossGain(HeatEffect):
    r"""The loss channel is off by a factor.

    $$ P_d \to (1+g)\,P_d $$

    Valid for: an error in proportion; the scale of losses is not to be had from temperatures alone.
    """

    g: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="loss_gain",
        family="total loss",
        law="Pd -> (1 + g) Pd under a balance, Pol -> (1 + g) Pol under a map: changes the total",
        needs=(),
        signature="hardly anything: heat capacities and resistances absorb it",
        separating_test="a calorimetric test, or the same load with a second power analyser",
        parameters={"g": Quantity("1", 0.0, -0.1, 0.1, 0.05, "relative error of the losses")},
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        is_balance = terms.losses.kind == "balance"
        channel = terms.copper + terms.other if is_balance else terms.other
        return terms.add_other(self.g * channel)


class CopperCoefficient(HeatEffect):
    r"""The resistance of the winding rises otherwise than the material says.

    $$ R(T) = R_{s0}\,\frac{B + \Delta B + T}{B + \Delta B + T_{ref}} $$

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
            "dB": Quantity("degC", 0.0, -15.0, 15.0, 9.5, "deviation of B from the material value")
        },
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        losses = terms.losses
        T = temperature[terms.network.copper_node]
        B, reference = losses.coefficient, losses.reference_temperature
        ratio = (B + self.dB + T) * (B + reference) / ((B + self.dB + reference) * (B + T))
        return terms.add_copper((ratio - 1.0) * terms.copper)


class WindingResistance(HeatEffect):
    r"""The phase resistance is another than the motor file says.

    $$ R_{s0} \to (1+g)\,R_{s0} $$

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
        parameters={"g": Quantity("1", 0.0, -0.5, 1.0, 0.1, "relative error of the resistance")},
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        return terms.add_copper(self.g * terms.copper)


REFERENCE = 1000.0 * math.pi / 30.0
"""Speed that the watts hold at [rad/s]: 1000 rpm, whatever the rated speed of a machine is."""


class SpeedLoss(HeatEffect):
    r"""Iron or friction loss as a law of the speed, apart from the other losses.

    $$ P = P_1 s + P_2 s^2, \quad s = |n|/1000\,\text{rpm} $$

    The linear term is hysteresis or the friction of bearings, the square one eddy currents or
    windage. Under a measured balance the sum of all losses is known: what this part heats its
    node with is taken out of the other losses, and those are what remains. Under a map it comes on
    top of them.

    It belongs to a network and is none of the effects that a search may find, so that it is not
    in `lptn.EFFECTS`.

    Valid for: losses that the load does not change; iron losses at a flux that is held.
    Reference: J. Pyrhonen, T. Jokinen, V. Hrabovcova, Design of Rotating Electrical Machines,
        2nd ed., 2014, sections 9.1 (hysteresis, eddy currents) and 9.3 (friction, windage).
    """

    linear: Float[Array, ""]  # P1, at 1000 rpm.
    square: Float[Array, ""]  # P2, at 1000 rpm.
    node: str = eqx.field(static=True, default="rotor")

    card: ClassVar[EffectCard] = EffectCard(
        id="speed_loss",
        family="total loss",
        law="node += P1 s + P2 s^2; under a balance the other losses are what remains",
        needs=("speed_rad",),
        signature="the node warms with the speed at no load",
        separating_test="no load at three speeds of 40 minutes each",
        parameters={
            "linear": Quantity("W", 0.0, 0.0, 1e6, 100.0, "loss that grows with the speed"),
            "square": Quantity("W", 0.0, 0.0, 1e6, 100.0, "loss that grows with its square"),
        },
    )

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        speed = abs(require(drive.speed_rad, "a loss by speed", "speed_rpm")) / REFERENCE
        watts = self.linear * speed + self.square * speed**2
        if terms.losses.kind == "balance":
            terms = replace(terms.add_other(-watts), other=terms.other - watts)
        return terms.add_heat(self.node, watts)
