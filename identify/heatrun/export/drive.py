"""A run as the parameters that a drive's motor protection asks for: a sheet, and the same as TOML.

The names of makers, firmware and vehicle signals are those of the sources that stand beside them.
"""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..io.quantities import quantity, rounded
from ..io.whole_files import numbered
from ..record.motor import LIMIT_DEGC
from ..results.values import known
from ..runs.run import as_utf8
from ..version import __version__
from .laws import in_comment
from .simpler import COLD, Simpler, TestedRun, figures

SHEET, PARAMETERS = "drive.md", "drive.toml"

OVERLOADS = (1.5, 2.0, 6.0)
"""Multiples of the rated current whose times are told [1]; a class of IEC 60947-4-1 or NEMA ICS is
the time at 7.2 or 6 times."""

HEADING = "# heatrun export: "

TITLES = {
    "one": "One time constant",
    "one_with_rising_resistance": "One time constant, with rising resistance",
    "two": "Two time constants",
}

MEANINGS = {
    "R": "thermal resistance, winding to sink",
    "C": "heat capacity",
    "tau": "thermal time constant",
    "rise": "rise at the rated current",
    "I2t": "I²t from cold: rated current squared times the time constant",
    "continuous": "current with which this body comes to the limit, less what it misses",
    **{f"time_at_{k:g}": f"time to the rated rise from cold at {k:g} times the rated current"
       for k in OVERLOADS},
    "R_winding": "thermal resistance, winding to housing",
    "R_housing": "thermal resistance, housing to sink",
    "C_winding": "heat capacity of the winding",
    "C_housing": "heat capacity of the housing and the rest",
    "tau_winding": "time constant of the winding, C times R",
    "tau_housing": "time constant of the housing, C times R",
    "tau_fast": "fast time constant of the whole",
    "tau_slow": "slow time constant of the whole",
    "share_winding": "share of the winding's resistance in the whole",
}  # fmt: skip


def export_drive(
    run: Path, *, folder: Path | None = None, network: str | None = None, is_replacing: bool = False
) -> dict[str, Any]:
    """Write the parameters of a drive's motor protection.

    Args:
        run: The run folder.
        folder: Where the files go; None for a folder `drive` in the run, numbered where that holds
            another export.
        network: Name of the network; None for the last one of the run.
        is_replacing: Whether another export in `folder` is replaced.

    Returns:
        As plain data: the files, network (`order`, `title`), `parameters` as in the TOML file,
        notes and findings.

    Raises:
        InputError: As `TestedRun.read` and `write_export`.
    """
    import tomli_w

    read = TestedRun.read(run, network)
    content = _parameters(read)
    text = HEADING + "parameters of a drive's motor protection\n" + tomli_w.dumps(content)
    files = {SHEET: _sheet(content).encode(), PARAMETERS: text.encode()}
    places = [folder] if folder else numbered(run / "drive")
    written = read.write(places, files, is_replacing=is_replacing)
    return {**written, "parameters": content, "notes": content["notes"]}


