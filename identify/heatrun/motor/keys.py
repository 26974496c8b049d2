"""The keys of the motor file with their meaning, and the reference page that is made from that.

`heatrun.motor.file` accepts what is listed here. `python -m heatrun.motor.keys FILE` (`make docs`)
writes the page again; a test compares the two.
"""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..io.whole_files import write_whole
from ..record.channels import BODIES, CHANNELS, body_name
from ..record.motor import EQUILIBRIA


@dataclass(frozen=True)
class Key:
    """One key of the motor file."""

    name: str  # As it is written.
    meaning: str  # One or two sentences, with the unit.
    example: str  # Right-hand side as TOML.
    default: str  # What holds where it is not given, in words.


@dataclass(frozen=True)
class Section:
    """A section of the motor file."""

    name: str  # As it stands in brackets; `parameters.NAME` for one section for each parameter.
    meaning: str  # What it is for.
    keys: tuple[Key, ...] = ()  # Its keys; empty where they are names of channels.
    is_list: bool = False  # It may stand several times, in double brackets.

    @property
    def heading(self) -> str:
        """Its name in brackets."""
        return f"[[{self.name}]]" if self.is_list else f"[{self.name}]"


MOTOR = Section(
    "motor",
    "The machine under test and its bench.",
    (
        Key("name", "Name of the machine, as it stands on the sheet.", '"IPM-SynRel 2022"',
            "none: this key alone must be given"),
        Key("phases", "Number of phases.", "3", "3"),
        Key("losses", 'What losses_W is: "balance" for the total Pd, electrical power in minus '
            'mechanical power out; "map" for the losses other than copper alone, from a map or a '
            "model. The copper loss is then added from the current.", '"balance"', '"balance"'),
        Key("sink", 'What the stator loses its heat to: "ambient" (ambient_degC) or "coolant" '
            "(coolant_degC). A network of both sinks takes this one for the rise, and the other "
            "from its own channel.", '"ambient"', '"ambient"'),
        Key("insulation_class", "Letter of IEC 60085 (A, E, B, F, H, N, R). With it come the "
            "continuous current and the time to the limit, and in air what is left of the rise by "
            "resistance that the class permits (F: 105 K).", '"F"', "no ratings"),
        Key("equilibrium", "Criterion of thermal equilibrium that tests are judged by: "
            + "; ".join(f'"{name}" ({each.change_K:g} K in {each.over_s / 60.0:.0f} min, '
                        f"{each.source})" for name, each in EQUILIBRIA.items()) + ".",
            '"IEEE 112"', f'"{next(iter(EQUILIBRIA))}"'),
        Key("rated_speed_rpm", "Speed that effects of the speed are scaled with [rpm].", "6000",
            "the largest speed in the records"),
        Key("rated_current_A", "Rms current that the sheet states the steady rise at, and that "
            "effects of the load are scaled with [A].", "8.2",
            "the current of the loaded part of the tests, and the largest in the records"),
        Key("mass_kg", "Mass of the machine without gear, carriage and cables [kg]: the heat "
            "capacity of all but the winding is then known to a factor of 2, which a short test "
            "does not tell.", "38.5", "capacities from how fast the tests warm"),
        Key("raster_s", "Step that MDF and TDMS channels are averaged to [s].", "1.0",
            "the samples of the winding"),
        Key("decimal", 'Decimal sign of text tables, "." or ","; the other one then separates '
            "thousands.", '","', "found in each file, and asked for where a file leaves it open"),
    ),
)  # fmt: skip

WINDING = Section(
    "winding",
    "The winding's resistance, from which the copper loss follows.",
    (
        Key("material", '"copper" (B = 234.5 °C) or "aluminium" (B = 225 °C), for '
            "R(T) = R (B + T)/(B + Tref).", '"copper"', '"copper"'),
        Key("resistance_coefficient_degC", "B itself [°C], from 100 to 400, in place of the "
            "material.", "234.5", "that of the material"),
        Key("phase_resistance_ohm", "Resistance of one phase at the reference temperature [Ω]; "
            "half of what is measured between two terminals of a star. The copper loss "
            "3 I² R(T), which heats the winding itself, follows from it.", "0.0062",
            "none: a calibration needs it, unless the current is 0 throughout"),
        Key("reference_temperature_degC", "Temperature at which the resistance was measured [°C].",
            "25.0", "25"),
        Key("measured_resistance_ohm", "Resistance of the circuit that winding_resistance_ohm (or "
            "winding_voltage_V over the current) measures, leads included, at the reference "
            "temperature [Ω]. The winding temperature follows by R(T).", "0.0134",
            "phase_resistance_ohm times what the cold reading shows: 1 for a phase, 2 between "
            "terminals of a star, 2/3 of a delta"),
        Key("lead_resistance_ohm", "Part of it that stays cold: leads and contacts [Ω].", "0.0004",
            "0: four wires"),
        Key("conductor_mass_kg", "Mass of the bare copper or aluminium of the winding [kg], end "
            "windings included: the heat capacity of the winding is then known to a factor of 1.5.",
            "4.2", "capacity from how fast the tests warm"),
    ),
)  # fmt: skip

