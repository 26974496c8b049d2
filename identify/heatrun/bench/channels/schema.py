"""The canonical channels: one name, one quantity, one unit and one meaning each.

The name of a channel carries its unit; `heatrun.bench.channels.units` converts a column to it when
a file is read, and nothing converts afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Channel:
    """One quantity that a bench may record.

    Attributes:
        name: Canonical name, with the unit at its end.
        quantity: Key of `heatrun.bench.channels.units.QUANTITIES`.
        unit: Canonical unit, as it is printed.
        meaning: One sentence for lists and reports.
    """

    name: str
    quantity: str
    unit: str
    meaning: str


CHANNELS: tuple[Channel, ...] = (
    Channel("time_s", "time", "s", "Time from the first sample of the test"),
    Channel("phase_current_A", "phase current", "A", "Phase current, rms"),
    Channel("losses_W", "power", "W", "Losses that heat the machine (Pd, or Pol from a map)"),
    Channel("ambient_degC", "temperature", "degC", "Air around the machine"),
    Channel("winding_degC", "temperature", "degC", "Winding, as its sensor reads"),
    Channel("speed_rpm", "speed", "rpm", "Mechanical speed of the shaft"),
    Channel("torque_Nm", "torque", "Nm", "Torque at the shaft, positive as a motor"),
    Channel("stator_degC", "temperature", "degC", "Stator iron or stator body"),
    Channel("yoke_degC", "temperature", "degC", "Stator yoke"),
    Channel("tooth_degC", "temperature", "degC", "Stator tooth"),
    Channel("end_winding_degC", "temperature", "degC", "Winding overhang"),
    Channel("housing_degC", "temperature", "degC", "Housing"),
    Channel("rotor_degC", "temperature", "degC", "Rotor"),
    Channel("magnet_degC", "temperature", "degC", "Permanent magnets"),
    Channel("bearing_degC", "temperature", "degC", "Bearing"),
    Channel("controller_degC", "temperature", "degC", "Inverter or speed controller"),
    Channel("coolant_degC", "temperature", "degC", "Coolant at the inlet"),
    Channel("coolant_out_degC", "temperature", "degC", "Coolant at the outlet"),
    Channel("coolant_flow_L_per_min", "flow", "L/min", "Coolant flow"),
    Channel("fan", "fraction", "1", "Fan: 0 off, 1 full"),
    Channel("dc_voltage_V", "voltage", "V", "Voltage of the DC link"),
    Channel("dc_current_A", "direct current", "A", "Current of the DC link, mean"),
    Channel("dc_power_W", "power", "W", "Power from the DC link"),
    Channel("electrical_power_W", "power", "W", "Power into the motor's terminals"),
    Channel("mechanical_power_W", "power", "W", "Power at the shaft, positive as a motor"),
    Channel("u_d_V", "voltage", "V", "d-axis voltage, amplitude-invariant"),
    Channel("u_q_V", "voltage", "V", "q-axis voltage, amplitude-invariant"),
    Channel("i_d_A", "dq current", "A", "d-axis current, amplitude-invariant"),
    Channel("i_q_A", "dq current", "A", "q-axis current, amplitude-invariant"),
    Channel(
        "winding_resistance_ohm",
        "resistance",
        "ohm",
        "Resistance of the winding, from which winding_degC follows",
    ),
    Channel(
        "winding_voltage_V",
        "voltage",
        "V",
        "Direct voltage over the winding, which with the current gives its resistance",
    ),
    Channel("vehicle_speed_km_per_h", "velocity", "km/h", "Speed of the vehicle"),
)
"""Every channel that heatrun knows, those that a fit needs first."""

BODIES: tuple[str, ...] = (
    "stator_degC",
    "tooth_degC",
    "yoke_degC",
    "end_winding_degC",
    "housing_degC",
    "rotor_degC",
    "magnet_degC",
    "bearing_degC",
    "coolant_out_degC",
)
"""Temperatures of bodies beside the winding."""


def body_name(channel: str) -> str:
    """Return the name of a measured body, such as `"stator"` for its channel."""
    return channel.removesuffix("_degC")


CHANNEL: dict[str, Channel] = {channel.name: channel for channel in CHANNELS}
"""The same by name."""

REQUIRED: tuple[str, ...] = (
    "time_s",
    "phase_current_A",
    "losses_W",
    "ambient_degC",
    "winding_degC",
)
"""The channels that a fit of the two-node network needs."""
