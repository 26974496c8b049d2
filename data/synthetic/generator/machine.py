"""The machine: two thermal nodes, a winding resistance and a law of the other losses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Torque of a synchronous reluctance machine with magnets grows a little faster than the current:
# the magnets' part is proportional, the reluctance part quadratic before saturation. T ~ I^1.3.
CURRENT_EXPONENT = 1.0 / 1.3


@dataclass(frozen=True)
class Machine:
    """A three-phase machine as a two-node thermal network with its losses.

    Attributes:
        name: For people.
        Ceq_w: Heat capacity of the winding [J/K].
        Ceq_sr: Heat capacity of stator and rotor without the winding [J/K].
        Req_w: Thermal resistance between winding and stator [K/W].
        Req_sr: Thermal resistance between stator and ambient [K/W].
        phase_resistance_ohm: At the reference temperature [ohm].
        rated_current_A: Phase current at rated torque, rms [A].
        rated_speed_rpm: Speed that the loss law is written with [rpm].
        hysteresis_W: Loss in proportion to speed, at rated speed: hysteresis, bearings [W].
        eddy_W: Loss with the square of speed, at rated speed: eddy currents, windage [W].
        stray_W: Loss with current^2 speed^1.5, at rated current and speed [W].
        reference_temperature_degC: Of the phase resistance [degC].
        resistance_coefficient_degC: B of R(T) = R (B + T)/(B + Tref) [degC].
    """

    name: str
    Ceq_w: float
    Ceq_sr: float
    Req_w: float
    Req_sr: float
    phase_resistance_ohm: float
    rated_current_A: float
    rated_speed_rpm: float
    hysteresis_W: float
    eddy_W: float
    stray_W: float
    reference_temperature_degC: float = 25.0
    resistance_coefficient_degC: float = 234.5

    def current(self, torque: ArrayLike) -> NDArray[np.float64]:
        """Return the phase current [A, rms] that a torque takes; torque in parts of the rated."""
        return self.rated_current_A * np.abs(np.asarray(torque)) ** CURRENT_EXPONENT

    def copper_loss_per_kelvin(self, current_A: ArrayLike) -> NDArray[np.float64]:
        """Return k [W/K] of the copper loss k (B + Tw) at a phase current [A, rms]."""
        span = self.resistance_coefficient_degC + self.reference_temperature_degC
        return 3.0 * np.asarray(current_A) ** 2 * self.phase_resistance_ohm / span

    def other_loss(self, current_A: ArrayLike, speed_rpm: ArrayLike) -> NDArray[np.float64]:
        """Return the losses outside the winding [W] at a phase current [A, rms] and speed [rpm]."""
        speed = np.abs(np.asarray(speed_rpm)) / self.rated_speed_rpm
        current = np.asarray(current_A) / self.rated_current_A
        stray = self.stray_W * current**2 * speed**1.5
        return self.hysteresis_W * speed + self.eddy_W * speed**2 + stray


def reference_motor() -> Machine:
    """Return the IPM synchronous reluctance motor with its published network and resistance.

    The loss law is not published. It is chosen so that the published working point (74.2 A, 520 W
    of which 420 W outside the winding) lies on it, at about 4100 rpm.
    """
    return Machine(
        name="IPM-SynRel 2022",
        Ceq_w=666.75,
        Ceq_sr=15060.1,
        Req_w=0.14485,
        Req_sr=0.11625,
        phase_resistance_ohm=0.0062,
        rated_current_A=150.0,
        rated_speed_rpm=6000.0,
        hysteresis_W=260.0,
        eddy_W=320.0,
        stray_W=675.0,
    )


def random_motor(rng: np.random.Generator) -> Machine:
    """Return a machine of the reference's kind, between a third and three times its mass.

    Heat capacities follow the mass, thermal resistances the surface (mass^(-2/3)), each with its
    own scatter. Losses are scaled so that the temperature rises stay those of a machine that is
    used well: neither cold nor burnt.

    Args:
        rng: Source of chance.

    Returns:
        The machine.
    """
    base = reference_motor()
    mass = 10.0 ** rng.uniform(-0.5, 0.5)
    scatter = np.exp(0.25 * rng.standard_normal(4))  # motors of one mass differ by a quarter
    loss_scatter = np.exp(0.10 * rng.standard_normal(4))
    turns = np.exp(0.5 * rng.standard_normal())  # the voltage that the winding was made for
    surface = mass ** (2.0 / 3.0)

    Req_w = base.Req_w * scatter[2] / surface
    Req_sr = base.Req_sr * scatter[3] / surface
    winding_rise = base.Req_w / Req_w * loss_scatter[0]
    stator_rise = base.Req_sr / Req_sr
    return Machine(
        name=f"random, {mass:.2f} of the reference mass",
        Ceq_w=base.Ceq_w * mass * float(scatter[0]),
        Ceq_sr=base.Ceq_sr * mass * float(scatter[1]),
        Req_w=float(Req_w),
        Req_sr=float(Req_sr),
        phase_resistance_ohm=base.phase_resistance_ohm * float(winding_rise) * float(turns) ** 2,
        rated_current_A=base.rated_current_A / float(turns),
        rated_speed_rpm=base.rated_speed_rpm * mass ** (-1.0 / 3.0),
        hysteresis_W=base.hysteresis_W * float(stator_rise * loss_scatter[1]),
        eddy_W=base.eddy_W * float(stator_rise * loss_scatter[2]),
        stray_W=base.stray_W * float(stator_rise * loss_scatter[3]),
    )
