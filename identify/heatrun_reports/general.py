"""The reports General Test, with every signal, and Energy Consumption, with maps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from heatrun.errors import InputError
from heatrun.io.texts import SENTENCES
from heatrun.record.balance_errors import shaft_power_disagrees
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import samples, sink_channel

from .analysis.drive import (
    Course,
    OperatingMap,
    above_one,
    electrical_power,
    has,
    integrate,
    operating_map,
    with_powers,
)
from .analysis.general_information import (
    DEFINITIONS,
    FIGURES,
    J_PER_KWH,
    GeneralInformation,
    general_information,
)
from .bench_test_types import NOT_OF_THE_MACHINE, TEST_TYPES
from .operating_ranges import ShaftEnergy, recorded, rise_lines, shaft_energy, signal_table
from .plot import courses, energy_course, plane
from .report import Column, Drawing, Line, Report, Row, Table

WORTH_SAYING = 0.01
"""Reduction by regeneration [%] below which it is the noise of a meter around no power."""


def general_report(motor: Motor, record: Record) -> Report:
    """Return the General Test report of a record.

    Args:
        motor: Gives gear ratio and wheel radius.
        record: Any record.

    Raises:
        InputError: If time runs backwards, or no signal was recorded.
    """
    if not recorded(record):
        raise InputError(
            "Expected at least one signal beside the time, found none that is mapped and filled; "
            f"columns that are not used: {', '.join(record.unused) or 'none'}.",
            where=record.name,
            remedy='Map them in the motor file, such as [columns] speed_rpm = "n [rpm]".',
        )
    found = general_information(record, motor)
    drawings = [
        Drawing("courses", "All recorded signals over time.", lambda: courses(record, motor))
    ]
    if found.energy_kWh is not None:
        drawings.append(
            Drawing(
                "energy",
                "Electrical power, and the energy drawn so far with and without what was fed back.",
                lambda: energy_course(record, motor),
            )
        )
    if has(record, "torque_Nm", "speed_rpm"):
        drawings.append(
            Drawing(
                "plane",
                "The torque-speed plane: where the test was, and where power is known, its mean "
                "and the efficiency of each cell.",
                lambda: plane(record, operating_map(record, motor)),
            )
        )
    return Report(
        kind="general",
        title=TEST_TYPES["general"].title,
        test=record.name,
        motor=motor.name,
        summary=information_summary(found, record),
        rows=information_rows(found),
        tables=(_signals(record, motor),),
        drawings=tuple(drawings),
        findings=(*record.findings, *found.findings),
        definitions=information_definitions(found),
        channels=recorded(record),
        sources=record.sources,
        result=found,
    )


def information_rows(found: GeneralInformation) -> tuple[Row, ...]:
    """Return the General Information table; what is undefined says why."""
    return tuple(
        Row(name, label, getattr(found, name), unit, _why(found.undefined.get(name, "")))
        for name, label, unit in found.figures
    )


def information_definitions(found: GeneralInformation) -> tuple[tuple[str, str], ...]:
    """Return what the figures mean, and which channels they were taken from."""
    left_out = {label for _, label, _ in FIGURES} - {label for _, label, _ in found.figures}
    kept = (each for each in DEFINITIONS if each[0] not in left_out)
    return (*kept, *(("Taken from", formula) for formula in found.formulas))


def information_summary(found: GeneralInformation, record: Record) -> str:
    """Return what came out in a sentence."""
    parts = [f"{record.duration_s / 60.0:.1f} min, {record.time_s.size} samples"]
    if found.energy_kWh is not None:
        parts.append(f"{found.energy_kWh:.4g} kWh")
    if found.distance_km is not None:
        parts.append(f"{found.distance_km:.4g} km")
    if found.consumption_Wh_per_km is not None:
        parts.append(f"{found.consumption_Wh_per_km:.4g} Wh/km")
    if found.reduction_percent is not None and found.reduction_percent >= WORTH_SAYING:
        parts.append(f"regeneration reduced the consumption by {found.reduction_percent:.3g} %")
    return ", ".join(parts) + "."


def _why(reason: str) -> str:
    return f"undefined: {reason}" if reason else ""


def _signals(record: Record, motor: Motor) -> Table:
    """Return the signals, with the rises of the machine's temperatures over its sink."""
    measured = signal_table(record, recorded(record))
    sink = sink_channel(motor)
    inside = [c for c in recorded(record) if c.endswith("_degC") and c not in NOT_OF_THE_MACHINE]
    rises = rise_lines(record, inside, sink) if sink in record else ()
    return replace(measured, lines=(*measured.lines, *rises))


EFFICIENCY = (
    "Mechanical over electrical energy where both are positive (as a motor), electrical over "
    "mechanical where both are negative (as a generator). In the map energies are summed over a "
    "cell before they are divided."
)


BY_LOAD = (
    "Load is the shaft power as a share of its largest magnitude; below 2 % there is none. Means "
    "are weighted by time, and the efficiency is that of the energy."
)


