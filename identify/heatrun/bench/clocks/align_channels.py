"""Putting a drive's channels on the clock of the thermometer, with power conserved."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ..checks.samples import is_measured, median_step, samples
from ..checks.time_axis import GAP_STEPS
from ..record import Record


def joined_channels(
    temperature_record: Record, drive_record: Record, offset_s: float
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Return the channels over the time that both logs cover, and notes on what was done.

    Args:
        temperature_record: Its clock and samples are kept.
        drive_record: Its channels are averaged over the time that each temperature stands for.
        offset_s: What is added to the drive's clock to give the thermometer's [s].

    Returns:
        Channels in their units, each of shape (common,), and sentences for the record's notes.

    Raises:
        InputError: If the logs have no time in common.
    """
    kept = is_measured(temperature_record.time_s)
    time_s = temperature_record.time_s[kept]
    drive_s = samples(drive_record)[0] + offset_s
    # Next to a gap a temperature stands for no more than its usual time.
    half = 0.5 * np.minimum(np.diff(time_s), GAP_STEPS * median_step(time_s))
    begins = time_s - np.concatenate((half[:1], half))
    ends = time_s + np.concatenate((half, half[-1:]))
    common = (begins >= drive_s[0]) & (ends <= drive_s[-1])
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
            channels[name] = _averaged(drive_record, name, offset_s, begins[common], ends[common])
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


def _averaged(
    record: Record, name: str, offset_s: float, begins: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """Means of a drive's channel over intervals of the other clock; NaN where it has none.

    Heat goes with the square of a current, so that rms values average as squares do.
    """
    time_s, values = samples(record, name)
    if time_s.size < 2:
        return np.full(begins.size, np.nan)
    is_rms = name == "phase_current_A"
    values = values**2 if is_rms else values
    steps = np.diff(time_s)
    # A gap is not bridged: the time in it counts as not covered.
    bridged = np.where(steps <= GAP_STEPS * median_step(time_s), steps, 0.0)
    area = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * bridged)))
    cover = np.concatenate(([0.0], np.cumsum(bridged)))
    clock = time_s + offset_s
    covered = np.interp(ends, clock, cover) - np.interp(begins, clock, cover)
    # A thousandth of an interval is float dust of the sums, not a gap.
    is_whole = covered > 0.999 * (ends - begins)
    held = np.interp(ends, clock, area) - np.interp(begins, clock, area)
    means = np.where(is_whole, held / np.where(is_whole, covered, 1.0), np.nan)
    return np.sqrt(means) if is_rms else means
