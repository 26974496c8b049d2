"""Bench records of very different machines, from three lumped masses and nothing of the packages.

Winding, stator with housing, and rotor; Euler steps short against the fastest of them. The figures
of each machine are those of a data sheet of its size: mass of copper and iron times their heat
capacity, losses and temperature rise at the rated load, speed and torque of the shaft. Others are
drawn by chance from the laws of size.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pytest

B_COPPER = 234.5


@dataclass(frozen=True)
class Machine:
    """One machine, as a data sheet gives it."""

    name: str
    C_winding: float  # J/K
    C_stator: float
    C_rotor: float
    R_winding: float  # K/W, winding to stator
    R_rotor: float  # rotor to stator
    R_sink: float  # stator to air or coolant
    resistance: float  # ohm at 25 degC, one phase
    current: float  # A rms, rated
    iron_W: float  # at rated speed
    speed: float  # rpm, rated
    torque: float  # Nm at the rated current
    sink: Literal["ambient", "coolant"] = "ambient"
    sink_degC: float = 22.0
    step_s: float = 1.0
    minutes: float = 90.0


MICRO = Machine(
    "1 W, 12 g", 0.9, 3.6, 1.0, 14.0, 60.0, 45.0, 6.0, 0.17, 0.25, 12000.0, 0.001,
    step_s=0.2, minutes=25.0,
)  # fmt: skip
SERVO = Machine(
    "servo 50 W", 15.0, 150.0, 40.0, 2.0, 6.0, 4.5, 0.5, 2.2, 3.0, 3000.0, 0.16, step_s=0.5
)
STANDARD = Machine(
    "1 kW", 650.0, 4200.0, 1500.0, 0.10, 0.5, 0.33, 3.4, 2.6, 80.0, 1450.0, 6.7, minutes=150.0
)
TRACTION = Machine(
    "traction 50 kW", 2500.0, 11000.0, 7000.0, 0.024, 0.1, 0.013, 0.0146, 170.0, 900.0, 5500.0,
    87.0, sink="coolant", sink_degC=45.0, step_s=0.5, minutes=60.0,
)  # fmt: skip
LARGE = Machine(
    "1 MW", 2.2e5, 1.6e6, 1.1e6, 8e-4, 4e-3, 9e-4, 0.011, 700.0, 17e3, 1490.0, 6400.0,
    step_s=5.0, minutes=480.0,
)  # fmt: skip

MACHINES = (MICRO, SERVO, STANDARD, TRACTION, LARGE)

# share of the rated current and speed over equal parts of the test
DUTIES: dict[str, tuple[tuple[float, float], ...]] = {
    "steps": ((0.6, 0.9), (1.0, 0.5), (0.8, 1.0), (1.1, 0.7)),
    "one level": ((0.95, 0.8),),
    "load and cool-down": ((1.0, 0.8), (1.0, 0.8), (0.0, 0.0)),
    "on and off": ((1.3, 0.6), (0.15, 0.6)) * 10,
    "standstill": ((0.7, 0.0), (0.0, 0.0), (0.85, 0.0)),
}


def bench_record(
    machine: Machine, duty: str = "steps", *, seed: int = 0, hours: float | None = None
) -> dict[str, np.ndarray]:
    """Return the channels of a test: rms current, W, degC, rpm, Nm, s."""
    rng = np.random.default_rng(seed)
    seconds = machine.minutes * 60.0 if hours is None else hours * 3600.0
    time_s = np.arange(0.0, seconds, machine.step_s)
    levels = np.array([(0.0, 0.0), *DUTIES[duty]])
    starts = 20.0 * machine.step_s + np.arange(len(DUTIES[duty])) * seconds / len(DUTIES[duty])
    level = levels[np.searchsorted(starts, time_s, side="right")]
    current, speed = level[:, 0] * machine.current, level[:, 1] * machine.speed
    iron = machine.iron_W * level[:, 1] ** 1.5 * (0.6 + 0.4 * level[:, 0] ** 2)
    sink = machine.sink_degC + 0.2 * np.sin(time_s / 2000.0)
    winding, copper = _integrate(machine, time_s, current, iron, sink)
    torque = machine.torque * level[:, 0] * (speed > 0.0)
    shaft = torque * speed * np.pi / 30.0
    losses = copper + iron
    # power meters err by 0.05 % of what flows through them: the losses carry that
    noise = 5e-4 * (shaft + losses) * rng.standard_normal(time_s.size)
    electrical = shaft + losses + noise
    return {
        "time_s": time_s,
        "phase_current_A": current * (1.0 + 2e-3 * rng.standard_normal(time_s.size)),
        "losses_W": losses + noise,
        "ambient_degC" if machine.sink == "ambient" else "coolant_degC": np.round(
            sink + 0.05 * rng.standard_normal(time_s.size), 1
        ),
        "winding_degC": np.round(winding + 0.1 * rng.standard_normal(time_s.size), 1),
        "speed_rpm": speed + 1e-3 * machine.speed * rng.standard_normal(time_s.size),
        "torque_Nm": torque,
        "electrical_power_W": electrical,
    }


def cooling_record(machine: Machine, *, seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, machine.minutes * 60.0, machine.step_s)
    nothing = np.zeros(time_s.size)
    sink = np.full(time_s.size, machine.sink_degC)
    winding, _ = _integrate(machine, time_s, nothing, nothing, sink, start=machine.sink_degC + 80.0)
    return {
        "time_s": time_s,
        "phase_current_A": nothing,
        "losses_W": nothing,
        "ambient_degC" if machine.sink == "ambient" else "coolant_degC": sink,
        "winding_degC": np.round(winding + 0.1 * rng.standard_normal(time_s.size), 1),
    }


def _integrate(
    machine: Machine,
    time_s: np.ndarray,
    current: np.ndarray,
    iron: np.ndarray,
    sink: np.ndarray,
    start: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Winding temperature [degC] and copper loss [W], sample by sample."""
    m = machine
    winding, copper = np.empty(time_s.size), np.empty(time_s.size)
    w = s = r = m.sink_degC if start is None else start
    heat = 3.0 * m.resistance / (B_COPPER + 25.0) * current**2
    num, dt = 4, m.step_s / 4.0
    for i in range(time_s.size):
        winding[i] = w
        copper[i] = heat[i] * (B_COPPER + w)
        for _ in range(num):
            out = (w - s) / m.R_winding
            across = (r - s) / m.R_rotor
            w += dt * (heat[i] * (B_COPPER + w) - out) / m.C_winding
            r += dt * (0.2 * iron[i] - across) / m.C_rotor
            s += dt * (0.8 * iron[i] + out + across - (s - sink[i]) / m.R_sink) / m.C_stator
    return winding, copper


