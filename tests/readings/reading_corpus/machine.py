"""Machines and the heat runs that they give, by formulas of our own: the truth of the corpus."""

from dataclasses import dataclass
from functools import cache

import numpy as np


@dataclass(frozen=True)
class Machine:
    """A machine with two masses."""

    name: str  # For the motor file.
    resistance_ohm: float  # Of a phase at 25 degC.
    current_A: float  # Phase current at full load, rms.
    torque_Nm: float  # Torque at full load.
    speed_rpm: float  # Rated speed.
    voltage_V: float  # Of the DC link.
    iron_W: float  # Losses beside those of the copper, at rated speed.
    C_winding_J_per_K: float  # Heat capacity of the winding.
    C_stator_J_per_K: float  # Heat capacity of the rest.
    R_winding_K_per_W: float  # From the winding to the rest.
    R_stator_K_per_W: float  # From the rest to the air.

    def motor_file(self, columns: dict[str, str], *, resistance: bool = True) -> str:
        """Return the motor file with these `[columns]`, with or without the phase resistance."""
        lines = ["[motor]", f'name = "{self.name}"', 'losses = "balance"', "[winding]",
                 'material = "copper"']  # fmt: skip
        if resistance:
            lines += [f"phase_resistance_ohm = {self.resistance_ohm}",
                      "reference_temperature_degC = 25.0"]  # fmt: skip
        if columns:
            lines += ["[columns]", *(f"{key} = {quoted(text)}" for key, text in columns.items())]
        return "\n".join(lines) + "\n"


def quoted(text: str) -> str:
    """Return a TOML string with everything unusual escaped."""
    return '"' + "".join(
        character
        if character.isascii() and character.isprintable() and character not in '"\\'
        else f"\\U{ord(character):08x}"
        for character in text
    ) + '"'  # fmt: skip


MACHINES = (
    Machine("traction", 0.0062, 180.0, 110.0, 4000.0, 350.0, 420.0, 1600.0, 21000.0, 0.05, 0.031),
    Machine("servo", 0.71, 6.5, 4.2, 3000.0, 320.0, 25.0, 150.0, 2600.0, 0.40, 0.27),
    Machine("pump", 0.29, 21.0, 70.0, 1480.0, 560.0, 210.0, 2400.0, 30000.0, 0.07, 0.062),
    Machine("axle", 0.0041, 390.0, 330.0, 6000.0, 620.0, 1900.0, 5200.0, 64000.0, 0.014, 0.009),
)
"""From a servo drive to an axle: what is plausible for one is not for another."""


@cache
def heat_run(number: int, rows: int, step_s: float) -> dict[str, np.ndarray]:
    """Return the canonical channels, shape (rows,), of a heat run of a machine and a load.

    Samples are step_s [s] apart.
    """
    machine = MACHINES[number % len(MACHINES)]
    rng = np.random.default_rng(1000 + number)
    time_s = np.arange(rows) * float(step_s)
    num_steps = 7
    starts = np.sort(rng.uniform(0.05, 0.9, num_steps - 1)) * rows
    phase = np.searchsorted(starts, np.arange(rows), side="right")
    loads, speeds = rng.uniform(0.3, 1.0, (2, num_steps))
    if (number // len(MACHINES)) % 2 == 0:
        # One gentle step: no jump in the record that would stop a wrong reading by accident.
        loads, speeds = np.sort(loads)[[0, 0, 2, 2, 2, 2, 2]], np.full(num_steps, 0.6)
    load, speed_rpm = loads[phase], machine.speed_rpm * speeds[phase]
    ambient = 22.0 + number % 5 / 2 + 0.2 * np.sin(2 * np.pi * time_s / 7200)
    winding, stator, losses = np.empty(rows), np.empty(rows), np.empty(rows)
    T_w = T_s = float(ambient[0]) + 1.3
    current = machine.current_A * load
    iron = machine.iron_W * (speed_rpm / machine.speed_rpm) ** 1.4
    # A sixth of the winding's own time constant at most, whatever the logger's step is.
    parts = max(
        1, int(np.ceil(step_s * 6 / (machine.C_winding_J_per_K * machine.R_winding_K_per_W)))
    )
    dt = step_s / parts
    for i in range(rows):
        copper = 3 * current[i] ** 2 * machine.resistance_ohm * (234.5 + T_w) / 259.5
        winding[i], stator[i], losses[i] = T_w, T_s, copper + iron[i]
        for _ in range(parts):
            flow = (T_w - T_s) / machine.R_winding_K_per_W
            out = (T_s - ambient[i]) / machine.R_stator_K_per_W
            T_w += dt * (copper - flow) / machine.C_winding_J_per_K
            T_s += dt * (iron[i] + flow - out) / machine.C_stator_J_per_K
    torque = machine.torque_Nm * load
    mechanical = torque * speed_rpm * np.pi / 30
    voltage = machine.voltage_V * (1 - 0.02 * load)
    return {
        "time_s": time_s,
        "phase_current_A": current,
        "losses_W": losses,
        "ambient_degC": ambient,
        "winding_degC": winding,
        "stator_degC": stator,
        "speed_rpm": speed_rpm,
        "torque_Nm": torque,
        "dc_voltage_V": voltage,
        "dc_current_A": (mechanical + losses) / voltage,
        "coolant_degC": ambient + 3.0,
        "coolant_flow_L_per_min": 6.0 + 0.4 * np.cos(time_s / 300.0),
    }
