"""From a measurement file to channels on one time axis.

Channels of one rate stay together as long as they can: products of channels, such as losses from
voltages and currents, are formed at their full rate and averaged afterwards. The mean of a product
is not the product of the means.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..errors import InputError
from ..record.channels import CHANNEL, Columns
from ..record.derive import constants_of, derive
from ..record.motor import Motor
from ..record.raster import means_around, median_step_s, raster, require_increasing
from ..record.record import Finding
from ..record.table import Table
from .channel_map import MappedColumns, map_columns
from .measurement import Header, Measurement, Series, header_of

Follow = partial[tuple[dict[str, np.ndarray], tuple[str, ...]]]
"""`heatrun.record.derive.derive` with what the motor file says."""

OUTPUT = "winding_degC"
"""The channel that a fit compares: its samples are never multiplied by interpolation. Inputs are
joined by straight lines in any case, see `heatrun.record.reduction`."""


def read_measurement(
    measurement: Measurement, motor: Motor, columns: Columns, *, where: str, is_part: bool = False
) -> tuple[Table, MappedColumns]:
    """Read the channels that a record needs, onto one time axis; arguments as `map_columns`.

    The step of the axis is `raster_s` of the motor [s]; by default the samples of the winding are
    the axis, without a winding those of the slowest channel. Channels of a single rate stay as they
    are. Constants do not become channels here: another part may hold them.

    Returns:
        What the file says about itself, as a table without its samples, and the channels: in
        canonical units, means around the times of the axis; `time_s` only if the file gives
        times.

    Raises:
        InputError: If what is needed is no number, units contradict each other, the raster is
            finer than the winding's, or times do not increase where rates differ.
    """
    raster_s, constants = motor.raster_s, {} if is_part else motor.constants
    follow = partial(derive, phases=motor.phases, losses=motor.losses, constants=constants)
    header = header_of(measurement, columns)
    series: dict[str, Series] = {}
    while True:  # a column of zeros may free its channel for another column
        zeros = {name for name, one in series.items() if not np.nan_to_num(one.values).any()}
        if series and all(one.time_s is None for one in series.values()):
            header = replace(header, time=None)
        mapped = map_columns(header.table(1, zeros=zeros), columns, where=where, is_part=is_part)
        # The winding first: messages about an axis name its first channel.
        order = sorted(mapped.taken, key=lambda channel: channel != OUTPUT)
        needed = dict.fromkeys(name for channel in order for name in mapped.names(channel))
        needed = [name for name in needed if name in header.channels and name not in series]
        if not needed:
            break
        _require_readable(header, mapped, where)
        found = measurement.read([header.channels[name] for name in needed])
        series |= dict(zip(needed, found, strict=True))
    if not series:
        raise _nothing_known(header, where)
    axes = axes_of(series, where)
    own = []
    for axis in axes:
        table = header.table(axis.time_s.size, axis.values, zeros, axis.time_s)
        filled = map_columns(table, columns, where=where, is_part=is_part)
        own.append({
            key: filled.channels[key] for key in filled.taken
            if all(name in axis.values for name in filled.names(key))
        })  # fmt: skip
    _refuse_parts_apart(mapped, own, where)
    notes, findings = (), ()
    channels = own[0]
    time_s = axes[0].time_s
    if len(axes) > 1 or (raster_s is not None and axes[0].has_times):
        own, notes = _derive_at_full_rate(own, follow)
        lead = next((one for one, held in zip(axes, own, strict=True) if OUTPUT in held), None)
        time_s, base = common_times(axes, lead, raster_s, where)
        channels, found_gaps = averaged(axes, own, time_s, base, where)
        findings = (*found_gaps, *_late_products(channels, follow, where))
        notes = (*notes, raster_note(axes, time_s, base))
    if "time_s" not in channels and "time_s" in mapped.taken:
        channels = {"time_s": time_s} | channels
    about = replace(
        header.table(time_s.size), reader=measurement.reader, findings=measurement.findings
    )
    return about, replace(
        mapped,
        channels=channels,
        notes=[*mapped.notes, *notes],
        findings=[*mapped.findings, *findings],
    )


def read_all(measurement: Measurement, *, where: str) -> Table:
    """Read every channel of numbers onto one time axis, under the names of the file.

    Channels faster than the slowest are averaged plainly, in the file's units.

    Raises:
        InputError: As `read_measurement`.
    """
    header = header_of(measurement, {})
    refused = {name: one.refusal[0] for name, one in header.channels.items() if one.refusal}
    names = [name for name in header.channels if name not in refused]
    if not names:
        raise _nothing_known(header, where)
    found = measurement.read([header.channels[name] for name in names])
    axes = axes_of(dict(zip(names, found, strict=True)), where)
    time_s, base = axes[0].time_s, axes[0]
    if len(axes) > 1:
        time_s, base = common_times(axes, None, None, where)
    values = {
        name: samples if axis is base else means_around(axis.time_s, samples, time_s)
        for axis in axes
        for name, samples in axis.values.items()
    }
    if not axes[0].has_times:
        header = replace(header, time=None)
    whole = header.table(time_s.size, values, time_s=time_s)
    kept = {*values, header.time.name if header.time else ""}
    return Table(
        tuple(column for column in whole.columns if column.name in kept),
        {**header.texts, **refused},
        findings=measurement.findings,
        reader=measurement.reader,
    )


def _refuse_parts_apart(
    mapped: MappedColumns, own: Sequence[Mapping[str, np.ndarray]], where: str
) -> None:
    """Refuse a mean of sensors that were not sampled together."""
    for channel in mapped.parts:
        if all(channel not in channels for channels in own):
            names = ", ".join(mapped.names(channel))
            raise InputError(
                f"The channels {names} of {channel} have different times.",
                where=where,
                remedy="Combine channels of one rate, or name one of them.",
            )


def _require_readable(header: Header, mapped: MappedColumns, where: str) -> None:
    """Refuse a needed channel that is not read as numbers."""
    named = [(channel, name) for channel in mapped.taken for name in mapped.names(channel)]
    for channel, name in named:
        if name in header.channels and (refusal := header.channels[name].refusal):
            at = f"{where}, channel '{name}' as {channel}"
            raise InputError(refusal[0], where=at, remedy=refusal[1])


def _nothing_known(header: Header, where: str) -> InputError:
    held = ", ".join([*header.channels, *header.texts]) or "nothing"
    unit = CHANNEL["winding_degC"].unit
    return InputError(
        f"No channel of the file is known; it holds {held}.",
        where=where,
        remedy=f'Map them in the motor file: [columns] winding_degC = "CHANNEL [{unit}]".',
    )


def _derive_at_full_rate(
    own: Sequence[Mapping[str, np.ndarray]], follow: Follow
) -> tuple[list[dict[str, np.ndarray]], tuple[str, ...]]:
    """Return the channels of each axis with those that follow from one axis alone.

    Only the way that the whole record would take is taken, so that a better one is not lost.
    """
    every = {key: _sketch(values) for channels in own for key, values in channels.items()}
    # what another axis holds is no constant
    alone = {name: x for name, x in follow.keywords["constants"].items() if name not in every}
    follow = partial(follow, constants=alone)
    plan = _followed(every, follow)[1].items()
    extended, notes = [], []
    for channels in own:
        with np.errstate(over="ignore", invalid="ignore"):
            derived, followed = _followed(channels, follow)
        taken = dict(pair for pair in followed.items() if pair in plan)
        extended.append({**channels, **{key: derived[key] for key in taken}})
        notes += taken.values()
    return extended, tuple(notes)


def _followed(
    channels: Mapping[str, np.ndarray], follow: Follow
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return channels with all that follows, and the note on each that follows from others."""
    derived, notes = follow(channels)
    new = [key for key in derived if key not in channels]
    stated = constants_of(notes)
    return derived, {k: n for k, n in zip(new, notes, strict=True) if k not in stated}


