"""Quality checks of bench records: one file for each family, one tuple that names them all.

A check takes a record and the motor and yields findings; it changes nothing and raises nothing,
whatever the record holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..record.balance_errors import shaft_power_disagrees
from ..record.motor import Motor
from ..record.record import Finding, Record
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
from .heat import losses_absent, losses_absurd, losses_of_dc_link
from .load_spike import load_spike
from .losses import current_amplitude, losses_below_copper, losses_negative, losses_of_shaft
from .mend import mended
from .presence import missing_channel, nan_block, too_few_samples
from .same_quantity import columns_disagree
from .sensor import sensor_detached, temperature_jump
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
from .which_unit import unit_suspected

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
    nan_block,
    units_temperature,
    losses_of_shaft,
    resistance_coefficient,
    unit_suspected,
    unit_assumed,
    sensor_detached,
    temperature_jump,
    saturation,
    sensor_stuck,
    ambient_implausible,
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
    shaft_power_disagrees,
    no_heating,
    start_not_in_equilibrium,
    cut_while_warm,
    ambient_moving,
    single_step,
    too_short,
)
"""Every check, named as the id of its findings, in the order in which they are reported."""

OF_THE_COURSE = (start_not_in_equilibrium, cut_while_warm, ambient_moving, single_step, too_short)
"""Checks of how a test was run: of one that an error will change they say nothing."""

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
        that another finding names is not told beside it: after it the record is checked as `mend`
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
        for check in checks:
            errors = {one.id for one in findings if one.severity == "error"}
            if errors and check in OF_THE_COURSE:
                continue
            if (
                errors & {"unit_suspected", "losses_of_shaft", "units_temperature"}
                and check in OF_THE_BALANCE
            ):
                continue
            if check in OF_THE_SENSOR and check is not OF_THE_SENSOR[0]:
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
            return [*told, *found], record
        # a housing that is off makes a fault of the winding, and no winding one of the housing
        first = min(
            errors,
            key=lambda one: ("winding_degC" in one.where, one.values.get("from_s") or 0.0),
        )
        told.append(first)
        record, _ = mended(record, motor, first)
    return told, record


def _is_below_a_top(finding: Finding, told: Sequence[Finding]) -> bool:
    """Return whether a winding that is clipped already explains it: a range has one upper end, and
    what stands still below it, while it is reached, is its rounding.
    """
    from_s, to_s = finding.values.get("from_s"), finding.values.get("to_s")
    return finding.id in ("saturation", "sensor_stuck") and any(
        top.id == "saturation" and "winding_degC" in top.where and "winding_degC" in finding.where
        and from_s is not None and to_s is not None
        and from_s <= (top.values["to_s"] or 0.0) and to_s >= (top.values["from_s"] or 0.0)
        for top in told
    )  # fmt: skip


__all__ = ["CHECKS", "Check", "check_record", "current_scale_unchecked"]
