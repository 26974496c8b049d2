"""Readings after switch-off: times counted from it, ohms or degrees, and what is wrong there."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from ..errors import InputError
from ..readers.read import read_raw, read_record
from ..record.by_resistance import CIRCUITS
from ..record.header import split_name
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.stretch import parse_time
from ..record.units import find_unit

FEWEST = 3
"""Readings of which a course can be told."""

DAY_S = 86400.0

LATEST_S = 7200.0
"""No first reading of a winding comes later [s]: such a time is that of a clock."""

HOTTEST_degC = 240.0
"""20 K above the highest insulation class; more is an error of the resistance."""

BELOW_SINK_K = 8.0
"""What errors of the cold resistance may show a winding below its sink [K]: 3 %. It guesses the
circuit; what is stated of the instruments decides on the readings."""

SURE, SCATTER_K = 4.0, 1.0
"""Standard deviations by which a winding is surely below its sink [1], beside a scatter [K]."""

WARMS_K = 1.0
"""What readings of a winding that cools may end above the first one: their scatter [K]."""

TERMINALS = (1.0, 2.0, 2.0 / 3.0)
"""Of `CIRCUITS`, what a bridge at a machine's terminals measures."""

OTHER_CIRCUITS = {
    2.0: "of a phase, measured at terminals of a star",
    0.5: "at terminals of a star, measured on a phase",
    1.0 / 3.0: "connected in star, measured in delta",
    3.0: "connected in delta, measured in star",
    2.0 / 3.0: "of a phase, measured at terminals of a delta",
    1.5: "at terminals of a delta, measured on a phase",
}
"""Factors between circuits of one winding that are taken for each other."""

CLOCK = re.compile(r"([01]?\d|2[0-3]):([0-5]\d)(?::([0-5]\d(?:\.\d+)?))?")


@dataclass(frozen=True)
class Readings:
    """Readings after switch-off."""

    name: str  # Of the file.
    time_s: np.ndarray  # Since the stated moment of switch-off [s], shape (time,), ascending.
    degC: np.ndarray  # Temperatures, by the cold resistance that is stated, shape (time,).
    sink_degC: float  # Mean temperature of the sink over the readings.
    ohm: np.ndarray | None  # What was measured [ohm], shape (time,); None for a sensor.
    # Cold resistance of the same circuit, leads included [ohm]; None for a sensor.
    reference_ohm: float | None
    notes: tuple[str, ...]  # How it was read.
    sha256: str  # Digest of the file.
    left_out: tuple[str, ...] = ()  # Readings off the course of the others, in words.
    findings: tuple[Finding, ...] = ()  # Doubts about how it was read.


OUTLIER, LEAST_OFF_K, MOST_OUT = 8.0, 0.5, 0.2
"""A reading is none of the course where it is off by so many times the scatter of the others [1],
and by so much [K]; where more than this share [1] is, it is not for a rule to say which."""

OF_COURSE_S = np.geomspace(3.0, 3e4, 17)
"""Time constants of which every course that cools can be put together [s]."""


def without_outliers(readings: Readings, lag_s: float) -> Readings:
    """Leave readings out that lie off the course of the others, and name them.

    The course is any sum of exponentials that all decay, fitted to the sum of absolute differences:
    a winding that cools has no other, and few wrong readings do not move it.

    Args:
        readings: As read.
        lag_s: Of a sensor [s], whose course begins flat; 0 for none.
    """
    time_s, T = readings.time_s, readings.degC
    columns = [np.exp(-time_s / tau) for tau in OF_COURSE_S] + [np.ones(T.size)]
    columns += [-np.exp(-time_s / lag_s)] if lag_s > 0.0 else []
    design, low = np.stack(columns, axis=1), np.min(T) - 50.0
    weight, off = np.ones(T.size), T
    for _ in range(30):
        try:
            fitted = nnls(design * weight[:, None], (T - low) * weight, maxiter=1000)[0]
        except RuntimeError:  # it goes round in circles: nothing is told
            return readings
        off = T - low - design @ fitted
        weight = np.maximum(np.abs(off), 1e-3) ** -0.5
    limit = max(OUTLIER * 1.4826 * float(np.median(np.abs(off))), LEAST_OFF_K)
    is_out = np.abs(off) > limit
    if not is_out.any() or np.mean(is_out) > MOST_OUT or T.size - np.sum(is_out) < FEWEST:
        return readings
    words = tuple(
        f"The reading after {time_s[k]:.6g} s, {T[k]:.1f} °C, lies {abs(off[k]):.1f} K "
        f"{'above' if off[k] > 0.0 else 'below'} the course of the others and is left out."
        for k in np.flatnonzero(is_out)
    )
    keep = ~is_out
    ohm = None if readings.ohm is None else readings.ohm[keep]
    return replace(readings, time_s=time_s[keep], degC=T[keep], ohm=ohm, left_out=words)