VEHICLE = Section(
    "vehicle",
    "For distance and consumption in reports, of a machine that drives a vehicle.",
    (
        Key("gear_ratio", "Motor speed over wheel speed.", "9.1", "no distance from the speed"),
        Key("wheel_radius_m", "Rolling radius of the wheel [m].", "0.3",
            "no distance from the speed"),
    ),
)  # fmt: skip

COLUMNS = Section(
    "columns",
    'Which column of the file is which channel: CHANNEL = "COLUMN [UNIT]". Only for columns that '
    "heatrun does not recognise or reads in another way than you want. The unit in brackets may be "
    "left out where the file gives it; it decides where the file gives another, and behind the "
    'whole heading, as in "P [kW] [kW]", where the record speaks against it. Several sensors of '
    "one winding or body: mean(T_U, T_V, T_W), or hottest(…); of three wattmeters "
    "sum(P1, P2, P3). Currents are rms; "
    'write [A_peak] for amplitudes. "none" leaves a channel out; time_s = "rate 10 Hz" stands for '
    "a column of times. Several loggers: of a list, such as "
    '["T_Wicklung [°C]", "coil [degC]"], the first counts whose column a file has. '
    'In MDF, TDMS and workbooks "GROUP/COLUMN" names a column of a group or sheet.',
)

CONSTANTS = Section(
    "constants",
    "Channels that the record does not have because they do not change: CHANNEL = NUMBER in the "
    "channel's unit. The mean temperature of the room takes the place of a sensor in it.",
)

SENSORS = Section(
    "sensors",
    "Which node of the network a measured body is fitted as: CHANNEL = \"NODE\". \"none\" holds it "
    "against the model without fitting it. Where nothing is said, the network decides.",
)  # fmt: skip

TESTS = Section(
    "tests.NAME",
    "Which parts of a test count, and how its columns are read; NAME is the file without its "
    "ending, in quotes where it has other characters than letters, digits, - and _. Times are in "
    'seconds from the first sample of the file, or texts such as "90 min". Behind a file on the '
    "command line, FILE@10min..90min says the same for once.",
    (
        Key("use", "Stretches that are used. Each of several becomes a test with temperatures of "
            "its own at the start: so a record is split at a gap.", "[[600, 5400], [7200, 9000]]",
            "the whole record"),
        Key("use_rows", "The same by samples, counted from 1: for a clock that was set back.",
            "[[1, 5000], [5001, 9000]]", "the whole record"),
        Key("mask", "Windows whose readings of winding and bodies are not compared with the model; "
            "current and losses are simulated through. Of a test that is to be compared from a "
            "warm moment on, this knows the stator where `use` does not.", "[[1800, 1920]]",
            "none"),
        Key("bridge", "Windows whose current, losses, powers, voltages, torque and speed are "
            "interpolated between the samples on either side: for values that the logger made up, "
            "such as 65535.", "[[1495, 1510]]", "none"),
        Key("gap", 'load: the load while the logger stood still: "held" as before the gap, "zero", '
            'or "unknown": before and after are then calibrated together, each from start '
            "temperatures of its own.", '{ load = "held" }',
            "held where both sides and the winding say so; else unknown for gaps over 300 s"),
        Key("load_offset", "What is added to the clock of current, losses, powers, voltages, "
            "torque and speed to give that of the temperatures [s]: of one file whose load was "
            "recorded late (negative) or early, and of two joined by + in place of the estimate.",
            "-45.0", "0; estimated of two files"),
        Key("columns", "Lines as in `[columns]` for this file alone, before those of the motor "
            "file; also as a section of its own, `[tests.NAME.columns]`.",
            '{ winding_degC = "CH2 [degC]" }', "none"),
    ),
)  # fmt: skip

