"""Is everything there that a fit needs: channels, samples, values?"""

from collections.abc import Iterator

import numpy as np

from ..record.channels import READINGS
from ..record.derive import ELECTRICAL
from ..record.motor import Motor
from ..record.raster import between_samples
from ..record.record import Finding, Record, Severity
from ..record.samples import (
    BLOCK_S,
    is_measured,
    median_step,
    needed_channels,
    place,
    runs,
    samples,
)
from ..record.stretch import masked
from .advice import MOST_PARTS, Part, Remedy, mask_line, use_line

MIN_SAMPLES = 20
"""Four parameters, the start temperature and three of the noise are eight unknowns; fewer than two
to three samples for each leave nothing to judge the fit by."""

ISOLATED_SAMPLES = 3
"""Fewer missing samples in a row lose nothing, and none shorter than a block, over which samples
are averaged anyway."""

CONSTANT = ("phase_current_A", "losses_W", "ambient_degC", "coolant_degC")
"""Needed channels that may be the same all the time: no current under a heater, no losses but
copper under direct current, a room that is held."""

MAX_MISSING_SHARE = 0.1
"""Share of missing samples above which even isolated ones are an error [1]: the logger failed."""

KINDS = {
    "block": ("The fit cannot bridge them.", "Export the channel again."),
    "isolated": ("Shorter than a block: readings are left out of its mean, other channels are "
                 "interpolated; the fit is hardly affected.",
                 "Nothing need be done; look at the logger if they grow more."),
    "unneeded": ("The fit does not need this channel.",
                 "Export the channel again if a report is to show it."),
}  # fmt: skip
"""What missing values mean, and what to do."""