def _parameters(read: TestedRun) -> dict[str, Any]:
    """Return what stands in the TOML file."""
    seen, motor, run = read.seen, read.run.motor, read.run
    one = read.simpler("first", is_fed=False, cold=COLD)
    found = {
        "one": one,
        "one_with_rising_resistance": read.simpler("first", is_fed=True, cold=COLD),
    }
    if len(read.predictions[0].model.form.nodes) > 1:
        found["two"] = read.simpler("second", is_fed=False, cold=COLD)
    bodies = {name: _body(each) for name, each in found.items()}
    rated, notes = _rated(read)
    watts = motor.phases * one.ohm * rated["current_A"] ** 2
    values = bodies["one"]["values"]
    values["rise"] = _scaled(values["R"], watts, "K")
    values["I2t"] = _scaled(values["tau"], rated["current_A"] ** 2, "A^2 s")
    for k in OVERLOADS:
        values[f"time_at_{k:g}"] = _scaled(values["tau"], -math.log1p(-1.0 / k**2), "s")
    limit = LIMIT_DEGC.get(motor.insulation_class or "")
    if limit is not None and rated["is_certified"]:
        missed = bodies["one"]["bias"]["colder_than_upper_95_at_most_K"]
        ohm = motor.phases * one.ohm / max(limit - missed - seen.sink_degC, 1e-3)
        ends = [(ohm * R) ** -0.5 for R in (values["R"]["value"], *values["R"]["interval_95"])]
        values["continuous"] = {"value": ends[0], "interval_95": ends[:0:-1], "unit": "A"}
    content = {
        "format": "heatrun drive 1",
        "source": {
            "run": as_utf8(run.path.resolve().name),
            "sha256": run.manifest["files"]["fit.json"],
            "machine": as_utf8(motor.name),
            "network": as_utf8(read.predictions[0].model.title),
            "heatrun": __version__,
        },
        "tested": {
            "calibration": [as_utf8(each.test.name) for each in read.fitted],
            "holdout": [as_utf8(p.test.name) for p in read.predictions if p.is_held_out],
            "sink": motor.sink,
            "sink_degC": seen.sink_degC,
            "largest_current_A": seen.current_A,
            "highest_winding_degC": seen.winding_degC,
        },
        "rated": rated,
        "winding": {
            "phases": motor.phases,
            "phase_resistance_ohm": read.ohm,
            "reference_temperature_degC": motor.reference_temperature_degC,
            "coefficient_per_K": 1.0
            / (motor.resistance_coefficient_degC + motor.reference_temperature_degC),
            "constant_resistance_ohm": one.ohm,
            "constant_resistance_at_degC": one.degC,
        },
        "bodies": bodies,
        "notes": notes,
    }
    if limit is not None:
        # a drive that knows one body must trip earlier
        content["limit"] = {
            "insulation_class": motor.insulation_class,
            "winding_degC": limit,
            **{name: limit - body["bias"]["colder_than_upper_95_at_most_K"]
               for name, body in bodies.items()},
        }  # fmt: skip
    content["names"] = _names(content, read.ohm_at(seen.sink_degC))
    content["signals"] = [{"source": VSS, "name": name, "unit": "degC", "meaning": meaning}
                          for name, meaning in SIGNALS.items()]  # fmt: skip
    return content


def _rated(read: TestedRun) -> tuple[dict[str, Any], list[str]]:
    """Return the rated current, and notes on where it comes from."""
    said, seen = read.continuous, read.seen
    if math.isfinite(said.median):
        low, high = said.ends
        found = {"current_A": said.median, "is_certified": True,
                 "condition": known(said.condition) or ""}  # fmt: skip
        if math.isfinite(low + high):
            found["interval_95"] = [low, high]
        return found, []
    reason = known(said.refused) or "no interval"
    note = (
        f"The run certifies no continuous current ({reason}): {rounded(seen.amperes)} A is the "
        "mean of the tested loads, no rating. Set the current of the rating plate, and scale the "
        "rise with its square."
    )
    condition = f"rms of the loaded part of the tests, sink {seen.sink_degC:.0f} °C"
    return {"current_A": seen.amperes, "is_certified": False, "condition": condition}, [note]


def _body(simpler: Simpler) -> dict[str, Any]:
    """Return figures and bias of a network of one or two bodies."""
    values = {
        name: {"value": value, "interval_95": list(interval), "unit": unit}
        for name, value, interval, unit in figures(simpler)
    }
    return {"values": values, "bias": simpler.bias()}


def _scaled(entry: Mapping[str, Any], factor: float, unit: str) -> dict[str, Any]:
    low, high = entry["interval_95"]
    return {"value": factor * entry["value"], "interval_95": [factor * low, factor * high],
            "unit": unit}  # fmt: skip