MODEL = Section(
    "model",
    "What every model of this machine has.",
    (
        Key("effects", "Ids of known physical effects; `heatrun discover` finds those that are not "
            "known.", '["speed_cooling"]', "none"),
    ),
)  # fmt: skip

ADEQUACY = Section(
    "adequacy",
    "How far a network of a few nodes is trusted.",
    (
        Key("unmodelled_heat", "Median of the prior of the heat that the network misses, as a "
            "share of the mean loss, from 0.00001 to 0.05.", "0.0015", "0.0015"),
        Key("heat_time_s", "How long such heat lasts [s], from 60 to 86400.", "1200", "1200"),
    ),
)  # fmt: skip

SCALES = Section(
    "scales",
    "What effects of speed, load and flow are scaled with, in all tests alike. A run folder writes "
    "what its tests told; in a motor file it is seldom needed.",
    (
        Key("speed_rpm", "Speed [rpm].", "6000", "rated_speed_rpm, or the largest in the records"),
        Key("current_A", "Rms current [A].", "8.2",
            "rated_current_A, or the largest in the records"),
        Key("flow_L_per_min", "Flow of the coolant [L/min].", "12", "the largest in the records"),
    ),
)  # fmt: skip

POPULATION = Section(
    "population",
    "What other machines of the type say of this one before its first test: priors of the thermal "
    "parameters, the effects that those were calibrated with, and how much heat the network is "
    "likely to miss. `[parameters.NAME]` and `[adequacy]` go before it.",
    (
        Key("run", "Folder of a population, as `heatrun population` writes it, from where this "
            "file is.", '"../fleet"', "wide priors, scaled by the tests"),
    ),
)  # fmt: skip

SHUTDOWN = Section(
    "shutdown",
    "What is known of the readings that `heatrun shutdown` extrapolates to the instant of "
    "switch-off. Standard deviations are those of the error itself (k = 1): half of a 95 % "
    "interval. The cold resistance, its temperature, the leads and B stand in `[winding]`.",
    (
        Key("cold_resistance_sd", "Standard deviation of measured_resistance_ohm, relative.",
            "0.001", "0.002"),
        Key("cold_temperature_sd_K", "That of the winding's temperature then [K].", "0.3", "1"),
        Key("coefficient_sd_degC", "That of B [°C].", "0.5", "1"),
        Key("lead_sd", "That of lead_resistance_ohm, relative.", "0.1", "0.2"),
        Key("reading_sd_K", "That of one reading after switch-off, as a temperature [K].", "0.1",
            "told by the readings themselves, about 0.1"),
        Key("sensor_sd_K", "Where a sensor is read in place of the resistance: its offset [K].",
            "0.5", "1"),
        Key("sensor_lag_s", "The sensor's time constant [s], known to a factor of 1.5.", "8", "0"),
        Key("sink_sd_K", "That of the coolant's temperature [K].", "0.5", "1"),
        Key("moment_sd_s", "That of the moment of switch-off [s].", "0.2", "0.5"),
        Key("run_down_s", "Time constant with which the speed runs down [s]; 0 for a rotor that "
            "stands or is driven on.", "8", "15, known to a factor of 2"),
        Key("losses_after", "Share of the losses that stays after switch-off: 0 for a machine at "
            "rest, more where it is driven on.", "0.3", "0"),
        Key("losses_after_sd", "That of this share.", "0.2", "0"),
        Key("current_after", "Share of the current that flows on.", "0.05", "0"),
        Key("rated_output_kW", "Rated output [kW], by which the standard allows a delay of the "
            "first reading.", "15", "the delay is not judged"),
        Key("utilisation_class", "Class whose rise is permitted where it is not that of the "
            "insulation, as in F utilised to B; for the ratings of a run too.", '"B"',
            "insulation_class"),
    ),
)  # fmt: skip

PARAMETERS = Section(
    "parameters.NAME",
    "What is known beforehand of a parameter, in its unit: either fixed, or the value of its prior "
    "with one of the two widths. Where nothing is said, the priors are wide. Parameters of effects "
    'are written in quotes: [parameters."speed_cooling.g"].',
    (
        Key("fixed", "The parameter is not estimated but held at this value.", "0.11625",
            "estimated"),
        Key("value", "Centre of the prior.", "667.0", "the prior of the model"),
        Key("relative_sd", "Standard deviation of the prior, relative to the value (0.2 is 20 %).",
            "0.2", "that of the model"),
        Key("sd", "Standard deviation of the prior in the unit of the parameter.", "100.0",
            "that of the model"),
        Key("per_test", "true: estimated for each test apart; false: one value for all tests.",
            "true", "as the model has it"),
    ),
)  # fmt: skip

