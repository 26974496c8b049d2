"""Machines drawn by chance from the laws of size, and tests of them with an inverter in front."""

from __future__ import annotations

import numpy as np
from bench_machines import Machine, _integrate


def drawn_machine(number: int) -> Machine:
    """Return a machine between 50 g and 2 t in still or moving air.

    Args:
        number: Seed.
    """
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
    """Return a test of levels drawn by chance, as `bench_machines.bench_record`.

    Args:
        machine: As drawn.
        seed: Of the levels and the noise.
        slow: Turn at a few per cent of the speed, where the inverter takes most of the power.
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
