"""The motor file as TOML again, so that a run folder stands for itself.

Of `[tests.NAME]` the columns and the load in gaps: a run knows the parts of its tests by itself.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ..record.motor import Adequacy, Motor, PartsOfTest, ShutDown

MOTOR = ("name", "phases", "losses", "sink", "insulation_class", "equilibrium",
         "rated_speed_rpm", "rated_current_A", "mass_kg", "raster_s", "decimal")  # fmt: skip
WINDING = ("resistance_coefficient_degC", "phase_resistance_ohm", "reference_temperature_degC",
           "measured_resistance_ohm", "lead_resistance_ohm", "conductor_mass_kg")  # fmt: skip
VEHICLE = ("gear_ratio", "wheel_radius_m")


def motor_text(motor: Motor) -> bytes:
    """Return a motor file that reads back to the same machine."""
    import tomli_w

    content: dict[str, Any] = {}
    for section, keys in (("motor", MOTOR), ("winding", WINDING), ("vehicle", VEHICLE)):
        values = {key: getattr(motor, key) for key in keys}
        content[section] = {key: value for key, value in values.items() if value is not None}
    content["model"] = {"effects": list(motor.effects)} if motor.effects else {}
    if motor.adequacy != Adequacy():
        content["adequacy"] = asdict(motor.adequacy)
    if motor.shutdown != ShutDown():
        said = asdict(motor.shutdown)
        content["shutdown"] = {key: value for key, value in said.items() if value is not None}
    scales = {key: value for key, value in asdict(motor.scales).items() if value is not None}
    content["scales"] = scales
    content["columns"] = dict(motor.columns)
    content["constants"] = dict(motor.constants)
    content["tests"] = {name: kept for name, parts in motor.tests.items() if (kept := _kept(parts))}
    content["sensors"] = dict(motor.sensors)
    content["parameters"] = {
        name: {key: value for key, value in asdict(said).items() if value is not None}
        for name, said in motor.parameters.items()
    }
    content["certificate"] = motor.certificate.as_section()
    return tomli_w.dumps({key: value for key, value in content.items() if value}).encode()


def _kept(parts: PartsOfTest) -> dict[str, Any]:
    gap = {} if parts.gap_load is None else {"gap": {"load": parts.gap_load}}
    return gap | ({"columns": dict(parts.columns)} if parts.columns else {})
