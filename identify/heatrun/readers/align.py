"""Two loggers, one test: find how their clocks stand to each other and join their records.

Temperatures and drive are often logged by two devices that were started by hand. The offset of the
clocks is found by the motor's own thermal response (`heatrun.readers.clock_offset`); half a
second of it is enough to invent a dead time that no motor has, so its uncertainty is part of the
result. The drive is then averaged over the time that each temperature sample stands for, so that
power is conserved; temperatures are never interpolated, since they are what a fit is scored on.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..io.toml_text import table_header
from ..record.channels import CHANNEL
from ..record.raster import means_around
from ..record.record import Finding, Record
from ..record.samples import is_measured, median_step, place, samples
from .clock_offset import (
    Heats,
    OffsetProfile,
    Response,
    ResponseOffset,
    best_rate,
    offset_of_response,
    prepare_response,
    stamp_sd_s,
)
from .multirate import RMS_QUANTITY


def joined_channels(
    temperature_record: Record, drive_record: Record, offset_s: float
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Return the channels, shape (common,), over the time that both logs cover, and notes on it.

    Clock and samples of the temperatures are kept, the channels of the drive are averaged over the
    time that each stands for. The offset [s] is what is added to the drive's clock.

    Raises:
        InputError: If the logs have no time in common.
    """
    kept = is_measured(temperature_record.time_s)
    time_s = temperature_record.time_s[kept]
    drive_s = samples(drive_record)[0] + offset_s
    half_s = 0.5 * median_step(time_s)
    common = (time_s - half_s >= drive_s[0]) & (time_s + half_s <= drive_s[-1])
    if common.sum() < 2:
        raise InputError(
            f"Expected logs that overlap in time; with an offset of {offset_s:+.1f} s the drive "
            f"runs from {drive_s[0]:.1f} to {drive_s[-1]:.1f} s, the temperatures from "
            f"{time_s[0]:.1f} to {time_s[-1]:.1f} s.",
            where=f"{temperature_record.name}, {drive_record.name}",
            remedy="Check that the files belong to one test.",
        )
    channels = {name: values[kept][common] for name, values in temperature_record.channels.items()}
    doubled = [name for name in drive_record.channels if name in channels and name != "time_s"]
    for name in drive_record.channels:
        if name not in channels:
            own_s, values = samples(drive_record, name)
            is_rms = name in CHANNEL and CHANNEL[name].quantity == RMS_QUANTITY
            means = means_around(own_s + offset_s, values, time_s, is_rms=is_rms)
            channels[name] = means[common]
    covered = time_s[common]
    cut_s = (
        covered[0] - time_s[0],
        time_s[-1] - covered[-1],
        max(covered[0] - drive_s[0], 0.0),
        max(drive_s[-1] - covered[-1], 0.0),
    )
    notes = [
        f"Joined with {drive_record.name} at an offset of {offset_s:+.2f} s; its samples are "
        "averaged over the time that each temperature stands for (currents as mean squares).",
        f"Only the common {covered[-1] - covered[0]:.1f} s are kept: the temperatures "
        f"lose {cut_s[0]:.1f} s at the start and {cut_s[1]:.1f} s at the end, the drive "
        f"{cut_s[2]:.1f} s and {cut_s[3]:.1f} s.",
    ]
    if doubled:
        notes.append(f"Taken from {temperature_record.name}, not the drive: {', '.join(doubled)}.")
    if (dropped := int(np.sum(~kept))) > 0:
        notes.append(f"{dropped} temperature samples without a time are left out.")
    return channels, tuple(notes)


METHOD = "thermal response of the winding to the drive's power"

MIN_BLOCKS = 60
"""Seven gains and lags, four of the autoregression, and five times as many to judge by."""

OFF_SHARE = 0.25
"""A log whose first or last sample is below this share of its load [1] begins or ends with it."""

MAX_GRID = 200_000
"""Samples of the drive on an even grid: 10 Hz for five hours."""

MAX_SD_S = 1.0
"""One second is 1 % of a winding's time constant, and moves Ceq_w by about as much."""

LOST_SD_S = 10.0
"""At a tenth of a winding's time constant the winding's capacity is no longer determined."""

MIN_GAIN = 10.0
"""Log likelihood over a drive without influence: three gains more explain 4 or 5 by chance. The
same for a second clock rate, of which a dozen are tried at every offset."""


@dataclass(frozen=True)
class Alignment:
    """How the clocks of two loggers stand to each other."""

    offset_s: float  # What is added to the drive's clock to give the thermometer's [s].
    # Standard uncertainty of the offset [s]: of the fit, and of which part of its interval a logger
    # stamps.
    sd_s: float
    fit_sd_s: float  # The part of the fit alone [s].
    interval_95_s: tuple[float, float]  # Interval that holds the offset with 95 % [s].
    # Share of the temperature's variance that the drive explains beyond decays [1].
    explained: float
    method: str  # How it was found.
    findings: tuple[Finding, ...]  # Doubts about it, and a note with its figures.


