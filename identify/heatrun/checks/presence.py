"""Is everything there that a fit needs: channels, samples, values, and a load that excites?

A test excites what a fit is to find with more than one level, and for long enough.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..record.channels import BODIES
from ..record.derive import ELECTRICAL
from ..record.motor import Motor
from ..record.raster import between_samples
from ..record.record import Finding, Record, Severity
from ..record.samples import (
    BLOCK_S,
    block_means,
    is_loaded,
    is_measured,
    lead_in,
    median_step,
    needed_channels,
    place,
    runs,
    samples,
    with_all_heat,
)
from ..record.stretch import masked
from .advice import MOST_WINDOWS, Part, Remedy, mask_line, use_line
from .course import settling_constants
from .quick_fit import quick_fit

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

MEANING: dict[Severity, str] = {
    "error": "The fit cannot bridge them.",
    "warning": "Shorter than a block: readings are left out of its mean, other channels are "
    "interpolated; the fit is hardly affected.",
    "note": "The fit does not need this channel.",
}
REMEDY: dict[Severity, str] = {
    "error": "Export the channel again.",
    "warning": "Nothing need be done; look at the logger if they grow more.",
    "note": "Export the channel again if a report is to show it.",
}


def missing_channel(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report each channel that a fit needs and the record does not have, or has at another
    length.
    """
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
    """Report missing values: isolated ones as warnings, blocks in a needed channel as errors.

    Infinities and numbers of 1e12 and more count as missing. In channels that no fit needs any
    missing value is a note.
    """
    needed = needed_channels(record, motor)
    step_s = median_step(samples(record)[0])
    for channel, column in record.channels.items():
        values = np.asarray(column, dtype=float)
        missing = ~is_measured(values)
        is_reading = channel == "winding_degC" or channel in BODIES
        if is_reading:
            missing &= ~masked(record) & ~between_samples(np.asarray(column, dtype=float))
        first, past = runs(missing)
        if first.size == 0:
            continue
        lengths = past - first
        worst = int(np.argmax(lengths))
        longest = int(lengths[worst])
        duration_s = longest * step_s
        share = float(lengths.sum() / len(column))
        is_isolated = longest < ISOLATED_SAMPLES or duration_s < BLOCK_S
        severity: Severity
        if channel not in needed:
            severity = "note"
        elif is_isolated and (is_reading or share <= MAX_MISSING_SHARE):
            severity = "warning"
        else:
            severity = "error"
        is_long = (lengths >= ISOLATED_SAMPLES) & (lengths * step_s >= BLOCK_S)
        advice = _without(record, channel, first[is_long], past[is_long])
        begin, end = int(first[worst]), int(past[worst]) - 1
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
            f"samples ({duration_s:.3g} s).{_overrange(values[missing])} {MEANING[severity]}",
            where,
            Remedy(REMEDY[severity], *(advice if severity == "error" else ())),
            values={
                "num_missing": float(lengths.sum()),
                "share": share,
                "longest_s": duration_s,
                "first_sample": float(begin),
            },
        )


def _overrange(missing: np.ndarray) -> str:
    """Return what an analyser writes beyond its range, empty where nothing of it stands there."""
    beyond = missing[np.isfinite(missing)]
    if not beyond.size:
        return ""
    return f" {beyond.size} read {beyond[0]:.2g}: the overrange or the error of an instrument."


def _without(record: Record, channel: str, first: np.ndarray, past: np.ndarray) -> tuple[Part, ...]:
    """Return the advice that does without long stretches of missing values; empty if none can.

    Readings of winding and bodies are not compared there, and all else is simulated through; what
    drives the model must be there, so that of other channels the parts between are used.
    """
    time_s = record.time_s
    if not first.size or channel == "time_s" or not np.isfinite(time_s).all():
        return ()
    if (channel == "winding_degC" or channel in BODIES) and first[0] > 0:
        windows = list(zip(time_s[first].tolist(), time_s[past - 1].tolist(), strict=True))
        return " Or leave these readings out of the comparison: ", mask_line(record, windows), "."
    begins, ends = (0, *past), (*first, time_s.size)
    parts = [
        (float(time_s[a]), float(time_s[b - 1]))
        for a, b in zip(begins, ends, strict=True)
        if b - a >= MIN_SAMPLES
    ]
    if not 0 < len(parts) <= MOST_WINDOWS:
        return ()
    return " Or use the parts that have it, each as a test: ", use_line(record, *parts), "."


LEVEL_S = 30.0
"""Levels are means over 30 s, a third of a winding's time constant: faster changes average out."""

SAME_LEVEL = 0.1
"""Levels within this share of the largest are one [1]: 10 % in current is 20 % in copper loss, the
least that leaves a second transient above the noise."""

LOSS_STEP = 0.2
"""A change of the losses from block to block by this share [1] is a step of the operating point,
not copper growing with temperature (0.4 %/K, some ten kelvin in 30 s at most)."""

FEW_CONSTANTS = 0.75
"""Below this many slow time constants the warning comes. At one, the reference motor's Ceq_sr and
Req_sr come out to 9 and 10 %; the quick fit's constant itself is good to a quarter."""

UNKNOWN_LOG_SD = 0.4
"""A slow constant known to a factor of 1.5 only has not been seen."""

APART = 5.0
"""Factor between the two time constants of a machine at least [1]: a winding and its iron."""

ENOUGH_CONSTANTS = 2.0
"""From two on, both are good to 4 % and nothing is said."""

