"""Energy Consumption: the General Information figures, and maps over torque and speed."""

from __future__ import annotations

from ...bench.checks.samples import samples
from ...bench.record import Record
from ...motor import Motor
from .analysis.drive import electrical_power, has, with_powers
from .analysis.general_information import general_information
from .analysis.operating_map import OperatingMap, operating_map
from .analysis.signal_table import recorded, signal_table
from .card import TEST_TYPES
from .figures.drive import courses, energy_course, plane
from .general import information_definitions, information_rows, information_summary
from .report import Drawing, Report, Row

EFFICIENCY = (
    "Mechanical over electrical energy where both are positive (as a motor), electrical over "
    "mechanical where both are negative (as a generator). In the map energies are summed over a "
    "cell before they are divided."
)


def energy_report(motor: Motor, record: Record) -> Report:
    """Return the Energy Consumption report of a record.

    Args:
        motor: Gives gear ratio and wheel radius.
        record: With electrical power and speed.

    Raises:
        InputError: If power or speed is missing, or time runs backwards.
    """
    found = general_information(record, motor, is_energy_report=True)
    found_map = operating_map(record, motor)
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
    if found_map is not None:
        definitions = (*definitions, ("Efficiency", EFFICIENCY))
    return Report(
        kind="energy",
        title=TEST_TYPES["energy"].title,
        test=record.name,
        motor=motor.name,
        summary=information_summary(found, record),
        rows=(*information_rows(found), *_power_rows(record, motor), *_map_rows(found_map)),
        tables=(signal_table(with_powers(kept, motor), recorded(with_powers(kept, motor))),),
        drawings=tuple(drawings),
        findings=(
            *record.findings,
            *found.findings,
            *(() if found_map is None else found_map.findings),
        ),
        definitions=definitions,
        channels=recorded(kept),
        sources=record.sources,
        result=found,
    )


def _power_rows(record: Record, motor: Motor) -> tuple[Row, ...]:
    power = electrical_power(record, motor)
    made = Record(record.name, {"time_s": record.time_s, "power": power.values})
    values = samples(made, "power")[1]
    drawn, fed_back = float(values.max()), float(max(-values.min(), 0.0))
    return (
        Row("largest_power_kW", "Largest power drawn", drawn / 1000.0, "kW"),
        Row("largest_fed_back_kW", "Largest power fed back", fed_back / 1000.0, "kW"),
    )


def _map_rows(found: OperatingMap | None) -> tuple[Row, ...]:
    if found is None:
        return ()
    return tuple(
        Row(
            f"efficiency_{mode}_percent",
            f"Efficiency as a {mode}",
            None if value is None else 100.0 * value,
            "%",
            f"undefined: never ran as a {mode}" if value is None else found.formula,
        )
        for mode, value in (
            ("motor", found.efficiency_motor),
            ("generator", found.efficiency_generator),
        )
    )