def drawn_machine(number: int) -> Machine:
    """Return a machine between 50 g and 2 t in still or moving air."""
    rng = np.random.default_rng(4700 + number)
    mass = 10.0 ** rng.uniform(-1.3, 3.3)  # kg, of 430 J/(kg K)
    tau = rng.uniform(900.0, 2200.0) * (mass / 10.0) ** 0.3
    C, G = 430.0 * mass, 430.0 * mass / tau
    losses = G * rng.uniform(40.0, 90.0)
    copper = rng.uniform(0.25, 0.7) * losses
    efficiency = rng.uniform(0.6, 0.97) if mass > 1.0 else rng.uniform(0.5, 0.85)
    speed, current = 10.0 ** rng.uniform(2.5, 4.2), 10.0 ** rng.uniform(-0.5, 2.7)
    torque = losses * efficiency / (1.0 - efficiency) / (speed * np.pi / 30.0)
    return Machine(
        f"{mass:.3g} kg", 0.08 * C, 0.6 * C, 0.32 * C, 0.35 / G * rng.uniform(0.5, 1.2), 1.5 / G,
        1.0 / G, copper / 3.6 / current**2, current, losses - copper, speed, torque,
        sink_degC=rng.uniform(8.0, 34.0), step_s=max(0.2, tau / 1500.0),
        minutes=tau * rng.uniform(0.5, 4.0) / 60.0,
    )  # fmt: skip


def drawn_record(machine: Machine, seed: int, *, slow: bool = False) -> dict[str, np.ndarray]:
    """Return a test of levels drawn by chance, as `bench_record`.

    A slow one turns at a few per cent of the speed, where the inverter takes most of the power.
    """
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, machine.minutes * 60.0, machine.step_s)
    count = int(rng.integers(1, 7))
    part = np.arange(time_s.size) * count // time_s.size
    load, turning = rng.uniform(0.3, 1.15, count)[part], rng.uniform(0.25, 1.0, count)[part]
    turning = turning * (rng.uniform(0.01, 0.12) if slow else 1.0)
    current, speed = load * machine.current, turning * machine.speed
    iron = machine.iron_W * turning**1.4
    sink = machine.sink_degC + 0.3 * np.sin(time_s / 3000.0)
    start = machine.sink_degC + rng.uniform(-1.5, 1.5)
    winding, copper = _integrate(machine, time_s, current, iron, sink, start=start)
    torque = machine.torque * load
    losses = copper + iron
    used = torque * speed * np.pi / 30.0 + losses
    noise = 2e-3 * rng.standard_normal((3, time_s.size))
    return {
        "time_s": time_s,
        "phase_current_A": current * (1.0 + noise[0]),
        "losses_W": losses * (1.0 + noise[1]),
        "ambient_degC": np.round(sink, 1),
        "winding_degC": np.round(winding + 50.0 * noise[2], 1),
        "speed_rpm": speed,
        "torque_Nm": torque,
        "dc_power_W": used * rng.uniform(1.02, 1.15) + rng.uniform(0.05, 0.6) * copper,
    }


def outrunner(grams: float, seconds: float) -> Machine:
    """Return a drone's motor in the wash of its propeller."""
    C_winding, C_stator = 0.385 * grams, 1.1 * grams
    R_sink = seconds / (C_winding + C_stator)
    watts = 40.0 / R_sink  # of which copper makes four fifths at 1 ohm
    return Machine(
        f"outrunner {grams:g} g", C_winding, C_stator, 0.5 * C_stator, 20.0 / watts, 40.0 / watts,
        R_sink, 1.0, np.sqrt(0.8 * watts / 3.0), 0.2 * watts, 6000.0, 6.0 * watts / 628.0,
        step_s=0.5, minutes=30.0,
    )  # fmt: skip


def in_turn(cases: Iterable[Any], machines: Sequence[Machine]) -> list[Any]:
    """Return parameters (case, machine): each case on the next machine, the rest slow."""
    found = []
    for place, case in enumerate(cases):
        values = case if isinstance(case, tuple) else (case,)
        for index, machine in enumerate(machines):
            marks = () if index == place % len(machines) else (pytest.mark.slow,)
            name = values[0] if isinstance(values[0], str) else f"case{place}"
            found.append(pytest.param(*values, machine, marks=marks, id=f"{name}-{machine.name}"))
    return found