ABB = "ABB, ACS880 manual (easymanua.ls/abb/acs880/manual/438464), p. 407"
ABB_550 = "ABB, ACH550-UH User's Manual, p. 97"
SIEMENS = (
    "Siemens, SINAMICS G220 Operating Instructions 04/2024, A5E51781573B AB, function diagram 8017 "
    "Motor temperature model 1 (I2t)"
)
BECKHOFF = "Beckhoff Information System, AX8000 objects, 32C8 AsynchronousMotor thermal model"
MBED = "firmware motor_driver (os.mbed.com/users/adimmit/code/motor_driver), Config/motor_config.h"
ROS = "driver ethercat_hardware (docs.ros.org), MotorHeatingModelParameters"
RATED_HERE = "the rated current above, or less: with it one body comes to its lowered limit"
NAMES = (
    (ABB, "35.54 Motor nominal temperature rise", "rise", "at the current of these names"),
    (ABB, "35.55 Motor thermal time constant", "one.tau", "takes 100 to 10000 s"),
    (ABB_550, "3006 MOT THERM TIME", "one.tau", "takes 256 to 9999 s"),
    (ABB_550, "9906 MOTOR NOM CURR", "rated", RATED_HERE),
    (SIEMENS, "p0305 Rated motor current", "rated", RATED_HERE),
    (SIEMENS, "p0611 I2t motor model thermal time constant", "one.tau", ""),
    (SIEMENS, "p0613 Mot_temp_mod 1/3 ambient temperature", "sink", ""),
    (SIEMENS, "p0627 Motor overtemperature, stator winding", "rise", "at p0305"),
    (SIEMENS, "p5391 Mot_temp_mod 1/3 fault threshold", "limit.one", "less what the body misses"),
    (BECKHOFF, "32C8:01 Motor thermal time constant", "two.tau_slow", ""),
    (BECKHOFF, "32C8:02 Winding thermal time constant", "two.tau_winding", "takes 0 to 3600 s"),
    (MBED, "R_PHASE", "sink_ohm", "at T_AMBIENT"),
    (MBED, "R_TH", "1/R", "said to be K/W, but the observer multiplies the rise by it (q_out)"),
    (MBED, "INV_M_TH", "1/C", ""),
    (MBED, "T_AMBIENT", "sink", ""),
    (ROS, "winding_to_housing_thermal_resistance_", "two.R_winding", ""),
    (ROS, "housing_to_ambient_thermal_resistance_", "two.R_housing", ""),
    (ROS, "winding_thermal_time_constant_", "two.tau_winding", ""),
    (ROS, "housing_thermal_time_constant_", "two.tau_housing", ""),
    (ROS, "max_winding_temperature_", "limit.two", "less what the bodies miss"),
)
"""Source, name there, what stands under it here, and a note."""

VSS = "COVESA vehicle signal specification, spec/Powertrain/ElectricMotor.vspec"
SIGNALS = {
    "Vehicle.Powertrain.ElectricMotor.Temperature": "the winding, as these bodies compute it",
    "Vehicle.Powertrain.ElectricMotor.CoolantTemperature": "the sink, where that is the coolant",
}
"""Signals of vehicles in degrees Celsius, and what they are here."""


def _names(content: Mapping[str, Any], sink_ohm: float) -> list[dict[str, Any]]:
    """Return the parameters by the names of makers and firmware, as far as they are known.

    Args:
        content: What stands in the file beside them.
        sink_ohm: Phase resistance at the temperature of the sink [ohm].
    """
    bodies = content["bodies"]
    warm = bodies["one_with_rising_resistance"]["values"]
    one, rated = bodies["one"]["values"], content["rated"]["current_A"]
    # one body is hotter than the machine: it would trip at a rating that the machine bears
    amperes = min(rated, one["continuous"]["value"]) if "continuous" in one else rated
    known_as = {
        "rated": (amperes, "A"),
        "rise": (one["rise"]["value"] * (amperes / rated) ** 2, "K"),
        "sink": (content["tested"]["sink_degC"], "degC"),
        "sink_ohm": (sink_ohm, "ohm"),
        "1/R": (1.0 / warm["R"]["value"], "W/K"),
        "1/C": (1.0 / warm["C"]["value"], "K/J"),
        **{f"limit.{name}": (value, "degC") for name, value in content.get("limit", {}).items()},
        **{f"{name}.{key}": (entry["value"], entry["unit"])
           for name, body in bodies.items() for key, entry in body["values"].items()},
    }  # fmt: skip
    return [
        {"source": source, "name": name, "value": known_as[key][0], "unit": known_as[key][1],
         "note": note}
        for source, name, key, note in NAMES
        if key in known_as
    ]  # fmt: skip