def read_readings(path: Path, motor: Motor, at: str = "") -> Readings:
    """Read a file of readings.

    Args:
        path: Times and resistances, or temperatures of a sensor.
        motor: Columns, material, cold resistance, leads.
        at: Moment of switch-off in the file's own time: seconds, `10min`, or a clock `14:32:05`;
            empty where the file counts from it.

    Raises:
        InputError: If the file cannot be read, or its readings are none of a winding that cools.
    """
    record = _read(path, motor)
    where = str(path)
    time_s = _since(record, at, where)
    is_ohm = "winding_resistance_ohm" in record
    values = record["winding_resistance_ohm" if is_ohm else "winding_degC"]
    _refuse_disorder(time_s, where)
    used = np.isfinite(time_s) & np.isfinite(values) & (time_s >= 0.0)
    before = int(np.sum(time_s < 0.0))
    notes = [*record.notes]
    if before:
        notes.append(f"{before} readings before switch-off are left out.")
    time_s, values = time_s[used], values[used]
    if time_s.size < FEWEST:
        raise InputError(
            f"Expected at least {FEWEST} readings after switch-off, got {time_s.size}.",
            where=where,
            remedy="Go on reading for some minutes: one reading tells no course."
            + ("" if not at else " Or check --at."),
        )
    if time_s[0] > LATEST_S:
        raise InputError(
            f"The first reading comes {time_s[0]:.0f} s after switch-off.",
            where=where,
            remedy="Give the moment of switch-off in the file's time, as in --at 14:32:05.",
        )
    sink_degC = _sink(record, motor, used, where)
    degC, ohm, reference = values, None, None
    if is_ohm:
        reference, note = _reference(time_s, values, motor, sink_degC, where)
        degC, ohm = temperature(values, reference, motor), values
        notes.append(note)
    _refuse_below_sink(time_s, degC, sink_degC, motor, where, is_ohm=is_ohm)
    if np.ptp(degC) == 0.0:
        raise InputError(
            f"All {degC.size} readings are the same, {values[0]:.5g}: no winding cools so.",
            where=where,
            remedy="Check that the instrument went on measuring, and the column.",
        )
    if degC[-1] > degC[0] + WARMS_K:
        raise InputError(
            f"The winding does not cool: {degC[0]:.1f} °C {time_s[0]:.0f} s after switch-off, "
            f"{degC[-1]:.1f} °C after {time_s[-1]:.0f} s.",
            where=where,
            remedy="Give the moment of switch-off by --at where the file begins before it, or the "
            "readings after it alone.",
        )
    doubts = tuple(
        replace(one, where=one.where.replace(where, path.name))
        for one in record.findings
        if one.severity != "note"
    )
    read = Readings(record.name, time_s, degC, sink_degC, ohm, reference, tuple(notes),
                    record.sources[0].sha256, findings=doubts)  # fmt: skip
    return without_outliers(read, 0.0 if is_ohm else motor.shutdown.sensor_lag_s)


def temperature(ohm: np.ndarray, reference_ohm: float, motor: Motor) -> np.ndarray:
    """Return the temperatures of resistances [degC]; leads are taken off both."""
    leads, B = motor.lead_resistance_ohm, motor.resistance_coefficient_degC
    ratio = (ohm - leads) / (reference_ohm - leads)
    return ratio * (B + motor.reference_temperature_degC) - B


def _read(path: Path, motor: Motor) -> Record:
    """Return the record; columns in ohms are the winding's, in a file of such readings."""
    record = read_record(path, motor, is_from_first=False)
    if "winding_resistance_ohm" in record or "winding_degC" in record:
        return record
    ohms = [name for name in record.unused if _is_resistance(name)]
    if not ohms:
        raise InputError(
            "Expected readings of the winding's resistance, or of a sensor in it; found none.",
            where=str(path),
            remedy='Name the column with its unit, such as "R [mOhm]", or map it by [columns] '
            "winding_resistance_ohm or winding_degC.",
        )
    text = ohms[0] if len(ohms) == 1 else f"mean({', '.join(ohms)})"
    of_pair = _in_turn(path, ohms)
    if of_pair is not None:
        text = ohms[0]  # for its unit and the times
    columns = {**motor.columns_of(record.name), "winding_resistance_ohm": text}
    read = read_record(path, replace(motor, columns=columns, tests={}), is_from_first=False)
    if of_pair is None or of_pair.shape[1] != read.time_s.size:
        return read
    values = _one_at_a_time(read.time_s, of_pair)
    first = int(np.flatnonzero(np.isfinite(of_pair[0]))[0])
    unit = read["winding_resistance_ohm"][first] / of_pair[0, first]
    note = f"Read in turn: {', '.join(ohms)}; each by its own part of their mean."
    return read.having({"winding_resistance_ohm": unit * values}, note)


