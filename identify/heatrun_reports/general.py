"""General Test: every signal, and the General Information table."""

from __future__ import annotations

from heatrun.bench.record import Record
from heatrun.errors import InputError
from heatrun.motor import Motor

from .analysis.drive import has
from .analysis.general_information import (
    DEFINITIONS,
    FIGURES,
    GeneralInformation,
    general_information,
)
from .analysis.operating_map import operating_map
from .analysis.signal_table import recorded, signal_table
from .card import TEST_TYPES
from .figures.drive import courses, energy_course, plane
from .report import Drawing, Report, Row

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
        tables=(signal_table(record, recorded(record)),),
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
