"""A record without the fault that a finding names, for the checks that come after it.

What a fault brings about is then not told beside it, and what is not its doing is. Nothing that is
fitted is changed: the record stays as it was read.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..record.channels import BODIES
from ..record.derive import RAD_PER_S_PER_RPM, recorded_shaft_power
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.stretch import bridge, mask, windows, within
from .load_spike import spike_windows
from .which_unit import read_otherwise

OF_THE_READING = ("sensor_detached", "temperature_jump", "sensor_stuck")
"""Findings after which the winding's readings are left out while they last."""

MOST_JUMPS = 4
"""A sensor that goes and comes back twice jumps so often [1]; more is how it was written down."""

SHOWN = 20
"""Samples that show what a sink was before its sensor failed [1]."""


def mended(record: Record, motor: Motor, finding: Finding) -> tuple[Record, Motor]:
    """Return record and motor as they would be without a fault; as they are where none is known."""
    if finding.id == "sensors_differ" and "factor" in finding.values:
        channel = finding.where.rpartition(", ")[2]
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
    if finding.id == "shaft_power_disagrees":
        shaft = recorded_shaft_power(record.channels)
        terms = {"shaft_power_offset": 1.0, "shaft_power_gain": shaft}
        terms["torque_offset"] = RAD_PER_S_PER_RPM * np.asarray(record["speed_rpm"])
        found = finding.values
        told = (term * found[name] for name, term in terms.items() if name in found)
        losses = record["losses_W"] - sum(told)
        return replace(record, channels={**record.channels, "losses_W": losses}), motor
    if finding.id == "resistance_coefficient":
        B = finding.values["coefficient_degC"] or motor.resistance_coefficient_degC
        return record, replace(motor, resistance_coefficient_degC=B)
    if finding.id in OF_THE_READING and "winding_degC" not in finding.where:
        return _without(record, finding), motor
    if finding.severity != "error":
        return record, motor
    if finding.id == "time_backwards" and "sample" in finding.values:
        size = int(finding.values["sample"] or 0)
        # as its first part would be read: what is advised goes into the line that parts the test
        first = {name: column[:size] for name, column in record.channels.items()}
        part_of, row = record.part_of or record.name, record.first_row or 1
        return replace(record, channels=first, part_of=part_of, first_row=row), motor
    if finding.id == "unit_suspected":
        return read_otherwise(record, motor, finding)
    if finding.id == "load_spike":
        return bridge(record, spike_windows(record, finding), ""), motor
    if finding.id == "saturation" and "winding_degC" in finding.where:
        winding = np.asarray(record["winding_degC"], dtype=float)
        clipped = np.isclose(winding, finding.values["extreme"] or 0.0)
        return mask(record, [*record.masks, *windows(record.time_s, clipped)], ""), motor
    if finding.id in OF_THE_READING and "winding_degC" in finding.where:
        begin = finding.values.get("from_s")
        until = finding.values.get("until_s", finding.values.get("to_s"))
        if begin is not None and until is not None:
            return mask(record, [*record.masks, (begin, until)], ""), motor
    return record, motor


def _without(record: Record, finding: Finding) -> Record:
    """Return a record without a body that is off, or with a sink that stays as it was before."""
    channel = finding.where.split(", ")[-2]
    num_jumps, num_lasting = (finding.values.get(f"num_{of}", 1.0) for of in ("jumps", "lasting"))
    if not num_lasting or (num_jumps or 0.0) > MOST_JUMPS:
        return record
    rest = {name: column for name, column in record.channels.items() if name != channel}
    if channel not in BODIES:
        sink, before = record[channel], record.time_s <= (finding.values["from_s"] or 0.0)
        known = sink[before & np.isfinite(sink)]
        rest[channel] = np.where(before, sink, np.median(known[-SHOWN:]) if known.size else np.nan)
    return replace(record, channels=rest)