def join(
    temperature_record: Record,
    drive_record: Record,
    *,
    max_offset_s: float = 60.0,
    offset_s: float | None = None,
) -> tuple[Record, Alignment]:
    """Join the record of a thermometer and that of a drive to one on the thermometer's clock.

    A drive whose log begins or ends below a quarter of its load is taken as off before or after it.
    Both clocks are taken to run at one rate; where a rate that is off by per cents fits much
    better, that is a finding, since then rows are missing or the rate was declared wrong.

    Args:
        temperature_record: Holds `winding_degC`; its time stays as it is.
        drive_record: Holds `losses_W`, a power, currents, or DC voltage and current.
        max_offset_s: Largest offset in both directions [s].
        offset_s: An offset known otherwise [s], taken as exact; nothing is searched then.

    Returns:
        The joined record over the time that both cover, and the alignment. Findings of severity
        `"error"` in both say that the offset is not to be trusted.

    Raises:
        InputError: If a channel is missing, a clock runs backwards, or the logs do not overlap.
    """
    for record in (temperature_record, drive_record):
        _require_clock(record)
    if offset_s is None:
        alignment = find_alignment(temperature_record, drive_record, max_offset_s=max_offset_s)
    else:
        exact = (offset_s, offset_s)
        alignment = Alignment(offset_s, 0.0, 0.0, exact, np.nan, "given", ())
    channels, notes = joined_channels(temperature_record, drive_record, alignment.offset_s)
    dated = temperature_record if temperature_record.start else drive_record
    joined = Record(
        name=temperature_record.name,
        channels=channels,
        sources=temperature_record.sources + drive_record.sources,
        notes=(*temperature_record.notes, *drive_record.notes, *notes),
        findings=(*temperature_record.findings, *drive_record.findings, *alignment.findings),
        unused=temperature_record.unused + drive_record.unused,
        mapping=temperature_record.mapping + drive_record.mapping,
        decided=temperature_record.decided | drive_record.decided,
        start=dated.start,
        start_from=dated.start_from,
    )
    return joined, alignment


def find_alignment(
    temperature_record: Record, drive_record: Record, *, max_offset_s: float = 60.0
) -> Alignment:
    """Find the offset of two clocks by the thermal response of the winding; as `join`."""
    time_s, winding = samples(temperature_record, "winding_degC")
    if time_s.size < MIN_BLOCKS:
        raise InputError(
            f"Expected at least {MIN_BLOCKS} samples of `winding_degC` to align by, got "
            f"{time_s.size}.",
            where=temperature_record.name,
            remedy="Check that the column is mapped and the file complete.",
        )
    heats = _heats(drive_record)
    response = prepare_response(time_s, winding, heats, max_offset_s)
    if response.middle_s.size < MIN_BLOCKS:
        raise InputError(
            f"Expected the logs to overlap at every offset up to {max_offset_s:.0f} s; "
            f"the temperatures run from {time_s[0]:.1f} to {time_s[-1]:.1f} s, the drive from "
            f"{heats.start_s:.1f} to {heats.end_s:.1f} s, which leaves "
            f"{response.middle_s.size} usable blocks.",
            where=f"{temperature_record.name}, {drive_record.name}",
            remedy="Check that both belong to one test; or state the offset: "
            f"{table_header('tests', temperature_record.name)} load_offset = SECONDS in the motor "
            "file.",
        )
    found = offset_of_response(response, max_offset_s)
    profile = found.profile
    stamp_s = stamp_sd_s(median_step(time_s), median_step(samples(drive_record)[0]))
    sd_s = float(np.hypot(profile.sd_s, stamp_s))
    findings = _findings(temperature_record, drive_record, response, found, sd_s, max_offset_s)
    return Alignment(
        offset_s=profile.mean_s,
        sd_s=sd_s,
        fit_sd_s=profile.sd_s,
        interval_95_s=_interval(profile, stamp_s),
        explained=found.explained,
        method=METHOD,
        findings=tuple(findings),
    )


def _interval(profile: OffsetProfile, stamp_sd_s: float) -> tuple[float, float]:
    """Quantiles of the likelihood, widened on each side by the doubt about the stamps."""
    mass = np.cumsum(np.exp(profile.log_likelihood))
    low, high = np.interp([0.025, 0.975], mass / mass[-1], profile.offset_s)
    centre, stamp = profile.mean_s, 1.96 * stamp_sd_s
    return (
        float(centre - np.hypot(centre - low, stamp)),
        float(centre + np.hypot(high - centre, stamp)),
    )