def _sketch(values: np.ndarray) -> np.ndarray:
    """Return one sample, 0 where all are: all that a derivation asks of values."""
    return np.full(1, float(np.any(values != 0.0)))


def _late_products(
    channels: Mapping[str, np.ndarray], follow: Follow, where: str
) -> Iterator[Finding]:
    """Yield a finding for each channel that can only follow from averages."""
    sketch = {key: _sketch(values) for key, values in channels.items()}
    for key, note in _followed(sketch, follow)[1].items():
        yield Finding(
            "derived_from_means",
            "warning",
            f"{key} is formed of averages, since its factors have different rates ({note}) "
            "What the factors do together within a step of the raster is lost.",
            where,
            "Record the factors in one group, or the power itself.",
        )


RMS_QUANTITY = "phase current"
"""Averaged as root mean square: it is the square that heats."""

STEP_SLACK = 1.001
"""Steps that differ by the tolerance of a clock, one in a thousand, count as equal."""


@dataclass(frozen=True)
class Axis:
    """Columns that share their times."""

    # Times [s], shape (time,); numbers of the samples where the file gives no times.
    time_s: np.ndarray
    values: dict[str, np.ndarray]  # Column name to samples, shape (time,).
    has_times: bool = True  # The file gives times.


def axes_of(series: Mapping[str, Series], where: str) -> list[Axis]:
    """Return series, by the name of their column, by their times, in the order in which they came.

    Raises:
        InputError: If some have times and others not, lengths differ without times, or there is
            no sample.
    """
    untimed = {name: one.values for name, one in series.items() if one.time_s is None}
    if untimed and len(untimed) < len(series):
        timed = next(name for name in series if name not in untimed)
        raise InputError(
            f"Channel '{next(iter(untimed))}' has no times, channel '{timed}' has.",
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
        if time_s.size == 0:
            raise InputError(
                "Expected at least one sample, found none.",
                where=f"{where}, channel '{name}'",
                remedy="Check that the recording contains the samples.",
            )
        for axis in axes:
            if axis.time_s is time_s or np.array_equal(axis.time_s, time_s, equal_nan=True):
                axis.values[name] = one.values
                break
        else:
            axes.append(Axis(time_s, {name: one.values}))
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