def energy_report(motor: Motor, record: Record) -> Report:
    """Return the Energy Consumption report of a record.

    Args:
        motor: Gives gear ratio and wheel radius, where the machine is in a vehicle; else distance
            and consumption give way to energies and efficiency by operating range.
        record: With electrical power.

    Raises:
        InputError: If the power is missing, or time runs backwards.
    """
    power = electrical_power(record, motor)
    found = general_information(record, motor)
    found_map, shaft = operating_map(record, motor), shaft_energy(record, motor)
    shown = [c for c in TEST_TYPES["energy"].channels if has(record, c)]
    kept = Record(record.name, {c: record[c] for c in ("time_s", *shown)}, record.sources)
    drawings = [
        Drawing(
            "energy",
            "Electrical power, and the energy drawn so far with and without what was fed back.",
            lambda: energy_course(kept, motor),
        ),
    ]
    if has(record, "torque_Nm", "speed_rpm"):
        drawings.append(
            Drawing(
                "plane",
                "The torque-speed plane: operating points, mean electrical power and efficiency "
                "of each cell.",
                lambda: plane(kept, found_map),
            )
        )
    drawings.append(
        Drawing("courses", "The signals behind it over time.", lambda: courses(kept, motor))
    )
    definitions = information_definitions(found)
    tables = [signal_table(with_powers(kept, motor), recorded(with_powers(kept, motor)))]
    if shaft is not None:
        definitions = (*definitions, ("Efficiency", EFFICIENCY))
    if shaft is not None and not found.of_vehicle:
        tables.insert(0, _range_table(shaft))
    return Report(
        kind="energy",
        title=TEST_TYPES["energy"].title,
        test=record.name,
        motor=motor.name,
        summary=_summary(found, record, shaft),
        rows=(
            *information_rows(found),
            *_power_rows(record, power, found.covered_s),
            *_shaft_rows(shaft, power.formula, of_vehicle=found.of_vehicle),
        ),
        tables=tuple(tables),
        drawings=tuple(drawings),
        findings=(
            *record.findings,
            *found.findings,
            *_of_balance(record, motor),
            *(() if shaft is None else above_one(record, _efficiencies(shaft, found_map))),
        ),
        definitions=definitions,
        channels=recorded(kept),
        sources=record.sources,
        result=found,
    )


def _of_balance(record: Record, motor: Motor) -> Iterator[Finding]:
    """Yield what the inputs tell of torque and powers, which a calibration corrects and energies
    do not.
    """
    for one in shaft_power_disagrees(record, motor) if "losses_W" in record else ():
        seen, *_ = SENTENCES.split(one.message)
        remedy, *_ = SENTENCES.split(one.remedy)
        as_they_are = "Energies and efficiency here are of the signals as they are."
        yield replace(one, message=f"{seen} {as_they_are}", remedy=remedy, test=record.name)


def _summary(found: GeneralInformation, record: Record, shaft: ShaftEnergy | None) -> str:
    said = information_summary(found, record)
    if found.of_vehicle or shaft is None or shaft.efficiency_motor is None:
        return said
    return f"{said.rstrip('.')}, efficiency {100.0 * shaft.efficiency_motor:.3g} % as a motor."


def _efficiencies(shaft: ShaftEnergy, found: OperatingMap | None) -> np.ndarray:
    """Return the efficiencies of all cells; without a map, those of the ranges [1]."""
    ranges = [np.nan if one.efficiency is None else one.efficiency for one in shaft.ranges]
    return np.array(ranges) if found is None else found.efficiency


def _power_rows(record: Record, power: Course, covered_s: float) -> tuple[Row, ...]:
    made = Record(record.name, {"time_s": record.time_s, "power": power.values})
    time_s, values = samples(made, "power")
    drawn, fed_back = float(values.max()), float(max(-values.min(), 0.0))
    mean = integrate(time_s, values).net / covered_s / 1000.0 if covered_s > 0.0 else None
    return (
        Row("mean_power_kW", "Mean power", mean, "kW"),
        Row("largest_power_kW", "Largest power drawn", drawn / 1000.0, "kW"),
        Row("largest_fed_back_kW", "Largest power fed back", fed_back / 1000.0, "kW"),
    )


def _shaft_rows(found: ShaftEnergy | None, formula: str, *, of_vehicle: bool) -> list[Row]:
    if found is None:
        return []
    rows = []
    if not of_vehicle:
        rows.append(
            Row("shaft_out_kWh", "Energy delivered at the shaft", found.out_J / J_PER_KWH, "kWh")
        )
        if found.efficiency_generator is not None:
            rows.append(
                Row("shaft_in_kWh", "Energy taken at the shaft", found.in_J / J_PER_KWH, "kWh")
            )
    for mode, value in (
        ("motor", found.efficiency_motor),
        ("generator", found.efficiency_generator),
    ):
        if value is None and not of_vehicle:
            continue
        note = formula if value is not None else f"undefined: never ran as a {mode}"
        shown = None if value is None else 100.0 * value
        name = f"efficiency_{mode}_percent"
        rows.append(Row(name, f"Efficiency as a {mode}", shown, "%", note, places=1))
    return rows


def _range_table(found: ShaftEnergy) -> Table:
    columns = (
        Column("time", "min"),
        Column("mean power in", "kW"),
        Column("peak power", "kW"),
        Column("mean at the shaft", "kW"),
        Column("mean losses", "kW"),
        Column("efficiency", "%"),
    )
    lines = [
        Line(
            one.name,
            "",
            (
                one.duration_s / 60.0,
                one.drawn_W / 1000.0,
                one.peak_W / 1000.0,
                one.shaft_W / 1000.0,
                (one.drawn_W - one.shaft_W) / 1000.0,
                None if one.efficiency is None else 100.0 * one.efficiency,
            ),
            places=(1, None, None, None, None, 1),
        )
        for one in found.ranges
    ]
    title = f"By load, in % of {found.largest_W / 1000.0:.4g} kW at the shaft"
    return Table(title, columns, tuple(lines), BY_LOAD)
