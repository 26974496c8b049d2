"""The reports General Test, with every signal, and Energy Consumption, with maps.

Energy and efficiency are told by ranges of the shaft power, and each signal in one line.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from heatrun.errors import InputError
from heatrun.io.texts import SENTENCES
from heatrun.record.balance_errors import shaft_power_disagrees
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import is_measured, rounding_step, samples, sink_channel

from .analysis.drive import (
    Course,
    OperatingMap,
    above_one,
    bridged_steps,
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
from .plot import courses, energy_course, plane, unit, wording
from .report import NOT_OF_THE_MACHINE, TEST_TYPES, Column, Drawing, Line, Report, Row, Table

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


NO_LOAD = 0.02
"""Share of the largest shaft power below which the machine delivers nothing [1]: the zero of a
torque transducer."""

SHARES = (NO_LOAD, 0.25, 0.5, 0.75, 1.0)
"""Ends of the ranges over the largest shaft power [1]; quarters, as the load points of IEC
60034-2-1."""


@dataclass(frozen=True)
class OperatingRange:
    """What a machine did while its shaft power lay in a range.

    Attributes:
        name: Of the range.
        duration_s: How long [s].
        drawn_W: Mean electrical power [W], negative where it was fed back.
        peak_W: The electrical power of the largest magnitude [W].
        shaft_W: Mean shaft power [W].
        efficiency: Output over input energy [1]; None without load.
    """

    name: str
    duration_s: float
    drawn_W: float
    peak_W: float
    shaft_W: float
    efficiency: float | None


@dataclass(frozen=True)
class ShaftEnergy:
    """Energy at the shaft, and what became of it.

    Attributes:
        largest_W: Largest magnitude of the shaft power, which ranges are shares of [W].
        out_J: Delivered as a motor [J].
        in_J: Taken as a generator [J].
        efficiency_motor: Of the time as a motor [1]; None if there was none.
        efficiency_generator: Of the time as a generator [1]; None likewise.
        ranges: From generator to the largest shaft power; those that were never met left out.
    """

    largest_W: float
    out_J: float
    in_J: float
    efficiency_motor: float | None
    efficiency_generator: float | None
    ranges: tuple[OperatingRange, ...]


def shaft_energy(record: Record, motor: Motor) -> ShaftEnergy | None:
    """Return energies and efficiencies at the shaft; None where its power was not measured.

    Energies are summed over a range before they are divided, by trapezoids over the record's own
    time axis, gaps left out.

    Args:
        record: With electrical power.
        motor: Gives the number of phases.

    Raises:
        InputError: If no electrical power was recorded.
    """
    full = with_powers(record, motor)
    power = electrical_power(record, motor)
    if not has(full, "mechanical_power_W"):
        return None
    made = Record(record.name, {**full.channels, "power": power.values})
    time_s, drawn, shaft = samples(made, "power", "mechanical_power_W")
    if time_s.size < 2:
        return None
    steps = bridged_steps(time_s)
    weight = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    whole, largest = integrate(time_s, shaft), float(np.max(np.abs(shaft)))
    share = shaft / largest if largest > 0.0 else shaft
    spans = [("as a generator", share < -NO_LOAD), ("no load", np.abs(share) <= NO_LOAD)]
    spans += [
        (f"{100 * low:.0f} … {100 * high:.0f} %", (share > low) & (share <= high))
        for low, high in pairwise(SHARES)
    ]

    def of_range(name: str, inside: np.ndarray) -> OperatingRange:
        part = weight * inside
        efficiency = _ratio(drawn, shaft, part) if name == "as a generator" else None
        if name not in ("as a generator", "no load"):
            efficiency = _ratio(shaft, drawn, part)
        return OperatingRange(
            name,
            float(np.sum(part)),
            float(part @ drawn / np.sum(part)),
            float(drawn[inside][np.argmax(np.abs(drawn[inside]))]),
            float(part @ shaft / np.sum(part)),
            efficiency,
        )

    return ShaftEnergy(
        largest,
        whole.positive,
        -whole.negative,
        _ratio(shaft, drawn, weight * ((drawn > 0.0) & (shaft > 0.0))),
        _ratio(drawn, shaft, weight * ((drawn < 0.0) & (shaft < 0.0))),
        tuple(of_range(name, span) for name, span in spans if np.sum(weight * span) > 0.0),
    )


def _ratio(output: np.ndarray, given: np.ndarray, weight: np.ndarray) -> float | None:
    """Return an energy over another that was given for it [1]; None where they differ in sign."""
    out_J, given_J = float(np.sum(output * weight)), float(np.sum(given * weight))
    return out_J / given_J if out_J * given_J > 0.0 else None


FINEST, COARSEST = 1e-2, 10.0
"""Steps of readings that are printed as they were logged; of others four digits say enough."""

COLUMNS = (
    Column("start"),
    Column("end"),
    Column("lowest"),
    Column("mean"),
    Column("highest"),
    Column("missing", "%"),
)


def signal_table(record: Record, channels: tuple[str, ...], title: str = "Signals") -> Table:
    """Return a line for each channel; means are weighted by time, gaps left out.

    Args:
        record: Any record.
        channels: Canonical names; those without a measured sample are left out.
        title: Heading of the table.
    """
    lines = tuple(_line(record, channel) for channel in channels)
    return Table(title, COLUMNS, tuple(line for line in lines if line is not None))


def recorded(record: Record) -> tuple[str, ...]:
    """Return the canonical channels that hold a measured sample, without the time."""
    return tuple(c for c in record.channels if c != "time_s" and has(record, c))


def rise_lines(record: Record, channels: Sequence[str], sink: str) -> tuple[Line, ...]:
    """Return the lines of temperatures' rises over a sink, where both were measured.

    Args:
        record: Any record.
        channels: Temperatures, canonical names.
        sink: Likewise.
    """
    lines = []
    for channel in channels:
        time_s, values, below = samples(record, channel, sink)
        if time_s.size:
            name = f"{wording(channel)} over {wording(sink)}"
            lines.append(
                _line_of(name, "K", time_s, values - below, _missing(record, channel, sink))
            )
    return tuple(lines)


def _line(record: Record, channel: str) -> Line | None:
    time_s, values = samples(record, channel)
    if time_s.size == 0:
        return None
    missing = _missing(record, channel)
    return _line_of(wording(channel), unit(channel), time_s, values, missing)


def _missing(record: Record, *channels: str) -> float:
    """Return how much of a record misses one of some channels [%]."""
    return 100.0 * (
        1.0 - float(np.mean(np.all([is_measured(record[c]) for c in channels], axis=0)))
    )


def _line_of(
    name: str, symbol: str, time_s: np.ndarray, values: np.ndarray, missing: float
) -> Line:
    steps = bridged_steps(time_s)
    weight = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    mean = float(weight @ values / np.sum(weight)) if np.sum(weight) > 0.0 else float(values.mean())
    first, last, low, high = (float(v) for v in (values[0], values[-1], values.min(), values.max()))
    places = places_of_readings(values)
    further = None if places is None else places + 1
    return Line(
        name, symbol, (first, last, low, mean, high, missing),
        places=(places, places, places, further, places, None),
    )  # fmt: skip


def places_of_readings(values: np.ndarray) -> int | None:
    """Return the decimal places of readings that lie on a decimal grid, None for others.

    Args:
        values: Measured values without NaN, shape (time,).

    Example:
        >>> places_of_readings(np.round(np.sin(np.arange(50.0)), 2))
        2
    """
    step = rounding_step(values)
    if step is None or not FINEST <= step <= COARSEST:
        return None
    return max(0, -math.floor(math.log10(step) + 1e-6))
