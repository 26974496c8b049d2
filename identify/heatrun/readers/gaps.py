"""A gap of the logger: bridged where its load is known or stated, else the record is two parts.

Within a bridged gap no reading is compared; the network runs through it on the load that was held,
or on none. Each of two parts has start temperatures of its own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..checks.time_axis import GAP_STEPS, MAX_GAP_S
from ..io.toml_text import table_header
from ..record.channels import BODIES, CHANNEL
from ..record.motor import GapLoad
from ..record.record import Finding, Record
from ..record.samples import place
from ..record.stretch import Stretch, cut

LEVEL_S = 60.0
"""Load and trend of the winding on either side are taken over this time [s]."""

SAME_LEVEL = 0.1
"""Loads within this share of the largest are one [1], as levels of load are in the checks."""

SAME_K = 2.0
"""Within this the winding after a gap is where a held load brings it [K]."""

OF_LOAD = frozenset(
    ("phase current", "dq current", "direct current", "power", "torque", "speed", "voltage")
)
"""Quantities that are the load."""


def over_gaps(record: Record, load: GapLoad | None, *, splits: bool) -> tuple[Record, ...]:
    """Return a record with its gaps bridged, or its parts.

    Args:
        record: A record, or a part of one.
        load: What `[tests.NAME.gap]` says of the load in its gaps. None: a gap up to `MAX_GAP_S`
            stays as it is; in a longer one the load was held if it is the same on both sides and
            the winding has gone on as it would under it, else it is not known.
        splits: Whether a gap of unknown load parts the record; if not, it stays as it is.

    Returns:
        One record, or several without a name of their own yet.
    """
    time_s = record.time_s
    steps = np.diff(time_s)
    if time_s.size < 3 or not np.all(steps > 0.0):  # NaN is no number above 0 either
        return (record,)
    usual = float(np.median(steps))
    shortest = GAP_STEPS * usual if load else max(GAP_STEPS * usual, MAX_GAP_S)
    parts, bridged, begin = [], [], 0
    for at in np.flatnonzero(steps > shortest):
        how = load or ("held" if _goes_on(record, int(at)) else "unknown")
        if how != "unknown":
            bridged.append((int(at), how))
        elif splits:
            parts.append((begin, int(at)))
            begin = int(at) + 1
    is_stated = load is not None
    whole = _bridged(record, bridged, usual, is_stated)
    if not parts:
        return (whole,)
    bounds = [*parts, (begin, time_s.size - 1)]
    found = [
        cut(whole, Stretch(float(time_s[first]), float(time_s[last])), "split at a gap")
        for first, last in bounds
    ]
    told = [_split(record, bounds[k][1], is_stated) for k in range(len(parts))]
    return (
        found[0],
        *(
            replace(one, findings=(*one.findings, finding))
            for one, finding in zip(found[1:], told, strict=True)
        ),
    )


def _goes_on(record: Record, at: int) -> bool:
    """Return whether the load is one on both sides of a gap, and the winding shows no other."""
    time_s = record.time_s
    before = (time_s >= time_s[at] - LEVEL_S) & (time_s <= time_s[at])
    after = (time_s >= time_s[at + 1]) & (time_s <= time_s[at + 1] + LEVEL_S)
    for name in ("phase_current_A", "losses_W", "speed_rpm"):
        if name in record:
            values = record[name]
            largest = float(np.nanmax(np.abs(values), initial=0.0))
            sides = [values[side & np.isfinite(values)] for side in (before, after)]
            if not all(side.size for side in sides):
                return False
            if abs(float(np.mean(sides[0]) - np.mean(sides[1]))) > SAME_LEVEL * largest:
                return False
    if "winding_degC" not in record:
        return False
    winding = record["winding_degC"]
    trend = before & np.isfinite(winding)
    if np.sum(trend) < 2 or not np.isfinite(winding[at + 1]):
        return False
    slope, level = np.polyfit(time_s[trend] - time_s[at], winding[trend], 1)
    further = sorted((level, level + slope * (time_s[at + 1] - time_s[at])))
    return bool(further[0] - SAME_K <= winding[at + 1] <= further[1] + SAME_K)


def _bridged(
    record: Record, gaps: list[tuple[int, str]], usual_s: float, is_stated: bool
) -> Record:
    """Return a record with two samples at the ends of each gap that hold its load."""
    if not gaps:
        return record
    time_s = record.time_s
    at = np.repeat([place + 1 for place, _ in gaps], 2)
    ends = ((time_s[k] + usual_s, time_s[k + 1] - usual_s) for k, _ in gaps)
    knots = [float(end) for pair in ends for end in pair]
    channels = {}
    for name, values in record.channels.items():
        if name == "time_s":
            added = np.asarray(knots)
        elif name == "winding_degC" or name in BODIES:
            added = np.full(at.size, np.nan)
        elif name in CHANNEL and CHANNEL[name].quantity in OF_LOAD:
            level = [0.0 if how == "zero" else _level(time_s, values, place) for place, how in gaps]
            added = np.repeat(level, 2)
        else:
            added = np.interp(knots, time_s, values)
        channels[name] = np.insert(values, at, added)
    windows = tuple(zip(knots[::2], knots[1::2], strict=True))
    findings = [_bridge(record, place, how, is_stated) for place, how in gaps]
    return replace(
        record,
        channels=channels,
        masks=(*record.masks, *windows),
        findings=(*record.findings, *findings),
    )


def _level(time_s: np.ndarray, values: np.ndarray, place: int) -> float:
    """Return the mean over the last minute before a gap."""
    last = (time_s >= time_s[place] - LEVEL_S) & (time_s <= time_s[place]) & np.isfinite(values)
    return float(np.mean(values[last])) if last.any() else float("nan")


def _bridge(record: Record, at: int, how: str, is_stated: bool) -> Finding:
    if is_stated:
        words = "held through it" if how == "held" else "zero in it"
        return _finding(record, at, f"The load is {words}, as the motor file says", "")
    return _finding(
        record,
        at,
        "The load is the same on both sides, and the winding goes on as under it: it is held "
        "through the gap",
        f"If the load was off in the gap: {_line(record, 'zero')}. If nobody knows: "
        f"{_line(record, 'unknown')}.",
    )


def _split(record: Record, at: int, is_stated: bool) -> Finding:
    remedy = (
        f"If the load was held: {_line(record, 'held')}. If it was off: {_line(record, 'zero')}. "
        "The network then runs through the gap."
    )
    return _finding(
        record,
        at,
        "The load in it is not known. Before and after are calibrated together, each from start "
        "temperatures of its own; the stator's has a wide prior after the gap",
        "" if is_stated else remedy,
    )


def _finding(record: Record, at: int, words: str, remedy: str) -> Finding:
    from_s, to_s = (float(record.time_s[k]) for k in (at, at + 1))
    return Finding(
        "time_gap",
        "warning" if remedy else "note",
        f"The logger stood still for {to_s - from_s:.0f} s. {words}. No reading is compared there.",
        place(record, "time_s", from_s, to_s),
        remedy,
        values={"longest_s": to_s - from_s, "from_s": from_s, "to_s": to_s},
    )


def _line(record: Record, load: str) -> str:
    return f'{table_header("tests", record.name, "gap")} load = "{load}"'
