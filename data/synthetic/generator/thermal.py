"""The truth: temperatures of the two nodes along a load profile.

    Ceq_w  dTw/dt  = Pjs - (Tw - Tsr)/Req_w                         Pjs = k(Is) (B + Tw)
    Ceq_sr dTsr/dt = Pol + (Tw - Tsr)/Req_w - (Tsr - T0)/Req_sr     Pol of current and speed

With Pjs affine in Tw the equations are linear in the temperatures, so that one step of the
classical Runge-Kutta method is a matrix. The matrices of all steps are made at once, with the
inputs at the beginning, the middle and the end of each step; only their product is a loop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .machine import Machine
from .profile import Profile


@dataclass(frozen=True)
class Room:
    """The air around the machine, which no bench holds quite still.

    Attributes:
        ambient_degC: At the start [degC].
        drift_K_per_h: Steady rise [K/h].
        swing_K: Amplitude of a slow swing, such as that of an air conditioner [K].
        swing_period_s: Its period [s].
    """

    ambient_degC: float = 19.4
    drift_K_per_h: float = 0.8
    swing_K: float = 0.15
    swing_period_s: float = 1500.0

    def temperature(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the ambient temperature [degC] at some times [s]."""
        swing = self.swing_K * np.sin(2.0 * np.pi * time_s / self.swing_period_s)
        return self.ambient_degC + self.drift_K_per_h * time_s / 3600.0 + swing


@dataclass(frozen=True)
class Truth:
    """What really happened; arrays of shape (time,).

    Attributes:
        machine: The machine.
        time_s: Time of the samples [s].
        current_A: Phase current, rms [A].
        speed_rpm: Speed [rpm].
        ambient_degC: Ambient temperature [degC].
        winding_degC: Winding temperature [degC].
        stator_degC: Stator temperature [degC].
        copper_loss_W: Joule loss of the winding at its true temperature [W].
        other_loss_W: Loss outside the winding [W].
    """

    machine: Machine
    time_s: NDArray[np.float64]
    current_A: NDArray[np.float64]
    speed_rpm: NDArray[np.float64]
    ambient_degC: NDArray[np.float64]
    winding_degC: NDArray[np.float64]
    stator_degC: NDArray[np.float64]
    copper_loss_W: NDArray[np.float64]
    other_loss_W: NDArray[np.float64]

    @property
    def losses_W(self) -> NDArray[np.float64]:
        """Total losses, electrical in minus mechanical out [W], shape (time,)."""
        return self.copper_loss_W + self.other_loss_W


def simulate(
    machine: Machine,
    profile: Profile,
    *,
    room: Room | None = None,
    start_degC: tuple[float, float] | None = None,
    sample_s: float = 0.1,
    steps_per_sample: int = 4,
    hidden_heat: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
) -> Truth:
    """Return the true course of a test.

    Args:
        machine: The machine.
        profile: Its load.
        room: The air around it; the default room drifts a little.
        start_degC: Winding and stator temperature at the start [degC]; by default a cold start,
            both at ambient temperature.
        sample_s: Time between samples [s]; the profile's duration is a multiple of it.
        steps_per_sample: Integration steps between two samples [1].
        hidden_heat: Heat into winding and stator that no instrument sees [W], shape (2, time), at
            given times [s]; none by default.

    Returns:
        The course, with a sample at the beginning and at the end of the profile.

    Raises:
        ValueError: If the duration is no multiple of the sample time.
    """
    num_intervals = round(profile.duration_s / sample_s)
    if abs(num_intervals * sample_s - profile.duration_s) > 1e-6 * sample_s:
        raise ValueError(
            f"The profile's {profile.duration_s} s are no multiple of the sample time, "
            f"{sample_s} s. Change one of them."
        )
    room = room or Room()
    num_nodes = 2 * steps_per_sample * num_intervals + 1  # beginning, middle and end of each step
    time_s = np.arange(num_nodes, dtype=np.float64) * (sample_s / (2 * steps_per_sample))
    current = machine.current(profile.torque(time_s))
    speed = machine.rated_speed_rpm * profile.speed(time_s)
    other_loss = machine.other_loss(current, speed)
    ambient = room.temperature(time_s)

    rates = _rates(machine, current, other_loss, ambient)
    if hidden_heat is not None:
        rates[:, :2, 2] += hidden_heat(time_s).T / np.array([machine.Ceq_w, machine.Ceq_sr])
    maps = _runge_kutta_maps(rates, sample_s / steps_per_sample)
    start = start_degC or (float(ambient[0]), float(ambient[0]))
    winding, stator = _run(maps, start)[::steps_per_sample].T

    each = slice(None, None, 2 * steps_per_sample)
    heated = machine.resistance_coefficient_degC + winding
    return Truth(
        machine=machine,
        time_s=np.arange(num_intervals + 1, dtype=np.float64) * sample_s,
        current_A=current[each],
        speed_rpm=speed[each],
        ambient_degC=ambient[each],
        winding_degC=winding,
        stator_degC=stator,
        copper_loss_W=machine.copper_loss_per_kelvin(current[each]) * heated,
        other_loss_W=other_loss[each],
    )


def _rates(
    machine: Machine,
    current_A: NDArray[np.float64],
    other_loss_W: NDArray[np.float64],
    ambient_degC: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Matrices A of d(Tw, Tsr, 1)/dt = A (Tw, Tsr, 1), shape (time, 3, 3)."""
    G_w, G_sr = 1.0 / machine.Req_w, 1.0 / machine.Req_sr
    heating = machine.copper_loss_per_kelvin(current_A)
    rates = np.zeros((current_A.size, 3, 3))
    rates[:, 0, 0] = (heating - G_w) / machine.Ceq_w
    rates[:, 0, 1] = G_w / machine.Ceq_w
    rates[:, 0, 2] = heating * machine.resistance_coefficient_degC / machine.Ceq_w
    rates[:, 1, 0] = G_w / machine.Ceq_sr
    rates[:, 1, 1] = -(G_w + G_sr) / machine.Ceq_sr
    rates[:, 1, 2] = (other_loss_W + G_sr * ambient_degC) / machine.Ceq_sr
    return rates


def _runge_kutta_maps(rates: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
    """Matrices that carry (Tw, Tsr, 1) over each step, shape (step, 3, 3)."""
    begin, middle, end = rates[:-2:2], rates[1:-1:2], rates[2::2]
    unity = np.eye(3)
    slope_1 = begin
    slope_2 = middle @ (unity + 0.5 * step_s * slope_1)
    slope_3 = middle @ (unity + 0.5 * step_s * slope_2)
    slope_4 = end @ (unity + step_s * slope_3)
    return unity + step_s / 6.0 * (slope_1 + 2.0 * slope_2 + 2.0 * slope_3 + slope_4)


def _run(maps: NDArray[np.float64], start_degC: tuple[float, float]) -> NDArray[np.float64]:
    """Temperatures of winding and stator at the ends of the steps, shape (step + 1, 2)."""
    winding, stator = start_degC
    course = [start_degC]
    for (a, b, c), (d, e, f) in maps[:, :2].tolist():
        winding, stator = a * winding + b * stator + c, d * winding + e * stator + f
        course.append((winding, stator))
    return np.array(course)
