"""Channels by the times that they share, and their way onto common times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..record.channels import CHANNEL
from ..record.raster import means_around, median_step_s, raster, require_increasing
from ..record.record import Finding
from .measurement import Series

RMS_QUANTITY = "phase current"
"""Averaged as root mean square: it is the square that heats."""

STEP_SLACK = 1.001
"""Steps that differ by the tolerance of a clock, one in a thousand, count as equal."""


@dataclass(frozen=True)
class Axis:
    """Columns that share their times.

    Attributes:
        time_s: Times [s], shape (time,); numbers of the samples where the file gives no times.
        values: Column name to samples, shape (time,).
        has_times: The file gives times.
    """

    time_s: np.ndarray
    values: dict[str, np.ndarray]
    has_times: bool = True


def axes_of(series: Mapping[str, Series], where: str) -> list[Axis]:
    """Return series, by the name of their column, by their times, in the order in which they came.

    Raises:
        InputError: If some have times and others not, lengths differ without times, or there is
            no sample.
    """
    untimed = {name: one.values for name, one in series.items() if one.time_s is None}
    if untimed and len(untimed) < len(series):
        timed = [name for name in series if name not in untimed]
        raise InputError(
            f"Channel '{next(iter(untimed))}' has no times, channel '{timed[0]}' has.",
            where=where,
            remedy="Record all channels with their times, or map only those that have them.",
        )
    if untimed:
        sizes = {name: values.size for name, values in untimed.items()}
        if len(set(sizes.values())) > 1:
            held = ", ".join(f"'{name}' {size}" for name, size in sizes.items())
            raise InputError(
                f"Channels without times must be of one length; the samples are: {held}.",
                where=where,
                remedy="Record the channels with their times.",
            )
        return [Axis(np.arange(next(iter(sizes.values())), dtype=float), untimed, False)]
    axes: list[Axis] = []
    for name, one in series.items():
        time_s = one.time_s
        assert time_s is not None  # untimed channels are dealt with above
        for axis in axes:
            if axis.time_s is time_s or np.array_equal(axis.time_s, time_s, equal_nan=True):
                axis.values[name] = one.values
                break
        else:
            axes.append(Axis(time_s, {name: one.values}))
    for axis in axes:
        if axis.time_s.size == 0:
            raise InputError(
                "Expected at least one sample, found none.",
                where=f"{where}, channel '{next(iter(axis.values))}'",
                remedy="Check that the recording contains the samples.",
            )
    return axes


def common_times(
    axes: Sequence[Axis], lead: Axis | None, raster_s: float | None, where: str
) -> tuple[np.ndarray, Axis | None]:
    """Return the common times [s], shape (time,), and the axis whose own they are, if any.

    They are those of the axis whose samples must not be multiplied, the slowest where none leads;
    or at steps of `raster_s` [s].

    Raises:
        InputError: If times do not increase, or the step is finer than the leading axis.
    """
    for axis in axes:
        require_increasing(axis.time_s, f"{where}, channel '{next(iter(axis.values))}'")
    lead = lead or max(axes, key=lambda axis: median_step_s(axis.time_s))
    if raster_s is None:
        return lead.time_s, lead
    step_s = median_step_s(lead.time_s)
    if raster_s * STEP_SLACK < step_s:
        raise InputError(
            f"raster_s = {raster_s:g} s is finer than the {step_s:g} s between the samples of "
            f"'{next(iter(lead.values))}'.",
            where=where,
            remedy=f"Give raster_s = {step_s:g} or more, or leave it out.",
        )
    return raster(lead.time_s, raster_s), None


def averaged(
    axes: Sequence[Axis],
    own: Sequence[Mapping[str, np.ndarray]],
    time_s: np.ndarray,
    base: Axis | None,
    where: str,
) -> tuple[dict[str, np.ndarray], tuple[Finding, ...]]:
    """Return all channels at the common times, and what the averaging could not cover.

    `own` are the channels of each axis in canonical units; those of `base`, the axis that has the
    common times if one has, stay as they are.
    """
    channels: dict[str, np.ndarray] = {}
    findings = []
    for axis, held in zip(axes, own, strict=True):
        if axis is base:
            channels |= held
            continue
        if median_step_s(axis.time_s) > STEP_SLACK * median_step_s(time_s):
            findings.append(_joined(axis, held, time_s, where))
        for key, values in held.items():
            is_rms = CHANNEL[key].quantity == RMS_QUANTITY
            channels[key] = means_around(axis.time_s, values, time_s, is_rms=is_rms)
            if np.isnan(channels[key]).any():
                findings.append(_not_covered(key, channels[key], time_s, where))
    return channels, tuple(findings)


def _joined(axis: Axis, held: Mapping[str, np.ndarray], time_s: np.ndarray, where: str) -> Finding:
    step_s = median_step_s(axis.time_s)
    return Finding(
        id="raster_joined",
        severity="note",
        message=f"The samples are {step_s:g} s apart, the times of the record "
        f"{median_step_s(time_s):g} s: values in between are interpolated linearly.",
        where=f"{where}, {', '.join(held)}",
        remedy=f"Give raster_s = {step_s:g} in [motor] to keep to the samples.",
        values={"step_s": step_s},
    )


def _not_covered(key: str, values: np.ndarray, time_s: np.ndarray, where: str) -> Finding:
    missing = np.isnan(values)
    count, first_s = int(missing.sum()), float(time_s[missing][0])
    return Finding(
        id="raster_not_covered",
        severity="warning",
        message=f"At {count} of {time_s.size} times, the first at {first_s:.9g} s, less than "
        "half of the interval around the time is covered by samples. They count as missing.",
        where=f"{where}, {key}",
        remedy="Check where the channel was not recorded.",
        values={"count": count, "from_s": first_s},
    )


def raster_note(axes: Sequence[Axis], time_s: np.ndarray, base: Axis | None) -> str:
    """Return a sentence on how the channels came onto the common times."""
    steps = ", ".join(
        f"{median_step_s(axis.time_s):g} s ({', '.join(axis.values)})" for axis in axes
    )
    whose = f"the samples of '{next(iter(base.values))}'" if base else "a step that was given"
    return (
        f"The channels come at {steps}; the time axis is {whose}, {median_step_s(time_s):g} s. "
        "Other channels are means over the interval centred on each of its times, the phase "
        "current as root mean square."
    )