CERTIFICATE = Section(
    "certificate",
    "What the first page of the parameter sheet says beside the results. All of it may be left "
    "out, and `--meta FILE` gives the same keys in a file of its own; what is not given is a blank "
    "line to fill in. A Digital Calibration Certificate (`heatrun sheet RUN --dcc`) needs some.",
    (
        Key("number", "Number of the certificate.", '"2026-0147"', "a blank line"),
        Key("laboratory", "Who made the test.", '"Thermal Test Bench 3"', "a blank line"),
        Key("laboratory_address", "Its address, on one line.", '"Corso Duca 24, 10129 Torino"',
            "a blank line"),
        Key("customer", "For whom.", '"Example Motors"', "a blank line"),
        Key("customer_address", "The customer's address, on one line.",
            '"Via Roma 1, 10121 Torino"', "a blank line"),
        Key("machine_type", "Type of the machine, as on its plate.", '"IPM-SynRel 160"',
            "a blank line"),
        Key("manufacturer", "Manufacturer of the machine.", '"Example Motors"', "a blank line"),
        Key("serial_number", "Serial number of the machine.", '"SN 0042"', "a blank line"),
        Key("condition", "State in which the machine was tested.", '"as delivered, no fan"',
            "left out"),
        Key("received", "Day on which the machine came.", "2026-03-02", "left out"),
        Key("test_from", "First day of the test. The clock or the header of the record says it "
            "where that has a date; a day that is given here goes before, and the annex shows "
            "both.", "2026-03-04",
            "the record's date; a blank line where it has none"),
        Key("test_until", "Last day of the test.", "2026-03-04", "as test_from"),
        Key("issue_date", "Day on which the certificate is issued.", "2026-03-09", "a blank line"),
        Key("operator", "Who ran the test.", '"A. Ångström"', "a blank line"),
        Key("approved_by", "Who answers for the certificate; the signature is put in by hand.",
            '"C. Rossi"', "a blank line"),
        Key("bench", "The test bench.", '"back-to-back bench 2, coupled by a torque shaft"',
            "a blank line"),
        Key("performed_at", 'Where the test was made: "laboratory", "customer", '
            '"laboratoryBranch", "customerBranch" or "other".', '"laboratory"', "left out"),
        Key("country", "Country of the laboratory, two letters of ISO 3166-1.", '"IT"',
            "left out"),
        Key("language", 'Language of sheet and reports: "en", "de" or "it"; `--language` goes '
            "before.", '"it"', '"en"'),
        Key("remarks", "Whatever else is to stand on the certificate.", '"Order 4711."',
            "left out"),
        Key("instruments", "The measuring instruments, each as a table of its own: see "
            "`[[certificate.instruments]]`.", '[{ quantity = "current", class = "0.2" }]',
            "a blank line"),
    ),
)  # fmt: skip

INSTRUMENTS = Section(
    "certificate.instruments",
    "A measuring instrument; once for each.",
    (
        Key("quantity", "What it measured.", '"phase current"', "a blank cell"),
        Key("instrument", "Its name, type and number.", '"zero-flux transducer IT 400, no. 17"',
            "a blank cell"),
        Key("class", "Its class or its uncertainty.", '"0.2"', "a blank cell"),
        Key("calibration", "Reference of its own calibration.", '"LAT 139 2025-1180"',
            "a blank cell"),
        Key("valid_until", "Day until which that is valid.", "2027-01-31", "a blank cell"),
    ),
    is_list=True,
)  # fmt: skip

SECTIONS: tuple[Section, ...] = (
    MOTOR, WINDING, VEHICLE, COLUMNS, CONSTANTS, SENSORS, TESTS, MODEL, SCALES, ADEQUACY,
    POPULATION, SHUTDOWN, PARAMETERS, CERTIFICATE, INSTRUMENTS,
)  # fmt: skip
"""Every section, in the order of the file."""

