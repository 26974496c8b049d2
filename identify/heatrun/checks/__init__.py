"""Quality checks of bench records: one file for each family, one tuple that names them all.

A check takes a record and the motor and yields findings; it changes nothing and raises nothing,
whatever the record holds.

Where a finding names a fault, the checks that come after it see the record without it: what a fault
brings about is then not told beside it, and what is not its doing is. Nothing that is fitted is
changed: the record stays as it was read.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..record.balance_errors import prior_of, shaft_power_disagrees
from ..record.channels import BODIES
from ..record.derive import RAD_PER_S_PER_RPM, recorded_shaft_power
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import channel_of, sink_channel, without_pickup
from ..record.stretch import bridge, mask, move_load, windows, within
from .advice import in_one_line
from .course import (
    ambient_moving,
    cut_while_warm,
    no_heating,
    resolution,
    start_not_in_equilibrium,
    truncation,
)
from .excitation import single_step, too_short
from .frozen import Looked, frozen_stretches, saturation, sensor_stuck
from .heat import load_of_another, losses_absent, losses_absurd, losses_of_dc_link
from .load_held import load_stuck
from .load_moments import load_late
from .load_spike import load_spike, spike_windows
from .losses import current_amplitude, losses_below_copper, losses_negative, losses_of_shaft
from .presence import missing_channel, nan_block, too_few_samples
from .same_quantity import columns_disagree
from .sensor import loses_contact, open_spans, sensor_detached, sensor_pickup, temperature_jump
from .standstill import current_scale_unchecked, resistance_coefficient, standstill_losses
from .suitability import simulated_by_heatrun
from .time_axis import (
    is_sorted_otherwise,
    is_told_by_clock,
    sampling,
    time_backwards,
    time_duplicate,
    time_gap,
    time_jitter,
)
from .unexplained import unexplained_movement
from .units import ambient_implausible, unit_assumed, units_temperature
from .which_unit import read_otherwise, unit_suspected

Check = Callable[..., Iterable[Finding]]
"""Takes record and motor; one of `OF_THE_SENSOR` what they have `Looked` at as well."""

CHECKS: tuple[Check, ...] = (
    missing_channel,
    simulated_by_heatrun,
    too_few_samples,
    time_backwards,
    time_duplicate,
    time_gap,
    time_jitter,
    sampling,
    load_spike,
    load_stuck,
    nan_block,
    units_temperature,
    shaft_power_disagrees,
    losses_of_shaft,
    resistance_coefficient,
    unit_suspected,
    unit_assumed,
    ambient_implausible,
    load_late,
    sensor_pickup,
    sensor_detached,
    temperature_jump,
    saturation,
    sensor_stuck,
    resolution,
    truncation,
    losses_absurd,
    losses_negative,
    losses_below_copper,
    columns_disagree,
    current_amplitude,
    standstill_losses,
    losses_absent,
    losses_of_dc_link,
    no_heating,
    start_not_in_equilibrium,
    cut_while_warm,
    ambient_moving,
    single_step,
    too_short,
    load_of_another,
)
"""Every check, named as the id of its findings, in the order in which they are reported."""

OF_THE_COURSE = (start_not_in_equilibrium, cut_while_warm, ambient_moving, single_step, too_short)
"""Checks of how a test was run: of one that an error will change they say nothing."""

IF_NOTHING_ELSE = (load_of_another,)
"""Checks that say nothing where another finding, but of how a test was run, may be the cause."""

OF_THE_BALANCE = (
    losses_absurd, losses_negative, losses_below_copper, current_amplitude, standstill_losses,
    resistance_coefficient,
)  # fmt: skip
"""Checks of powers and current, which say nothing before it is clear what these are."""

OF_THE_SENSOR = (sensor_detached, temperature_jump, saturation, sensor_stuck)
"""Checks of the winding's reading: what comes first in time is told first."""

MOST_FAULTS = 6
"""Of one sensor; what reads worse is not worth more words."""


