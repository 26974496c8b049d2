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
    above_one,
    electrical_power,
    has,
    integrate,
    measured,
    operating_map,
    weights,
    with_powers,
)
from .analysis.general_information import (
    INTEGRATION,
    J_PER_KWH,
    GeneralInformation,
    figures_of,
    general_information,
)
from .plot import courses, energy_course, plane, wording
from .report import CARDS, NOT_OF_THE_MACHINE, Column, Drawing, Line, Report, Row, Table, unit

WORTH_SAYING = 0.01
"""Reduction by regeneration [%] below which it is the noise of a meter around no power."""


def general_report(motor: Motor, record: Record) -> Report:
    """Return the General Test report of a record; the motor gives gear ratio and wheel radius.

    Raises:
        InputError: If time runs backwards, or no signal was recorded.
    """
    shown = recorded(record)
    if not shown:
        raise InputError(
            "Expected at least one signal beside the time, found none that is mapped and filled; "
            f"columns that are not used: {', '.join(record.unused) or 'none'}.",
            where=record.name,
            remedy='Map them in the motor file, such as [columns] speed_rpm = "n [rpm]".',
        )
    found = general_information(record, motor)
    drawings = [Drawing("All recorded signals over time.", lambda: courses(record, motor))]
    if found.energy_kWh is not None:
        drawings.append(_energy_drawing(record, motor))
    if has(record, "torque_Nm", "speed_rpm"):
        drawings.append(
            Drawing(
                "The torque-speed plane: where the test was, and where power is known, its mean "
                "and the efficiency of each cell.",
                lambda: plane(record, operating_map(record, motor)),
            )
        )
    inside = [c for c in shown if c.endswith("_degC") and c not in NOT_OF_THE_MACHINE]
    return Report(
        kind="general",
        test=record.name,
        motor=motor.name,
        summary=_summary(found, record),
        rows=_information_rows(found),
        tables=(signal_table(record, shown, rises_of=inside, sink=sink_channel(motor)),),
        drawings=tuple(drawings),
        findings=(*record.findings, *found.findings),
        definitions=_definitions(found),
        channels=shown,
        sources=record.sources,
        result=found,
    )


def _energy_drawing(record: Record, motor: Motor) -> Drawing:
    return Drawing(
        "Electrical power, and the energy drawn so far with and without what was fed back.",
        lambda: energy_course(record, motor),
    )


def _information_rows(found: GeneralInformation) -> tuple[Row, ...]:
    """Return the General Information table; what is undefined says why."""
    why = {name: f"undefined: {reason}" for name, reason in found.undefined.items()}
    return tuple(
        Row(one.name, one.label, getattr(found, one.name), one.unit, why.get(one.name, ""))
        for one in figures_of([found])
    )


def _definitions(found: GeneralInformation) -> tuple[tuple[str, str], ...]:
    """Return what the figures mean, and which channels they were taken from."""
    figures = ((one.label, one.definition) for one in figures_of([found]))
    sources = (("Taken from", formula) for formula in found.formulas)
    return (*figures, ("Integration", INTEGRATION), *sources)