TWO_HOURS_S = 7200.0
KNOWN_CONSTANTS = (1.0, 2.0, 3.0)
KNOWN_SD_CEQ_SR = (0.09, 0.036, 0.025)
KNOWN_SD_REQ_SR = (0.10, 0.012, 0.008)
"""Relative sd [1] against the length of the test in slow time constants, reference motor at 1
degC."""


def single_step(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Warn if what heats holds one level from the moment the load comes to the end.

    Idle time before the load is no second level, since nothing is warm; idle time after it is one.
    Current and speed hold theirs while the copper loss grows; steps of the losses count besides.
    """
    time_s, losses = samples(with_all_heat(record, motor), "losses_W")
    loaded = is_loaded(losses)
    if not loaded.any():
        return ()
    from_s, to_s = float(time_s[np.argmax(loaded)]), float(time_s[-1])

    def levels(times: np.ndarray, values: np.ndarray) -> np.ndarray:
        later = times >= from_s
        # the first and last block may be cut by an edge of the load
        return block_means(times[later], LEVEL_S, values[later])[1][1:-1]

    powers = levels(time_s, losses)
    held = [levels(*samples(record, name)) for name in ("phase_current_A", "speed_rpm")]
    if powers.size < 2 or np.any(np.abs(np.diff(powers)) > LOSS_STEP * np.max(np.abs(powers))):
        return ()
    if any(np.ptp(each) > SAME_LEVEL * np.max(np.abs(each)) for each in held if each.size):
        return ()
    has_current = held[0].size > 0 and bool(np.any(held[0]))
    channel, what, unit = (
        ("phase_current_A", "current is", "A") if has_current else ("losses_W", "losses are", "W")
    )
    level = float(np.mean(held[0] if has_current else powers))
    return (
        Finding(
            "single_step",
            "warning",
            f"Expected several levels of load; the {what} {level:.4g} {unit} throughout. "
            "A single load step hardly separates winding from stator parameters, and missing "
            "effects cannot be distinguished.",
            place(record, channel, from_s, to_s),
            "Add a cool-down, or steps in which current and speed change independently.",
            values={channel.removeprefix("phase_"): level, "from_s": from_s, "to_s": to_s},
        ),
    )


def too_short(record: Record, motor: Motor) -> Iterator[Finding]:
    """Compare the length of the test with the slow time constant that the record itself shows.

    A warning below three quarters of a time constant, or where the constant stays unknown to a
    factor of one and a half; a note below two. A record that settles shows a constant that is short
    against it, so nothing is said.
    """
    if settling_constants(record, motor) >= ENOUGH_CONSTANTS:
        return
    fit = quick_fit(record, motor)
    if fit is None:
        return
    time_s, losses = samples(with_all_heat(record, motor), "losses_W")
    from_s, to_s = float(time_s[max(lead_in(time_s, losses) - 1, 0)]), float(time_s[-1])
    constants = (to_s - from_s) / fit.tau_s
    low, high = fit.tau_s * np.exp([-2.0 * fit.log_sd, 2.0 * fit.log_sd])
    fast_s = fit.taus_s[0]
    # that of a body that the test does not see may be any, of one constant two are made
    is_one = fit.tau_s < APART * fast_s and fit.log_sd > 0.5 * UNKNOWN_LOG_SD
    is_open = fit.log_sd > UNKNOWN_LOG_SD and high > to_s - from_s
    is_open |= is_one and constants < max(KNOWN_CONSTANTS)
    is_short = constants < FEW_CONSTANTS or fit.log_sd > UNKNOWN_LOG_SD or is_open
    if constants >= ENOUGH_CONSTANTS and not is_short:
        return
    lasts = f"{(to_s - from_s) / 60.0:.0f} min"
    if constants >= ENOUGH_CONSTANTS or is_open:
        between = f"from {low:.0f} s on" if is_one else f"between {low:.0f} and {high:.0f} s"
        message = (
            f"Expected a slow time constant that the record shows; in {lasts} it stays open "
            f"{between}."
        )
        remedy = "Hold one load until the temperature settles, and record the cool-down."
    else:
        now, later = expected_sd(constants), expected_sd(TWO_HOURS_S / fit.tau_s)
        at_least = "more than " if constants < KNOWN_CONSTANTS[0] else "about "
        message = (
            f"Expected at least two slow time constants; the {lasts} of test are "
            f"{constants:.2g} time constants of about {fit.tau_s:.0f} s. The standard "
            f"uncertainties of Ceq_sr and Req_sr will be {at_least}{100.0 * now[0]:.0f} % and "
            f"{100.0 * now[1]:.0f} %; "
            f"after 2 h about {100.0 * later[0]:.1f} % and {100.0 * later[1]:.1f} %."
        )
        remedy = "Extend the load until the temperature settles, and record the cool-down."
    yield Finding(
        "too_short",
        "warning" if is_short else "note",
        message,
        place(record, "winding_degC", from_s, to_s),
        remedy,
        values={
            "duration_s": to_s - from_s,
            "time_constants": constants,
            "tau_s": fit.tau_s,
            "tau_log_sd": fit.log_sd,
            **(
                {"fast_from_s": fast_s, "fast_to_s": fit.tau_s if is_one else fast_s}
                if is_open
                else {}
            ),
        },
    )


def expected_sd(constants: float) -> tuple[float, float]:
    """Return relative sd of Ceq_sr and Req_sr [1] for a test of so many slow time constants.

    Interpolated between the known lengths; held at the ends, where it is a bound and no more.
    """
    return (
        float(np.interp(constants, KNOWN_CONSTANTS, KNOWN_SD_CEQ_SR)),
        float(np.interp(constants, KNOWN_CONSTANTS, KNOWN_SD_REQ_SR)),
    )
