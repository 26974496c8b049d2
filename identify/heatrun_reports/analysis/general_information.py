"""The General Information table: energy, distance, consumption, recuperation, tolerances."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from heatrun.errors import InputError, UsageError
from heatrun.record.channels import CHANNEL
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import is_measured, place

from .drive import (
    Course,
    Integral,
    electrical_power,
    integrate,
    is_of_vehicle,
    measured,
    road_speed,
)

J_PER_KWH = 3.6e6

SHORTEST_KM = 1e-3
"""Below a metre [km] the zero of a speed sensor makes the distance, and no consumption follows."""


class Figure(NamedTuple):
    """A figure of the table: name, wording and unit, what it is made of, and what it is."""

    name: str
    label: str
    unit: str
    needs: tuple[str, ...]
    definition: str


FIGURES = (
    Figure("energy_kWh", "Energy", "kWh", ("power",),
           "∫ P dt, what was drawn less what was fed back."),
    Figure("energy_without_regeneration_kWh", "Energy without regeneration", "kWh", ("power",),
           "∫ max(P, 0) dt: what would have been drawn had nothing been fed back."),
    Figure("distance_km", "Distance", "km", ("speed",),
           "∫ |v| dt; driving in reverse counts."),
    Figure("consumption_Wh_per_km", "Consumption", "Wh/km", ("power", "speed"),
           "Energy over distance; undefined below a distance of 1 m."),
    Figure("consumption_without_regeneration_Wh_per_km", "Consumption without regeneration",
           "Wh/km", ("power", "speed"), "Energy without regeneration over distance."),
    Figure("reduction_percent", "Consumption reduction", "%", ("power",),
           "100 · (1 − energy / energy without regeneration)."),
)  # fmt: skip
"""In the order of the table."""

INTEGRATION = (
    "Trapezoids between neighbouring samples on the record's own time axis; where the power "
    "changes sign between two samples, the zero of the straight line is one more point. Steps "
    "above three usual ones are gaps: they add neither energy nor distance."
)


@dataclass(frozen=True)
class GeneralInformation:
    r"""The figures of the General Information table, as `FIGURES` says; None where undefined."""

    energy_kWh: float | None
    energy_without_regeneration_kWh: float | None
    distance_km: float | None
    consumption_Wh_per_km: float | None
    consumption_without_regeneration_Wh_per_km: float | None
    reduction_percent: float | None
    undefined: Mapping[str, str]  # Reason for each figure that is None.
    formulas: tuple[str, ...]  # Where power and speed come from.
    covered_s: float  # Time integrated over [s].
    findings: tuple[Finding, ...]  # What is doubtful.
    of_vehicle: bool  # Whether distance and consumption are asked for.


def figures_of(tables: Iterable[GeneralInformation]) -> tuple[Figure, ...]:
    """Return the figures that are asked for: without a vehicle in any of them, energies alone."""
    of_vehicle = any(one.of_vehicle for one in tables)
    return tuple(one for one in FIGURES if of_vehicle or one.name.startswith("energy"))


def general_information(record: Record, motor: Motor) -> GeneralInformation:
    """Return the figures of the General Information table.

    Energy and distance are integrated over the same time: where either is not measured, neither
    counts. What is missing becomes a finding, and its figures are None; of a machine that is in no
    vehicle, there is no distance.

    Raises:
        InputError: If time runs backwards, or fewer than two samples can be used.
    """
    of_vehicle = is_of_vehicle(record, motor)
    courses: dict[str, Course] = {}
    lacking: dict[str, InputError] = {}
    for name, find in (("power", electrical_power), ("speed", road_speed)):
        if name == "speed" and not of_vehicle:
            continue
        try:
            courses[name] = find(record, motor)
        except InputError as error:
            lacking[name] = error
    integrals = _integrals(record, courses)
    findings = [
        Finding(f"no_{name}", "warning", error.problem, error.where, error.remedy, record.name)
        for name, error in lacking.items()
    ]
    findings += _gaps(record, integrals)
    power, speed = integrals.get("power"), integrals.get("speed")
    undefined = {}
    net = drawn = distance = consumption = without = reduction = None
    if power is not None:
        net, drawn = power.net / J_PER_KWH, power.positive / J_PER_KWH
        if drawn > 0.0:
            reduction = 100.0 * (1.0 - net / drawn)
        else:
            undefined["reduction_percent"] = "no energy was drawn that could have been reduced"
            if power.negative < 0.0:
                findings.append(
                    Finding(
                        "power_negative",
                        "warning",
                        "Expected power to be drawn; it is negative throughout, "
                        f"{net:.4g} kWh in all.",
                        record.name,
                        "A braking test, or a current that counts the other way? Then turn its "
                        "sign.",
                        record.name,
                    )
                )
    if speed is not None:
        distance = speed.absolute / 1000.0
    if net is not None and drawn is not None and distance is not None:
        if distance >= SHORTEST_KM:
            consumption, without = 1000.0 * net / distance, 1000.0 * drawn / distance
        else:
            reason = f"the distance of {1000.0 * distance:.3g} m is below 1 m"
            undefined["consumption_Wh_per_km"] = reason
            undefined["consumption_without_regeneration_Wh_per_km"] = reason
            findings.append(
                Finding(
                    "distance_zero",
                    "warning",
                    f"Expected a distance for the consumption; {reason}.",
                    record.name,
                    "Is the speed mapped, and did the test drive?",
                    record.name,
                )
            )
    values = (net, drawn, distance, consumption, without, reduction)
    for figure, value in zip(FIGURES, values, strict=True):
        if value is None and figure.name not in undefined:
            missing = [f"no {what}" for what in figure.needs if what in lacking]
            why = f"{' and '.join(missing)} in the record" if missing else "no vehicle is stated"
            undefined[figure.name] = why
    return GeneralInformation(
        *values,
        undefined=undefined,
        formulas=tuple(course.formula for course in courses.values()),
        covered_s=max((each.covered_s for each in integrals.values()), default=0.0),
        findings=tuple(findings),
        of_vehicle=of_vehicle,
    )


def _integrals(record: Record, courses: Mapping[str, Course]) -> dict[str, Integral]:
    time_s = record.time_s[is_measured(record.time_s)]
    back = np.flatnonzero(np.diff(time_s) < 0.0)
    if back.size:
        raise InputError(
            f"Expected increasing time; it falls from {time_s[back[0]]:.3f} s to "
            f"{time_s[back[0] + 1]:.3f} s.",
            where=place(record, "time_s", float(time_s[back[0]])),
            remedy="Split the file there.",
        )
    if not courses:
        return {}
    common_s, *values = measured(record, *(course.values for course in courses.values()))
    if common_s.size < 2:
        raise InputError(
            f"Expected at least two samples with {' and '.join(courses)}, got {common_s.size}.",
            where=record.name,
            remedy="Check that the columns are mapped and filled at the same times.",
        )
    return {n: integrate(common_s, v) for n, v in zip(courses, values, strict=True)}


def _gaps(record: Record, integrals: Mapping[str, Integral]) -> list[Finding]:
    one = next(iter(integrals.values()), None)
    if one is None:
        return []
    beyond_s = record.duration_s - one.covered_s - one.left_out_s
    if one.num_gaps == 0 and beyond_s <= 1e-9 * record.duration_s:
        return []
    return [
        Finding(
            "not_integrated",
            "warning",
            f"{one.num_gaps} gaps of together {one.left_out_s:.1f} s, and {max(beyond_s, 0.0):.1f} "
            "s before the first and after the last complete sample, add nothing to energy and "
            f"distance; the record lasts {record.duration_s:.1f} s.",
            record.name,
            "Check the logger, or read the figures as those of the rest.",
            record.name,
            {"num_gaps": float(one.num_gaps), "left_out_s": one.left_out_s},
        )
    ]


NAMES = (*(name for name in CHANNEL if name != "time_s"), *(one.name for one in FIGURES))
"""What a tolerance can be given for: channels, and figures of the General Information table."""


def parse_tolerances(texts: Sequence[str]) -> dict[str, float]:
    """Return tolerances by name from texts `NAME=VALUE`, in the unit of the name (K for degC).

    Raises:
        UsageError: If a text is no such pair, the name is unknown or the value not positive.
    """
    found = {}
    for text in texts:
        name, sign, number = text.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not sign or not (np.isfinite(value) and value > 0.0):
            raise UsageError(
                f"--tolerance {text!r}: expected CHANNEL=VALUE with a positive value, such as "
                "winding_degC=3."
            )
        if name not in NAMES:
            raise UsageError(
                f"--tolerance {text!r}: no channel or figure of this name; known are "
                f"{', '.join(NAMES)}."
            )
        found[name] = value
    return found
