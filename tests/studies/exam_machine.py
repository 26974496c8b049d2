"""A simulated machine in the layout of the public "Electric Motor Temperature" file.

Plain NumPy, none of the library: four bodies between a winding and its coolant, heat by
copper, iron and friction, Euler steps of half a second. The profiles hold a load for minutes and
take another one, as those of the public file do.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

STEP_S = 0.5
"""The public file is sampled at 2 Hz."""

CAPACITY = np.array([1700.0, 5200.0, 9500.0, 9000.0])
"""Of winding, tooth, yoke and rotor [J/K]."""

LINKS = {(0, 1): 38.0, (1, 2): 62.0, (1, 3): 6.0}
"""Conductances between these [W/K]."""

TO_COOLANT = 95.0
"""From the yoke [W/K]."""

RESISTANCE = 0.0146
"""Of a phase at 70 degC [ohm]."""

COPPER = 234.5
"""R(T) is proportional to T + this [degC]."""

HOLD_S = (60.0, 900.0)
"""Shortest and longest time that a load is held [s]."""


def machine_file(hours: dict[int, float], seed: int = 1) -> pd.DataFrame:
    """Return a file of that layout.

    Args:
        hours: Duration of each profile by its id [h].
        seed: Of loads, starts and noise.
    """
    parts = [_profile(number, length, seed) for number, length in hours.items()]
    return pd.concat(parts, ignore_index=True)


def _profile(number: int, hours: float, seed: int) -> pd.DataFrame:
    rng = np.random.default_rng([seed, number])
    size = round(hours * 3600.0 / STEP_S)
    speed, torque = _loads(rng, size)
    coolant = 20.0 + 30.0 * rng.random() + 0.5 * np.sin(np.arange(size) * STEP_S / 700.0)
    omega = speed * np.pi / 30.0
    i_q = torque / 0.42
    i_d = -0.3 * np.abs(i_q) - 40.0 * (speed / 6000.0)
    squared = i_d**2 + i_q**2
    iron = 260.0 * (speed / 3000.0) ** 1.5
    friction = 40.0 * (speed / 3000.0)
    bodies = np.empty((size, 4))
    losses = np.empty(size)
    state = coolant[0] + np.array([0.6, 0.5, 0.3, 0.9]) * 20.0 * rng.random()
    for step in range(size):
        bodies[step] = state
        copper = 1.5 * RESISTANCE * squared[step] * (COPPER + state[0]) / (COPPER + 70.0)
        heat = np.array([copper, 0.6 * iron[step], 0.4 * iron[step], friction[step]])
        losses[step] = heat.sum()
        for (one, other), conductance in LINKS.items():
            flow = conductance * (state[one] - state[other])
            heat[one] -= flow
            heat[other] += flow
        heat[2] -= TO_COOLANT * (state[2] - coolant[step])
        state = state + STEP_S * heat / CAPACITY
    # the d/q voltages carry losses and shaft power; those of a machine at rest carry the copper
    power = losses + torque * omega
    total = np.maximum(squared, 1e-9)
    u_d, u_q = (power / 1.5 * i / total for i in (i_d, i_q))
    noise = 0.05 * rng.standard_normal((size, 4))
    winding, tooth, yoke, magnet = (bodies + noise).T
    return pd.DataFrame(
        {
            "u_q": u_q,
            "coolant": coolant,
            "stator_winding": winding,
            "u_d": u_d,
            "stator_tooth": tooth,
            "motor_speed": speed,
            "i_d": i_d,
            "i_q": i_q,
            "pm": magnet,
            "stator_yoke": yoke,
            "ambient": np.full(size, 24.0),
            "torque": torque,
            "profile_id": number,
        }
    )


def _loads(rng: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return speed [rpm] and torque [Nm], held for a while each."""
    speed, torque = np.empty(size), np.empty(size)
    at = 0
    while at < size:
        until = at + round(rng.uniform(*HOLD_S) / STEP_S)
        speed[at:until] = rng.uniform(500.0, 6000.0)
        torque[at:until] = rng.uniform(-60.0, 110.0)
        at = until
    return speed, torque