def _findings(
    temperature_record: Record,
    drive_record: Record,
    response: Response,
    offset: ResponseOffset,
    sd_s: float,
    max_offset_s: float,
) -> Iterator[Finding]:
    """Yield the figures of the alignment as a note, and what casts doubt on it."""
    name = temperature_record.name
    where = f"{name}, {drive_record.name}"
    profile = offset.profile
    values = {
        "offset_s": profile.mean_s,
        "sd_s": sd_s,
        "explained": offset.explained,
        "log_likelihood_gain": offset.gain,
        "num_effective": offset.num_effective,
    }
    figures = (
        f"The drive's clock plus {profile.mean_s:.2f} s is the thermometer's (standard uncertainty "
        f"{sd_s:.2f} s, by the {METHOD})."
    )
    yield Finding("alignment", "note", figures, where, test=name, values=values)
    doubt, severity = "", "error"
    if offset.gain < MIN_GAIN:
        doubt = "the temperature does not follow the drive"
    elif profile.is_at_edge:
        doubt = f"the best offset may lie beyond the {max_offset_s:.0f} s searched"
    elif sd_s > MAX_SD_S:
        severity = "error" if sd_s > LOST_SD_S else "warning"
        doubt = f"several offsets fit, with a standard uncertainty of {sd_s:.1f} s"
    if doubt:
        yield Finding(
            "alignment_uncertain",
            severity,
            f"Expected a clock offset known to {MAX_SD_S:.0f} s; {doubt}.",
            where,
            f"State it: {table_header('tests', name)} load_offset = SECONDS in the motor file. "
            "Or record a step of the load in both logs.",
            name,
            values,
        )
    rate, gain = best_rate(response, max_offset_s)
    if gain > MIN_GAIN:
        yield Finding(
            "alignment_rate",
            "error",
            f"Expected clocks of equal rate; with {rate:.2f} s of the thermometer's clock for "
            "each second of the drive's, the thermal response fits better (log likelihood "
            f"+{gain:.0f}).",
            where,
            "Check whether rows of the drive's log are missing, or its rate is misstated.",
            name,
            {"rate": rate, "log_likelihood_gain": gain},
        )


def _require_clock(record: Record) -> None:
    """Refuse a clock that does not run forwards; which part of it is right cannot be told."""
    time_s = record.time_s[is_measured(record.time_s)]
    back = time_s[:-1][np.diff(time_s) < 0.0]
    if back.size:
        came, remedy = f"it falls at {back[0]:.2f} s", "Split the file there."
        where = place(record, "time_s", float(back[0]))
    elif time_s.size < 2:
        came, remedy = f"it has {time_s.size} samples", "Check that the file is complete."
        where = record.name
    else:
        return
    problem = f"Expected a clock that runs forwards; {came}."
    raise InputError(problem, where=where, remedy=remedy)


def _heats(record: Record) -> Heats:
    """What the drive's log says about heat: its power, and the square of the current beside it."""
    time_s, *candidates = _first_power(record)
    step_s = max(median_step(time_s), float(np.ptp(time_s)) / MAX_GRID)
    grid_s = np.arange(time_s[0], time_s[-1] + 0.5 * step_s, step_s)
    power = candidates[0] / float(np.max(np.abs(candidates[0])))
    load = OFF_SHARE * float(np.quantile(power, 0.9))
    values = [
        np.interp(grid_s, time_s, heat) / float(np.max(np.abs(heat)))
        for heat in candidates
        if np.ptp(heat) > 0.0
    ]
    return Heats(
        float(grid_s[0]),
        step_s,
        np.stack(values),
        is_off_before=bool(power[0] < load),
        is_off_after=bool(power[-1] < load),
    )


def _first_power(record: Record) -> tuple[np.ndarray, ...]:
    """Time, the best power in the log, and the current squared where it was recorded."""
    for names in (
        ("losses_W",),
        ("electrical_power_W",),
        ("dc_power_W",),
        ("dc_voltage_V", "dc_current_A"),
        ("phase_current_A", "phase_current_A"),
        ("dc_current_A", "dc_current_A"),
    ):
        time_s, *factors = samples(record, *names)
        power = np.prod(factors, axis=0)
        if time_s.size < 2 or not np.ptp(power) > 0.0:
            continue
        both_s, current = samples(record, "phase_current_A")
        # A column of zeros is a current that was not recorded.
        if both_s.size < 2 or not np.ptp(current) > 0.0 or names[0] == "phase_current_A":
            return time_s, power
        return time_s, power, np.interp(time_s, both_s, current**2)
    have = ", ".join(record.channels)
    raise InputError(
        f"Expected a power or a current that changes, to align by; the channels are {have}.",
        where=record.name,
        remedy="Map `losses_W`, `dc_power_W` or `phase_current_A` in the motor file.",
    )
