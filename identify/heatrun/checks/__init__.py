"""Quality checks of bench records: one file for each family, one tuple that names them all.

A check takes a record and the motor and yields findings; it changes nothing and raises nothing,
whatever the record holds.

Where a finding names a fault, the checks that come after it see the record without it: what a fault
brings about is then not told beside it, and what is not its doing is. Nothing that is fitted is
changed: the record stays as it was read.
"""

from collections.abc import Callable, Iterable, Sequence
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
from .frozen import Looked, saturation, sensor_stuck
from .heat import load_of_another, losses_absent, losses_absurd, losses_of_dc_link
from .load_held import load_stuck
from .load_moments import load_late
from .load_spike import load_spike, spike_windows
from .losses import current_amplitude, losses_below_copper, losses_negative, losses_of_shaft
from .presence import missing_channel, nan_block, too_few_samples
from .same_quantity import columns_disagree
from .sensor import (
    loses_contact,
    open_spans,
    sensor_detached,
    sensor_pickup,
    temperature_jump,
)
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
            if errors and check in OF_THE_COURSE:
                continue
            if check in IF_NOTHING_ELSE and not _is_of_the_course(findings):
                continue
            if (
                errors & {"unit_suspected", "losses_of_shaft", "units_temperature"}
                and check in OF_THE_BALANCE
            ):
                continue
            if check in OF_THE_SENSOR and (check is not OF_THE_SENSOR[0] or is_off):
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
        looked = Looked.at(record, motor)
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
    if finding.id == "sensors_differ" and "factor" in finding.values:
        channel = channel_of(finding)
        values = np.array(record[channel], dtype=float)
        from_s, to_s = finding.values.get("from_s"), finding.values.get("to_s")
        span = (-np.inf if from_s is None else from_s, np.inf if to_s is None else to_s)
        values[within(record.time_s, [span])] *= finding.values["factor"] or 1.0
        return replace(record, channels={**record.channels, channel: values}), motor
    if finding.id == "losses_of_shaft" and "ratio" in finding.values:
        rest = {name: column for name, column in record.channels.items() if name != "losses_W"}
        shaft = recorded_shaft_power(rest)
        if shaft is not None and not finding.values["is_output"]:
            rest["losses_W"] = record["losses_W"] - np.abs(shaft)
        return replace(record, channels=rest), motor
    if (
        finding.id == "load_stuck"
        and "from_s" not in finding.values
        and channel_of(finding) == "torque_Nm"
    ):
        rest = {n: v for n, v in record.channels.items() if n not in ("torque_Nm", "losses_W")}
        return replace(record, channels=rest), motor
    if finding.id == "shaft_power_disagrees":
        shaft = recorded_shaft_power(record.channels)
        terms = {"shaft_power_offset": 1.0, "shaft_power_gain": shaft}
        if "speed_rpm" in record:
            terms["torque_offset"] = RAD_PER_S_PER_RPM * np.asarray(record["speed_rpm"])
        taken = [n for n in finding.values if n in terms and not prior_of(motor, n, 0.0).is_fixed]
        told = (terms[name] * finding.values[name] for name in taken)
        from_s, to_s = (finding.values.get(name) for name in ("from_s", "to_s"))
        lasts = within(record.time_s, [(from_s or -np.inf, np.inf if to_s is None else to_s)])
        losses = record["losses_W"] - sum(told) * lasts
        return replace(record, channels={**record.channels, "losses_W": losses}), motor
    if finding.id == "resistance_coefficient":
        B = finding.values["coefficient_degC"] or motor.resistance_coefficient_degC
        return record, replace(motor, resistance_coefficient_degC=B)
    if finding.id == "sensor_pickup":
        return without_pickup(record, finding), motor
    if finding.id == "sensor_detached" and "reading_degC" in finding.values:
        return _without_open(record, channel_of(finding)), motor
    if finding.id in OF_THE_READING and channel_of(finding) != "winding_degC":
        return _without(record, finding), motor
    if finding.id == "unit_suspected" and finding.severity != "note":
        return read_otherwise(record, motor, finding)
    if finding.severity != "error":
        return record, motor
    if finding.id == "time_backwards" and "sample" in finding.values:
        size = int(finding.values["sample"] or 0)
        # as its first part would be read: what is advised goes into the line that parts the test
        first = {name: column[:size] for name, column in record.channels.items()}
        part_of, row = record.part_of or record.name, record.first_row or 1
        return replace(record, channels=first, part_of=part_of, first_row=row), motor
    if finding.id == "units_temperature":
        channel, values = channel_of(finding), finding.values
        zero, factor = values["zero"] or 0.0, values["factor"] or 1.0
        degC = (np.asarray(record[channel], dtype=float) - zero) * factor
        return replace(record, channels={**record.channels, channel: degC}), motor
    if finding.id == "ambient_implausible" and finding.values.get("mirrored_about_degC"):
        mirrored = 2.0 * (finding.values["mirrored_about_degC"] or 0.0) - record["winding_degC"]
        return replace(record, channels={**record.channels, "winding_degC": mirrored}), motor
    if finding.id == "ambient_implausible" and finding.values.get("is_exchanged"):
        body, sink = channel_of(finding), sink_channel(motor)
        pair = {sink: record[body], body: record[sink]}
        return replace(record, channels={**record.channels, **pair}), motor
    if finding.id == "load_late":
        return move_load(record, -(finding.values["late_s"] or 0.0), ""), motor
    if finding.id == "load_stuck" and "from_s" in finding.values:
        held = (finding.values["from_s"] or 0.0, finding.values["to_s"] or 0.0)
        return bridge(mask(record, [*record.masks, held], ""), [held], ""), motor
    if finding.id == "load_spike":
        return bridge(record, spike_windows(record, finding), ""), motor
    if finding.id == "saturation" and channel_of(finding) == "winding_degC":
        winding = np.asarray(record["winding_degC"], dtype=float)
        clipped = np.isclose(winding, finding.values["extreme"] or 0.0)
        return mask(record, [*record.masks, *windows(record.time_s, clipped)], ""), motor
    if finding.id in OF_THE_READING and channel_of(finding) == "winding_degC":
        begin = finding.values.get("from_s")
        until = finding.values.get("until_s", finding.values.get("to_s"))
        if begin is not None and until is not None:
            return mask(record, [*record.masks, (begin, until)], ""), motor
    return record, motor