def check_record(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Return what is to be said about a record before anything is fitted to it.

    Args:
        record: Any record; it may lack channels, be empty, or be full of NaN.
        motor: The machine under test; says which channels are needed and what the losses are.

    Returns:
        The readers' own findings, then those of each check in the order of `CHECKS`, each carrying
        the name of the record. One of severity `"error"` forbids a fit. What follows from a fault
        that another finding names is not told beside it: after it the record is checked as `mended`
        makes it.
    """
    shapes = {np.shape(column) for column in record.channels.values()}
    # Without a clock, or with columns of different length, no other check has anything to stand on.
    checks = CHECKS if "time_s" in record and len(shapes) == 1 else (missing_channel,)
    if checks is CHECKS and is_sorted_otherwise(record):
        checks = (missing_channel, time_backwards)  # all others follow from it
    findings, name = list(record.findings), record.name
    # Overflow of absurd values yields inf or NaN, and comparisons with those say no.
    with np.errstate(all="ignore"):
        falls = time_backwards(record, motor) if checks is CHECKS else ()
        row = next((one.values.get("sample") for one in falls), None)
        findings = [one for one in findings if not is_told_by_clock(one, record, int(row or 0))]
        for finding in record.findings:
            record, motor = mended(record, motor, finding)
        # one of several sensors is off: what their mean does follows from it
        is_off = any(
            one.id == "sensors_differ" and one.severity == "error"
            for one in record.findings
            if channel_of(one) == "winding_degC"
        )
        for check in checks:
            errors = {one.id for one in findings if one.severity == "error"}
            is_unclear = errors & {"unit_suspected", "losses_of_shaft", "units_temperature"}
            if (
                (errors and check in OF_THE_COURSE)
                or (is_unclear and check in OF_THE_BALANCE)
                or (check in IF_NOTHING_ELSE and not _is_of_the_course(findings))
                or (check in OF_THE_SENSOR and (check is not OF_THE_SENSOR[0] or is_off))
            ):
                continue
            if check in OF_THE_SENSOR:
                found, record = _of_the_sensor(record, motor)
            else:
                found = tuple(check(record, motor))
            findings += found
            for finding in found:
                record, motor = mended(record, motor, finding)
    return tuple(replace(one, test=one.test or name) for one in in_one_line(findings))


def _of_the_sensor(record: Record, motor: Motor) -> tuple[list[Finding], Record]:
    """Return the findings on the winding's reading in the order of time, and the record without."""
    told: list[Finding] = []
    for _ in range(MOST_FAULTS):
        stretches = tuple(frozen_stretches(record, motor))
        looked = Looked(unexplained_movement(record, motor), stretches)
        found = [one for check in OF_THE_SENSOR for one in check(record, motor, looked)]
        found = [one for one in found if not _is_below_a_top(one, told)]
        errors = [one for one in found if mended(record, motor, one)[0] is not record]
        if not errors:
            slowly = () if told else loses_contact(record, motor)
            return [*told, *found, *slowly], record
        # a housing that is off makes a fault of the winding, and no winding one of the housing
        first = min(
            errors,
            key=lambda one: (channel_of(one) == "winding_degC", one.values.get("from_s") or 0.0),
        )
        told.append(first)
        record, _ = mended(record, motor, first)
    return told, record


def _is_of_the_course(findings: Iterable[Finding]) -> bool:
    """Return whether findings tell no more than how a test was run."""
    told = {check.__name__ for check in OF_THE_COURSE}
    return all(one.severity == "note" or one.id in told for one in findings)


def _is_below_a_top(finding: Finding, told: Sequence[Finding]) -> bool:
    """Return whether a winding that is clipped already explains it: a range has one upper end, and
    what stands still below it, while it is reached, is its rounding.
    """
    from_s, to_s = finding.values.get("from_s"), finding.values.get("to_s")
    return finding.id in ("saturation", "sensor_stuck") and any(
        top.id == "saturation" and channel_of(top) == channel_of(finding) == "winding_degC"
        and from_s is not None and to_s is not None
        and from_s <= (top.values["to_s"] or 0.0) and to_s >= (top.values["from_s"] or 0.0)
        for top in told
    )  # fmt: skip


OF_THE_READING = ("sensor_detached", "temperature_jump", "sensor_stuck")
"""Findings after which the winding's readings are left out while they last."""

MOST_JUMPS = 4
"""A sensor that goes and comes back twice jumps so often [1]; more is how it was written down."""

SHOWN = 20
"""Samples that show what a sink was before its sensor failed [1]."""


def mended(record: Record, motor: Motor, finding: Finding) -> tuple[Record, Motor]:
    """Return record and motor as they would be without a fault; as they are where none is known."""
    id, channel = finding.id, channel_of(finding)
    said = {name: 0.0 if value is None else value for name, value in finding.values.items()}
    span = (said.get("from_s", -np.inf), said.get("to_s", np.inf))
    if id == "sensors_differ" and "factor" in said:
        times = np.where(within(record.time_s, [span]), said["factor"] or 1.0, 1.0)
        return record.having({channel: times * record[channel]}), motor
    if id == "losses_of_shaft" and "ratio" in said:
        shaft = recorded_shaft_power(record.channels)
        if shaft is None or said["is_output"]:
            return record.without("losses_W"), motor
        return record.having({"losses_W": record["losses_W"] - np.abs(shaft)}), motor
    if id == "load_stuck" and "from_s" not in said and channel == "torque_Nm":
        return record.without("torque_Nm", "losses_W"), motor
    if id == "shaft_power_disagrees":
        shaft = recorded_shaft_power(record.channels)
        terms = {"shaft_power_offset": 1.0, "shaft_power_gain": shaft}
        if "speed_rpm" in record:
            terms["torque_offset"] = RAD_PER_S_PER_RPM * np.asarray(record["speed_rpm"])
        taken = [n for n in said if n in terms and not prior_of(motor, n, 0.0).is_fixed]
        off = sum(terms[name] * said[name] for name in taken)
        losses = record["losses_W"] - off * within(record.time_s, [span])
        return record.having({"losses_W": losses}), motor
    if id == "resistance_coefficient":
        B = said["coefficient_degC"] or motor.resistance_coefficient_degC
        return record, replace(motor, resistance_coefficient_degC=B)
    if id == "sensor_pickup":
        return without_pickup(record, finding), motor
    if id == "sensor_detached" and "reading_degC" in said:
        return _without_open(record, channel), motor
    if id in OF_THE_READING and channel != "winding_degC":
        return _without(record, channel, said), motor
    if id == "unit_suspected" and finding.severity != "note":
        return read_otherwise(record, motor, finding)
    if finding.severity != "error":
        return record, motor
    if id == "time_backwards" and "sample" in said:
        # as its first part would be read: what is advised goes into the line that parts the test
        first = {name: values[: int(said["sample"])] for name, values in record.channels.items()}
        part_of, row = record.part_of or record.name, record.first_row or 1
        return replace(record, channels=first, part_of=part_of, first_row=row), motor
    if id == "units_temperature":
        degC = (np.asarray(record[channel], dtype=float) - said["zero"]) * (said["factor"] or 1.0)
        return record.having({channel: degC}), motor
    if id == "ambient_implausible" and said.get("mirrored_about_degC"):
        mirrored = 2.0 * said["mirrored_about_degC"] - record["winding_degC"]
        return record.having({"winding_degC": mirrored}), motor
    if id == "ambient_implausible" and said.get("is_exchanged"):
        sink = sink_channel(motor)
        return record.having({sink: record[channel], channel: record[sink]}), motor
    if id == "load_late":
        return move_load(record, -said["late_s"], ""), motor
    if id == "load_stuck" and "from_s" in said:
        return bridge(mask(record, [*record.masks, span], ""), [span], ""), motor
    if id == "load_spike":
        return bridge(record, spike_windows(record, finding), ""), motor
    left_out: list[tuple[float, float]] = []
    if id == "saturation" and channel == "winding_degC":
        winding = np.asarray(record["winding_degC"], dtype=float)
        left_out = windows(record.time_s, np.isclose(winding, said["extreme"]))
    elif id in OF_THE_READING:
        left_out = [(span[0], said.get("until_s", span[1]))]
    if not np.isfinite(left_out).all() or not left_out:
        return record, motor
    return mask(record, [*record.masks, *left_out], ""), motor


def _without_open(record: Record, channel: str) -> Record:
    """Return a record without what an open circuit reads: a sink goes straight over it."""
    spans = open_spans(record, channel)
    if channel not in record or not spans:  # done already
        return record
    if channel == "winding_degC":
        return mask(record, [*record.masks, *spans], "")
    if channel in BODIES:
        return record.without(channel)
    known = np.isfinite(record[channel]) & ~within(record.time_s, spans)
    if not known.any():
        return record
    straight = np.interp(record.time_s, record.time_s[known], record[channel][known])
    return record.having({channel: straight})


def _without(record: Record, channel: str, said: Mapping[str, float]) -> Record:
    """Return a record without a body that is off, or with a sink that stays as it was before."""
    if not said.get("num_lasting", 1.0) or said.get("num_jumps", 1.0) > MOST_JUMPS:
        return record
    if channel in BODIES:
        return record.without(channel)
    sink, before = record[channel], record.time_s <= said["from_s"]
    known = sink[before & np.isfinite(sink)]
    last = np.median(known[-SHOWN:]) if known.size else np.nan
    return record.having({channel: np.where(before, sink, last)})


__all__ = ["CHECKS", "Check", "check_record", "current_scale_unchecked"]