def missing_channel(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report each channel that a fit needs and the record lacks, or has at another length."""
    for channel in needed_channels(record, motor):
        if channel not in record:
            have = ", ".join(record.channels) or "none"
            message = f"Channel `{channel}` is needed for a fit; the record has {have}."
            if record.unused:
                message += f" Columns not used: {', '.join(record.unused)}."
        elif np.shape(record[channel]) != np.shape(record.channels.get("time_s", record[channel])):
            size = np.shape(record[channel])
            message = (
                f"`{channel}` has shape {size}, expected that of `time_s`: no fit is possible."
            )
        else:
            continue
        remedy = f'Name its column in the motor file: [columns] {channel} = "column [unit]".'
        if channel in CONSTANT:
            remedy += f" Where it is the same all the time: [constants] {channel} = NUMBER."
        if channel == "winding_degC":
            remedy += " A resistance of the winding in ohm will do, or winding_voltage_V under "
            remedy += "direct current: the temperature follows by R(T)."
        remedy += _beside_a_power(channel, record)
        where = ", ".join(part for part in (record.name, channel) if part)
        yield Finding("missing_channel", "error", message, where, remedy)


def _beside_a_power(channel: str, record: Record) -> str:
    """Return what a record of the power that goes in lacks, empty without one."""
    if channel == "losses_W" and any(way.is_open(record.channels) for way in ELECTRICAL):
        return (
            " The power that goes in is not the loss: the shaft takes its part, behind a DC link "
            "the inverter too. With torque_Nm and speed_rpm beside it heatrun forms the losses; "
            "where the rotor is locked, or the current direct: [constants] speed_rpm = 0."
        )
    if channel == "phase_current_A" and "dc_current_A" in record:
        return " dc_current_A is not the current of a phase."
    return ""


def too_few_samples(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report a record with fewer usable samples than unknowns can be drawn from."""
    needed = needed_channels(record, motor)
    if any(channel not in record for channel in needed):
        return
    usable = samples(record, *needed[1:])[0].size
    if usable >= MIN_SAMPLES:
        return
    total = len(record.time_s)
    yield Finding(
        "too_few_samples",
        "error",
        f"Expected at least {MIN_SAMPLES} samples with all needed channels, got {usable} of "
        f"{total} rows: too few to fit.",
        record.name,
        "Check that the file is complete and its columns are mapped correctly.",
        values={"num_usable": float(usable), "num_rows": float(total)},
    )


def nan_block(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report missing values: isolated ones as notes, or warnings where they are many or an
    instrument's overrange; blocks in a needed channel as errors.

    Infinities and numbers of 1e12 and more count as missing. In channels that no fit needs any
    missing value is a note.
    """
    needed = needed_channels(record, motor)
    step_s = median_step(samples(record)[0])
    for channel, column in record.channels.items():
        values = np.asarray(column, dtype=float)
        missing = ~is_measured(values)
        is_reading = channel in READINGS
        if is_reading:
            missing &= ~masked(record) & ~between_samples(values)
        first, past = runs(missing)
        if first.size == 0:
            continue
        lengths = past - first
        worst = int(np.argmax(lengths))
        longest = int(lengths[worst])
        duration_s = longest * step_s
        share = float(lengths.sum() / len(column))
        is_isolated = longest < ISOLATED_SAMPLES or duration_s < BLOCK_S
        beyond, overrange = values[missing & np.isfinite(values)], ""
        if beyond.size:  # what an analyser writes beyond its range
            overrange = f" {beyond.size} read {beyond[0]:.2g}: the overrange or the error of an "
            overrange += "instrument."
        severity: Severity = "note"
        kind = "isolated" if channel in needed else "unneeded"
        if channel in needed and not (is_isolated and (is_reading or share <= MAX_MISSING_SHARE)):
            severity, kind = "error", "block"
        elif channel in needed and (overrange or share > MAX_MISSING_SHARE):
            severity = "warning"
        is_long = (lengths >= ISOLATED_SAMPLES) & (lengths * step_s >= BLOCK_S)
        advice = _without(record, channel, first[is_long], past[is_long])
        begin, end = int(first[worst]), int(past[worst]) - 1
        meaning, remedy = KINDS[kind]
        from_s, to_s = float(record.time_s[begin]), float(record.time_s[end])
        if channel == "time_s" or not np.isfinite([from_s, to_s]).all():
            where = f"{record.name}, {channel}, samples {begin} to {end}".removeprefix(", ")
        else:
            where = place(record, channel, from_s, to_s)
        yield Finding(
            "nan_block",
            severity,
            f"Expected a number in every sample; {int(lengths.sum())} are missing "
            f"({100.0 * share:.1f} %) in {lengths.size} stretches, the longest of {longest} "
            f"samples ({duration_s:.3g} s).{overrange} {meaning}",
            where,
            Remedy(remedy, *(advice if severity == "error" else ())),
            values={
                "num_missing": float(lengths.sum()),
                "share": share,
                "longest_s": duration_s,
                "first_sample": float(begin),
            },
        )


def _without(record: Record, channel: str, first: np.ndarray, past: np.ndarray) -> tuple[Part, ...]:
    """Return the advice that does without long stretches of missing values; empty if none can.

    Readings of winding and bodies are not compared there, and all else is simulated through; what
    drives the model must be there, so that of other channels the parts between are used.
    """
    time_s = record.time_s
    if not first.size or channel == "time_s" or not np.isfinite(time_s).all():
        return ()
    if channel in READINGS and first[0] > 0:
        windows = list(zip(time_s[first].tolist(), time_s[past - 1].tolist(), strict=True))
        return " Or leave these readings out of the comparison: ", mask_line(record, windows), "."
    begins, ends = (0, *past), (*first, time_s.size)
    parts = [
        (float(time_s[a]), float(time_s[b - 1]))
        for a, b in zip(begins, ends, strict=True)
        if b - a >= MIN_SAMPLES
    ]
    if not 0 < len(parts) <= MOST_PARTS:
        return ()
    return " Or use the parts that have it, each as a test: ", use_line(record, *parts), "."
