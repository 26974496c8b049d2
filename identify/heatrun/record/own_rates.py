"""Tables on all time stamps of channels of different rates, whose cells in between are empty.

Exports of MDF, of data bases and of ROS write such tables. Each channel then has a rate of its own,
as in a measurement file: what drives the model is interpolated linearly, readings stay as they are.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .channels import BODIES
from .raster import LONGEST_GAP
from .record import Finding

READINGS = ("winding_degC", *BODIES)
"""Channels that a fit compares: their samples are never multiplied."""

LEAST_SAMPLES = 3
"""Fewer have no rate."""


def own_step(values: np.ndarray) -> int:
    """Return how many rows usually lie from a sample to the next; 1 for a channel of every row.

    Where every second cell or more is empty, that is the rate of the channel; a sensor that fails
    for a while leaves its samples next to each other.

    Args:
        values: NaN where the cell is empty, shape (time,).
    """
    rows = np.flatnonzero(np.isfinite(values))
    return int(np.median(np.diff(rows))) if rows.size >= LEAST_SAMPLES else 1


def between_samples(values: np.ndarray) -> np.ndarray:
    """Return which empty cells lie between two samples of the channel's own rate, shape (time,).

    Args:
        values: NaN where the cell is empty, shape (time,).
    """
    rows = np.flatnonzero(np.isfinite(values))
    near = np.zeros(values.size, dtype=bool)
    step = own_step(values)
    if step == 1:
        return near
    index = np.arange(values.size)
    after = np.searchsorted(rows, index)
    first = np.where(after > 0, rows[np.maximum(after - 1, 0)], -1)
    last = np.where(after < rows.size, rows[np.minimum(after, rows.size - 1)], values.size)
    return ~np.isfinite(values) & (last - first < 1.5 * step + 1)


def at_own_rates(
    channels: Mapping[str, np.ndarray], where: str
) -> tuple[dict[str, np.ndarray], tuple[Finding, ...]]:
    """Return channels without empty cells where their own rate left these, and a note for each.

    Rows that hold samples of slower inputs alone are dropped once these are interpolated.

    Args:
        channels: Canonical name to values, with `time_s`, NaN where empty, shape (time,).
        where: The file, for messages.
    """
    channels = _merged(channels)
    time_s = channels["time_s"]
    held = {name: np.isfinite(values) for name, values in channels.items() if name != "time_s"}
    slow = {name for name in held if own_step(channels[name]) > 1}
    if not slow or not (np.diff(time_s[np.isfinite(time_s)]) > 0.0).all():
        return dict(channels), ()
    nothing = np.zeros(time_s.size, dtype=bool)
    read = np.logical_or.reduce([nothing, *(held[name] for name in held if name in READINGS)])
    dense = np.logical_or.reduce([nothing, *(held[name] for name in held if name not in slow)])
    filled, findings = dict(channels), []
    for name in held.keys() - set(READINGS):
        empty = np.isfinite(time_s) if name in slow else read & ~dense
        empty &= ~held[name]
        known = held[name] & np.isfinite(time_s)
        if not empty.any() or known.sum() < LEAST_SAMPLES:
            continue
        step_s = float(np.median(np.diff(time_s[known])))
        at, values = time_s[known], channels[name][known]
        after = np.clip(np.searchsorted(at, time_s[empty]), 1, at.size - 1)
        is_near = (at[after] - at[after - 1] <= LONGEST_GAP * step_s) & (
            np.abs(time_s[empty] - np.clip(time_s[empty], at[0], at[-1])) <= step_s
        )
        filled[name] = channels[name].copy()
        filled[name][empty] = np.where(is_near, np.interp(time_s[empty], at, values), np.nan)
        if name in slow:
            findings.append(_joined(name, step_s, int(empty.sum()), time_s.size, where))
    kept = read | dense if dense.any() else ~nothing
    return {name: values[kept] for name, values in filled.items()}, tuple(findings)


def _merged(channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return channels with one row for each time stamp, where no two rows of it fill one cell."""
    steps = np.diff(channels["time_s"])
    starts = np.concatenate(([0], np.flatnonzero(steps != 0.0) + 1))
    if starts.size > steps.size or not (steps >= 0.0).all():
        return dict(channels)
    held = [np.isfinite(values) for name, values in channels.items() if name != "time_s"]
    if any((np.add.reduceat(one.astype(int), starts) > 1).any() for one in held):
        return dict(channels)
    return {name: np.fmax.reduceat(values, starts) for name, values in channels.items()}


def _joined(name: str, step_s: float, count: int, size: int, where: str) -> Finding:
    return Finding(
        id="raster_joined",
        severity="note",
        message=f"{count} of {size} cells are empty, since the channel comes every {step_s:g} s "
        "alone: values in between are interpolated linearly.",
        where=f"{where}, {name}",
        remedy="Nothing need be done.",
        values={"step_s": step_s},
    )