def _without_open(record: Record, channel: str) -> Record:
    """Return a record without what an open circuit reads: a sink goes straight over it."""
    spans = open_spans(record, channel)
    if channel not in record or not spans:  # done already
        return record
    if channel == "winding_degC":
        return mask(record, [*record.masks, *spans], "")
    rest = {name: column for name, column in record.channels.items() if name != channel}
    if channel in BODIES:
        return replace(record, channels=rest)
    known = np.isfinite(record[channel]) & ~within(record.time_s, spans)
    if not known.any():
        return record
    rest[channel] = np.interp(record.time_s, record.time_s[known], record[channel][known])
    return replace(record, channels=rest)


def _without(record: Record, finding: Finding) -> Record:
    """Return a record without a body that is off, or with a sink that stays as it was before."""
    channel = channel_of(finding)
    num_jumps, num_lasting = (finding.values.get(f"num_{of}", 1.0) for of in ("jumps", "lasting"))
    if not num_lasting or (num_jumps or 0.0) > MOST_JUMPS:
        return record
    rest = {name: column for name, column in record.channels.items() if name != channel}
    if channel not in BODIES:
        sink, before = record[channel], record.time_s <= (finding.values["from_s"] or 0.0)
        known = sink[before & np.isfinite(sink)]
        rest[channel] = np.where(before, sink, np.median(known[-SHOWN:]) if known.size else np.nan)
    return replace(record, channels=rest)


__all__ = ["CHECKS", "Check", "check_record", "current_scale_unchecked"]
