"""From a measurement file to channels on one time axis.

Channels of one rate stay together as long as they can: products of channels, such as losses from
voltages and currents, are formed at their full rate and averaged afterwards. The mean of a product
is not the product of the means.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..errors import InputError
from ..record.channels import CHANNEL, Columns
from ..record.derive import constants_of, derive
from ..record.motor import Motor
from ..record.raster import means_around
from ..record.record import Finding
from ..record.table import Table
from .axes import averaged, axes_of, common_times, raster_note
from .channel_map import MappedColumns, map_columns
from .measurement import Header, Measurement, Series, header_of

Follow = partial[tuple[dict[str, np.ndarray], tuple[str, ...]]]
"""`heatrun.record.derive.derive` with what the motor file says."""

OUTPUT = "winding_degC"
"""The channel that a fit compares: its samples are never multiplied by interpolation. Inputs are
joined by straight lines in any case, see `heatrun.record.reduction`."""


def read_measurement(
    measurement: Measurement,
    motor: Motor,
    columns: Columns,
    *,
    where: str,
    is_part: bool = False,
) -> tuple[Table, MappedColumns]:
    """Read the channels that a record needs, onto one time axis.

    Args:
        measurement: The file.
        motor: Its `raster_s` is the step of the time axis [s]; by default the samples of the
            winding are the axis, without a winding those of the slowest channel. Channels of a
            single rate stay as they are. Its constants do not become channels here.
        columns: `[columns]` of the motor file for this test.
        where: The file, for messages.
        is_part: As `heatrun.readers.channel_map.map_columns`; another part may hold what the motor
            file states for want of a column.

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
    notes: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
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

    Returns:
        The table; channels faster than the slowest are averaged plainly, in the file's units.

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
        stored = header.channels.get(name)
        if stored is None:
            continue
        at = f"{where}, channel '{name}' as {channel}"
        if stored.refusal:
            raise InputError(stored.refusal[0], where=at, remedy=stored.refusal[1])


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
) -> tuple[Finding, ...]:
    """Return a finding for each channel that can only follow from averages."""
    sketch = {key: _sketch(values) for key, values in channels.items()}
    _, followed = _followed(sketch, follow)
    return tuple(
        Finding(
            id="derived_from_means",
            severity="warning",
            message=f"{key} is formed of averages, since its factors have different rates ({note}) "
            "What the factors do together within a step of the raster is lost.",
            where=where,
            remedy="Record the factors in one group, or the power itself.",
        )
        for key, note in followed.items()
    )