def _in_turn(path: Path, names: list[str]) -> np.ndarray | None:
    """Return cells of pairs of terminals, shape (pair, time), if no row has more than one."""
    if len(names) < 2 or len({split_name(name)[1] for name in names}) > 1:
        return None
    cells = {column.name: column.values for column in read_raw(path).columns}
    if not set(names) <= set(cells):
        return None
    read = np.stack([cells[name] for name in names])
    return read if np.all(np.sum(np.isfinite(read), axis=0) <= 1) else None


DEGREE = 5
"""Of the polynomial over log(time) that all pairs of terminals share."""


def _one_at_a_time(time_s: np.ndarray, read: np.ndarray) -> np.ndarray:
    """Return the mean resistance of pairs of terminals that were read in turn, in their unit.

    A pair's part of the mean is a constant of the machine; all pairs cool along one course.
    """
    pair, row = np.nonzero(np.isfinite(read))
    late = np.log(time_s[row] - time_s[0] + 60.0)
    course = np.polynomial.chebyshev.chebvander(
        2.0 * (late - late.min()) / max(float(np.ptp(late)), 1e-9) - 1.0, DEGREE
    )
    design = np.concatenate([course, np.eye(len(read))[pair][:, 1:]], axis=1)
    fitted = np.linalg.lstsq(design, np.log(read[pair, row]), rcond=None)[0]
    parts = np.exp(np.append(0.0, fitted[DEGREE + 1 :]))
    parts /= np.mean(parts)
    found = read / parts[:, None]
    is_read = np.isfinite(found).any(axis=0)
    found[:, ~is_read] = 0.0
    return np.where(is_read, np.nanmean(found, axis=0), np.nan)


def _is_resistance(name: str) -> bool:
    unit = split_name(name)[1]
    return unit is not None and find_unit(unit, "resistance") is not None


def _since(record: Record, at: str, where: str) -> np.ndarray:
    """Return the times since switch-off [s]."""
    time_s = record.time_s
    clock = CLOCK.fullmatch(at.strip())
    if clock:
        hours, minutes, seconds = (float(part or 0.0) for part in clock.groups())
        moment = 3600.0 * hours + 60.0 * minutes + seconds
        time_s = time_s + (record.clock_s or 0.0) - moment
        last = time_s[np.isfinite(time_s)][-1]
        return time_s - DAY_S * np.floor(last / DAY_S)  # of readings that go on over midnight
    if at:
        remedy = "Write --at 30s, --at 10min or, as a clock has it, --at 14:32:05."
        return time_s - parse_time(at, where, remedy)
    if record.clock_s is not None:
        raise InputError(
            "The file has dates, and does not say when the machine was switched off.",
            where=where,
            remedy="Give it by its clock, as in --at 14:32:05; --at 0s for the first row.",
        )
    return time_s


def _refuse_disorder(time_s: np.ndarray, where: str) -> None:
    back = np.flatnonzero(np.diff(time_s) <= 0.0)
    if back.size:
        first = int(back[0])
        raise InputError(
            f"Reading {first + 2} is {time_s[first + 1]:.6g} s after switch-off, the one before "
            f"it {time_s[first]:.6g} s: the times do not ascend.",
            where=where,
            remedy="Put the readings in the order in which they were taken, each time once.",
        )


def _sink(record: Record, motor: Motor, used: np.ndarray, where: str) -> float:
    channel = f"{motor.sink}_degC"
    values = record.channels.get(channel, np.full(1, motor.constants.get(channel, np.nan)))
    values = values[used] if values.size == used.size else values
    if not np.isfinite(values).any():
        raise InputError(
            f"The temperature of the {motor.sink} at switch-off is not given.",
            where=where,
            remedy=f"Add a column {channel}, or [constants] {channel} = 25.0 in the motor file.",
        )
    return float(np.nanmean(values))


def _refuse_below_sink(
    time_s: np.ndarray,
    degC: np.ndarray,
    sink_degC: float,
    motor: Motor,
    where: str,
    *,
    is_ohm: bool,
) -> None:
    """Refuse a winding that is surely colder than what it cools to, and name the first reading."""
    said, B = motor.shutdown, motor.resistance_coefficient_degC
    own = (said.cold_resistance_sd * (B + sink_degC), said.cold_temperature_sd_K)
    sd = np.linalg.norm([said.sink_sd_K, *(own if is_ohm else (said.sensor_sd_K,))])
    below = np.flatnonzero(degC < sink_degC - SURE * sd - SCATTER_K)
    if below.size:
        k = int(below[0])
        raise InputError(
            f"The reading after {time_s[k]:.6g} s gives {degC[k]:.1f} °C, below the {motor.sink} "
            f"of {sink_degC:.1f} °C by more than the stated uncertainties (k = 1: {sd:.1f} K) "
            "allow. Below its coolant no winding cools.",
            where=where,
            remedy="Check that reading, the cold resistance with its temperature, and the "
            f"temperature of the {motor.sink}; or state how uncertain they are in [shutdown].",
        )  # fmt: skip