def _summary(found: GeneralInformation, record: Record) -> str:
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

    Where the machine is in no vehicle, distance and consumption give way to energies and
    efficiency by operating range.

    Raises:
        InputError: If the power is missing, or time runs backwards.
    """
    power = electrical_power(record, motor)
    found = general_information(record, motor)
    found_map, shaft = operating_map(record, motor), shaft_energy(record, motor)
    channels = [c for c in CARDS["energy"].channels if has(record, c)]
    kept = Record(record.name, {c: record[c] for c in ("time_s", *channels)}, record.sources)
    drawings = [_energy_drawing(kept, motor)]
    if has(record, "torque_Nm", "speed_rpm"):
        drawings.append(
            Drawing(
                "The torque-speed plane: operating points, mean electrical power and efficiency "
                "of each cell.",
                lambda: plane(kept, found_map),
            )
        )
    drawings.append(Drawing("The signals behind it over time.", lambda: courses(kept, motor)))
    full, summary, definitions = with_powers(kept, motor), _summary(found, record), []
    tables, findings = [signal_table(full, recorded(full))], []
    if shaft is not None:
        definitions = [("Efficiency", EFFICIENCY)]
        ranges = np.array([one.cells[-1] for one in shaft.ranges.lines], dtype=float) / 100.0
        findings = above_one(record, ranges if found_map is None else found_map.efficiency)
        if not found.of_vehicle:
            tables.insert(0, shaft.ranges)
            if shaft.efficiency_motor is not None:
                said = f"efficiency {100.0 * shaft.efficiency_motor:.3g} % as a motor."
                summary = f"{summary.rstrip('.')}, {said}"
    return Report(
        kind="energy",
        test=record.name,
        motor=motor.name,
        summary=summary,
        rows=(
            *_information_rows(found),
            *_power_rows(record, power, found.covered_s),
            *_shaft_rows(shaft, power.formula, of_vehicle=found.of_vehicle),
        ),
        tables=tuple(tables),
        drawings=tuple(drawings),
        findings=(*record.findings, *found.findings, *_of_balance(record, motor), *findings),
        definitions=(*_definitions(found), *definitions),
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


def _power_rows(record: Record, power: Course, covered_s: float) -> tuple[Row, ...]:
    time_s, values = measured(record, power.values)
    drawn, fed_back = float(values.max()), max(-float(values.min()), 0.0) + 0.0  # never -0
    mean = integrate(time_s, values).net / covered_s / 1000.0 if covered_s > 0.0 else None
    return (
        Row("mean_power_kW", "Mean power", mean, "kW"),
        Row("largest_power_kW", "Largest power drawn", drawn / 1000.0, "kW"),
        Row("largest_fed_back_kW", "Largest power fed back", fed_back / 1000.0, "kW"),
    )


def _shaft_rows(found: ShaftEnergy | None, formula: str, *, of_vehicle: bool) -> list[Row]:
    if found is None:
        return []
    by_mode = (("motor", found.efficiency_motor), ("generator", found.efficiency_generator))
    if of_vehicle:
        rows, shown = [], [(mode, value) for mode, value in by_mode if value is not None]
    else:
        out, taken = found.out_J / J_PER_KWH, found.in_J / J_PER_KWH
        rows, shown = [Row("shaft_out_kWh", "Energy delivered at the shaft", out, "kWh")], by_mode
        if found.efficiency_generator is not None:
            rows.append(Row("shaft_in_kWh", "Energy taken at the shaft", taken, "kWh"))
    for mode, value in shown:
        note = formula if value is not None else f"undefined: never ran as a {mode}"
        percent = None if value is None else 100.0 * value
        name = f"efficiency_{mode}_percent"
        rows.append(Row(name, f"Efficiency as a {mode}", percent, "%", note, places=1))
    return rows


RANGE_COLUMNS = (
    Column("time", "min"), Column("mean power in", "kW"), Column("peak power", "kW"),
    Column("mean at the shaft", "kW"), Column("mean losses", "kW"), Column("efficiency", "%"),
)  # fmt: skip

NO_LOAD = 0.02
"""Share of the largest shaft power below which the machine delivers nothing [1]: the zero of a
torque transducer."""

SHARES = (NO_LOAD, 0.25, 0.5, 0.75, 1.0)
"""Ends of the ranges over the largest shaft power [1]; quarters, as the load points of IEC
60034-2-1."""


@dataclass(frozen=True)
class ShaftEnergy:
    """Energy at the shaft, and what became of it."""

    out_J: float  # Delivered as a motor [J].
    in_J: float  # Taken as a generator [J].
    efficiency_motor: float | None  # Of the time as a motor [1]; None if there was none.
    efficiency_generator: float | None  # Of the time as a generator [1]; None likewise.
    ranges: Table  # From generator to the largest shaft power; those that were never met left out.


def shaft_energy(record: Record, motor: Motor) -> ShaftEnergy | None:
    """Return energies and efficiencies at the shaft; None where its power was not measured.

    Energies are summed over a range before they are divided, by trapezoids over the record's own
    time axis, gaps left out.

    Raises:
        InputError: If no electrical power was recorded.
    """
    full = with_powers(record, motor)
    power = electrical_power(record, motor)
    if not has(full, "mechanical_power_W"):
        return None
    time_s, drawn, shaft = measured(full, power.values, full["mechanical_power_W"])
    if time_s.size < 2:
        return None
    weight = weights(time_s)
    whole, largest = integrate(time_s, shaft), float(np.max(np.abs(shaft)))
    share = shaft / largest if largest > 0.0 else shaft
    spans = [("as a generator", share < -NO_LOAD), ("no load", np.abs(share) <= NO_LOAD)]
    spans += [
        (f"{100 * low:.0f} … {100 * high:.0f} %", (share > low) & (share <= high))
        for low, high in pairwise(SHARES)
    ]

    def of_range(name: str, inside: np.ndarray) -> Line:
        part = weight * inside
        mean_in, mean_out = (float(part @ each / np.sum(part)) for each in (drawn, shaft))
        output, given = (drawn, shaft) if name == "as a generator" else (shaft, drawn)
        efficiency = None if name == "no load" else _ratio(output, given, part)
        cells = (
            float(np.sum(part)) / 60.0,
            mean_in / 1000.0,
            float(drawn[inside][np.argmax(np.abs(drawn[inside]))]) / 1000.0,
            mean_out / 1000.0,
            (mean_in - mean_out) / 1000.0,
            None if efficiency is None else 100.0 * efficiency,
        )
        return Line(name, "", cells, places=(1, None, None, None, None, 1))

    lines = tuple(of_range(name, span) for name, span in spans if np.sum(weight * span) > 0.0)
    title = f"By load, in % of {largest / 1000.0:.4g} kW at the shaft"
    return ShaftEnergy(
        whole.positive,
        -whole.negative,
        _ratio(shaft, drawn, weight * ((drawn > 0.0) & (shaft > 0.0))),
        _ratio(drawn, shaft, weight * ((drawn < 0.0) & (shaft < 0.0))),
        Table(title, RANGE_COLUMNS, lines, BY_LOAD),
    )


def _ratio(output: np.ndarray, given: np.ndarray, weight: np.ndarray) -> float | None:
    """Return an energy over another that was given for it [1]; None where they differ in sign."""
    out_J, given_J = float(np.sum(output * weight)), float(np.sum(given * weight))
    return out_J / given_J if out_J * given_J > 0.0 else None


FINEST, COARSEST = 1e-2, 10.0
"""Steps of readings that are printed as they were logged; of others four digits say enough."""

COLUMNS = (
    Column("start"), Column("end"), Column("lowest"), Column("mean"), Column("highest"),
    Column("missing", "%"),
)  # fmt: skip


def recorded(record: Record) -> tuple[str, ...]:
    """Return the canonical channels that hold a measured sample, without the time."""
    return tuple(c for c in record.channels if c != "time_s" and has(record, c))


def signal_table(
    record: Record, channels: Sequence[str], title: str = "Signals", *,
    rises_of: Sequence[str] = (), sink: str = "",
) -> Table:  # fmt: skip
    """Return a line for each channel, and for rises over a sink where both were measured.

    Means are weighted by time, gaps left out; channels without a measured sample are left out.
    """
    lines = [_line(wording(c), unit(c), record, c) for c in channels]
    if sink in record:
        names = [(c, f"{wording(c)} over {wording(sink)}") for c in rises_of]
        lines += [_line(name, "K", record, c, sink) for c, name in names]
    return Table(title, COLUMNS, tuple(line for line in lines if line is not None))


def _line(name: str, symbol: str, record: Record, *channels: str) -> Line | None:
    """A line on a channel, less a second one if there is one; None where nothing was measured."""
    time_s, values, *below = samples(record, *channels)
    if time_s.size == 0:
        return None
    values = values - below[0] if below else values
    known = np.all([is_measured(record[c]) for c in channels], axis=0)
    weight = weights(time_s)
    mean = float(weight @ values / np.sum(weight)) if np.sum(weight) > 0.0 else float(values.mean())
    first, last, low, high = (float(v) for v in (values[0], values[-1], values.min(), values.max()))
    places = places_of_readings(values)
    further = None if places is None else places + 1
    return Line(
        name, symbol, (first, last, low, mean, high, 100.0 * (1.0 - float(np.mean(known)))),
        places=(places, places, places, further, places, None),
    )  # fmt: skip


def places_of_readings(values: np.ndarray) -> int | None:
    """Return the decimal places of readings, shape (time,), on a decimal grid; None for others.

    Example:
        >>> places_of_readings(np.round(np.sin(np.arange(50.0)), 2))
        2
    """
    step = rounding_step(values)
    if step is None or not FINEST <= step <= COARSEST:
        return None
    return max(0, -math.floor(math.log10(step) + 1e-6))