KNOWN_PARAMETERS: dict[str, tuple[str, str]] = {
    "Ceq": ("J/K", "Heat capacity of the machine (first order)"),
    "Req": ("K/W", "Thermal resistance from the machine to its sink (first order)"),
    "Ceq_w": ("J/K", "Heat capacity of the winding"),
    "Ceq_sr": ("J/K", "Heat capacity of stator and rotor"),
    "Req_w": ("K/W", "Thermal resistance from winding to stator"),
    "Req_sr": ("K/W", "Thermal resistance from stator to sink"),
    "Rs0": ("ohm", "Phase resistance at the reference temperature"),
    "Tw_start": ("degC", "Temperature of the winding at the start of a test"),
    "Tsr_start": ("degC", "Temperature of the stator at the start of a test"),
    "sensor_offset": ("K", "Offset of the winding's sensor"),
    "sensor_gain": ("1", "Relative error of the winding's sensor, of the rise above the sink"),
    "ambient_offset": ("K", "Offset of the sink's sensor"),
    "second_sink_offset": ("K", "The same of the second sink's sensor, where there is one"),
    "power_gain": ("1", "Relative error of the losses"),
    "current_gain": ("1", "Relative error of the current"),
    "torque_offset": ("N m", "Offset of the torque"),
    "shaft_power_gain": ("1", "Relative error of the mechanical power"),
    "shaft_power_offset": ("W", "Offset of the mechanical power"),
    "load_timing": ("s", "Moment of the load steps between samples"),
}
"""Parameters that `[parameters.NAME]` may name, beside those of sensors, effects and networks: unit
and meaning."""

BODY_PARTS: dict[str, tuple[str, str]] = {
    "gain": ("1", "Relative error of the sensor of a measured body"),
    "offset": ("K", "Offset of the sensor of a measured body"),
    "lag": ("s", "Time constant of the sensor of a measured body"),
}
"""The same for each measured body BODY, as `BODY_gain` and so on."""

UNITS = {name: unit for name, (unit, _) in KNOWN_PARAMETERS.items()} | {
    f"{body_name(channel)}_{part}": unit
    for channel in BODIES
    for part, (unit, _) in BODY_PARTS.items()
}
"""Units of the parameters beside those of effects, known before any model is made."""

KEYS: dict[str, tuple[str, ...]] = {
    section.name: tuple(key.name for key in section.keys) for section in SECTIONS
}
"""What each section may hold, where that is not channels."""


HEAD = """# The motor file

<!-- Generated by `make docs` from identify/heatrun/motor/keys.py: change it there. -->

A TOML file that describes the machine under test and how its bench measures it. `heatrun init
TEST…` drafts one from the tests: it says what is recognised and proposes columns for what is not.
This page explains every key. One key must be given, `name`; everything else has a
default or is recognised in the files.
"""


def page() -> str:
    """Return the page as Markdown."""
    from lptn import EFFECTS

    parts = [HEAD, *map(_section, SECTIONS)]
    rows = []
    for card in (kind.card for kind in EFFECTS):
        needs = [*card.needs, *['losses = "map"'] * card.is_in_balance]
        rows.append((f"`{card.id}`", card.signature, ", ".join(f"`{one}`" for one in needs)))
    parts.append(
        "## Known effects\n\nIds for `[model] effects` and `--with`, and what a search for them "
        "needs.\n\n" + _table(("id", "what the bench shows when it is missing", "needs"), rows)
    )
    return "\n".join(parts)


def _section(section: Section) -> str:
    lines = [f"## `{section.heading}`", "", section.meaning, ""]
    if section.keys:
        rows = [(f"`{key.name}`", key.meaning, f"`{key.example}`", key.default)
                for key in section.keys]  # fmt: skip
        lines.append(_table(("key", "meaning", "example", "default"), rows))
    if section is COLUMNS:
        rows = [(f"`{one.name}`", one.meaning, one.unit) for one in CHANNELS]
        lines.append(_table(("channel", "meaning", "unit"), rows))
    if section is CONSTANTS:
        lines.append("Every channel but `time_s` and `winding_degC`.\n")
    if section is SENSORS:
        lines.append(f"Channels: {_listed(BODIES)}.\n")
    if section is MODEL:
        lines.append("The ids stand at the end of this page.\n")
    if section is PARAMETERS:
        rows = [(f"`{name}`", said, unit) for name, (unit, said) in KNOWN_PARAMETERS.items()]
        rows += [(f"`BODY_{part}`", said, unit) for part, (unit, said) in BODY_PARTS.items()]
        lines += [
            "NAME is one of these, or a part of your own network (`Ceq_tooth`, `Req_tooth_yoke`, "
            "`share_yoke`); for BODY stands a channel of `[sensors]` without its unit.\n",
            _table(("NAME", "meaning", "unit"), rows),
        ]
    return "\n".join(lines)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |\n"
                   for line in lines)  # fmt: skip


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


if __name__ == "__main__":
    write_whole(Path(sys.argv[1]), page().encode())