def _sheet(content: Mapping[str, Any]) -> str:
    """Return the sheet as Markdown; names of the run are escaped."""
    source, tested, rated = content["source"], content["tested"], content["rated"]
    winding = content["winding"]
    lines = [
        f"{HEADING}parameters of a drive's motor protection",
        "",
        *(f"- {key}: `{in_comment(str(value))}`" for key, value in source.items()),
        f"- tests: {', '.join(f'`{in_comment(name)}`' for name in tested['calibration'])}; "
        f"currents up to {rounded(tested['largest_current_A'])} A rms, winding up to "
        f"{tested['highest_winding_degC']:.0f} °C, sink {tested['sink_degC']:.0f} °C",
        "",
        f"**Rated current {rounded(rated['current_A'])} A**{_between(rated.get('interval_95'))}: "
        f"{_plain(rated['condition'])}.",
        *(f"\n{_plain(note)}" for note in content["notes"]),
        "",
        "The current alone heats these bodies: the other losses of the tested loads are in their "
        "resistances, and they hold at such loads only. The copper loss is "
        f"{winding['phases']} I² R with the phase resistance R = "
        f"{rounded(winding['constant_resistance_ohm'], 4)} Ω, constant, that of "
        f"{winding['constant_resistance_at_degC']:.0f} °C "
        f"({rounded(winding['phase_resistance_ohm'], 4)} Ω at "
        f"{winding['reference_temperature_degC']:.0f} °C); with rising resistance it follows the "
        "temperature.",
    ]
    for key, body in content["bodies"].items():
        bias = body["bias"]
        lines += ["", f"## {TITLES[key]}", "", "| | name | value | 95 % interval |",
                  "|---|---|---|---|"]  # fmt: skip
        for name, entry in body["values"].items():
            unit, value = entry["unit"], rounded(entry["value"], 4)
            low, high = (rounded(end, 4) for end in entry["interval_95"])
            lines.append(
                f"| {MEANINGS[name]} | `{name}` | {quantity(value, unit)} | {low} … {high} |"
            )
        lines += [
            "",
            f"Against the certified model at the tested loads: RMS {bias['rms_K']:.1f} K, at most "
            f"{bias['colder_at_most_K']:.1f} K colder and {bias['warmer_at_most_K']:.1f} K warmer; "
            f"at most {bias['colder_than_upper_95_at_most_K']:.1f} K colder than the model's upper "
            "95 % limit. Lower a limit by that.",
        ]
    lines += ["", "## By the names of drives, firmware and vehicles", "",
              "| source | parameter | value | |", "|---|---|---|---|"]  # fmt: skip
    lines += [
        f"| {e['source']} | {e['name']} | {quantity(rounded(e['value'], 4), e['unit'])} "
        f"| {e['note']} |"
        for e in content["names"]
    ]
    lines += ["", *(f"- {e['source']}: {e['name']}, {e['meaning']}" for e in content["signals"])]
    return "\n".join(lines) + "\n"


def _plain(text: str) -> str:
    """Return text of a condition without what Markdown or HTML would take for its own."""
    return re.sub(r"[^\w .,:;()+=%/°²…-]", "", text)


def _between(interval: list[float] | None) -> str:
    return "" if interval is None else " (95 %: " + " … ".join(map(rounded, interval)) + " A)"