def _reference(
    time_s: np.ndarray, ohm: np.ndarray, motor: Motor, sink_degC: float, where: str
) -> tuple[float, str]:
    """Return the cold resistance of the measured circuit [ohm], and how it is known."""
    at = f"at {motor.reference_temperature_degC:g} °C"
    phase, stated = motor.phase_resistance_ohm, motor.measured_resistance_ohm
    leads = motor.lead_resistance_ohm
    if stated is None and phase is None:
        raise InputError(
            "The cold resistance of the winding is not given.",
            where=where,
            remedy=f"State it {at}, of the same circuit, leads included: [winding] "
            "measured_resistance_ohm, with reference_temperature_degC.",
        )
    if stated is not None:
        _refuse_implausible(time_s, ohm, stated, motor, sink_degC, where)
        return stated, f"Cold resistance {stated:.5g} ohm {at}, leads included."
    assert phase is not None
    fitting = {
        factor: CIRCUITS[factor]
        for factor in TERMINALS
        if _is_plausible(temperature(ohm, factor * phase + leads, motor), sink_degC)
    }
    if len(fitting) == 1:
        ((factor, circuit),) = fitting.items()
        known = factor * phase + leads
        return (
            known,
            f"Cold resistance {known:.5g} ohm {at}: {factor:.3g} times a phase ({circuit}).",
        )
    if not fitting:
        _refuse_implausible(time_s, ohm, phase + leads, motor, sink_degC, where)
    raise InputError(
        f"The first reading is {ohm[0]:.5g} ohm and a phase has {phase:.5g} ohm {at}: "
        f"it may be {' or '.join(fitting.values())}.",
        where=where,
        remedy=f"State the cold resistance of the measured circuit, leads included, {at}: "
        "[winding] measured_resistance_ohm.",
    )


def _is_plausible(degC: np.ndarray, sink_degC: float) -> bool:
    return bool(np.min(degC) > sink_degC - BELOW_SINK_K and np.max(degC) < HOTTEST_degC)


def _refuse_implausible(
    time_s: np.ndarray,
    ohm: np.ndarray,
    reference: float,
    motor: Motor,
    sink_degC: float,
    where: str,
) -> None:
    """Refuse resistances that no winding can have, with the reading, unit or circuit at fault."""
    degC = temperature(ohm, reference, motor)
    if _is_plausible(degC, sink_degC):
        return
    wrong = [k for k in range(ohm.size) if not _is_plausible(degC[k : k + 1], sink_degC)]
    if len(wrong) <= ohm.size // 4:
        k = wrong[0]
        raise InputError(
            f"The reading after {time_s[k]:.6g} s, {ohm[k]:.5g} ohm, gives {degC[k]:.0f} °C"
            f"{f'; {len(wrong)} such in all' if len(wrong) > 1 else ''}. The others fit.",
            where=where,
            remedy="Correct it as it was noted, or leave its row out.",
        )
    said = (
        f"The readings, {ohm[0]:.5g} to {ohm[-1]:.5g} ohm, give {degC[0]:.0f} to {degC[-1]:.0f} °C "
        f"with a cold resistance of {reference:.5g} ohm at "
        f"{motor.reference_temperature_degC:g} °C; the {motor.sink} has {sink_degC:.1f} °C."
    )
    guesses = [
        f"the unit of the column is wrong: times {factor:g} they would fit (mΩ, Ω, kΩ)"
        for factor in (1e3, 1e-3, 1e6, 1e-6)
        if _is_plausible(temperature(ohm * factor, reference, motor), sink_degC)
    ]
    guesses += [
        f"the cold resistance is of another circuit: {times:.3g} times it would fit ({circuit})"
        for times, circuit in OTHER_CIRCUITS.items()
        if _is_plausible(temperature(ohm, times * reference, motor), sink_degC)
    ]
    below = np.min(degC) < sink_degC - BELOW_SINK_K
    cause = " Below its coolant no winding cools." if below else ""
    maybe = f" Perhaps {'; or '.join(guesses)}." if guesses else ""
    raise InputError(
        f"{said}{cause}{maybe}",
        where=where,
        remedy="Check the unit of the column and [winding] measured_resistance_ohm: the same "
        "circuit, leads included, at reference_temperature_degC.",
    )
