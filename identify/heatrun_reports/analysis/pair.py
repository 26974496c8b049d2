"""Two records of one manoeuvre on one time axis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from heatrun.checks.time_axis import GAP_STEPS
from heatrun.errors import InputError
from heatrun.readers.align import joined_channels
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import median_step, samples

from .drive import has, with_powers
from .offset import Offset, find_offset

FINER = 0.5
"""A record that samples at this share of the other's step or finer is averaged, not interpolated,
so that its noise is that of a mean [1]."""

FEWEST = 10
"""Common samples below which nothing is compared [1]."""


@dataclass(frozen=True)
class Pair:
    """Two records, the test and its reference, on the clock of the first."""

    test: str
    reference: str
    time_s: Float[np.ndarray, " common"]  # Common axis on the test's clock [s], shape (common,).
    # Channels of the test, shape (common,) each; NaN where it has none.
    ours: Mapping[str, Float[np.ndarray, " common"]]
    theirs: Mapping[str, Float[np.ndarray, " common"]]  # The same channels of the reference.
    offset: Offset
    method: str  # How the common axis came about.
    findings: tuple[Finding, ...]  # What is not compared, and doubts about the offset.

    def within(self, from_s: float, to_s: float) -> Pair:
        """Return the part between two moments on the test's clock [s].

        Raises:
            InputError: If too few common samples are left.
        """
        inside = (self.time_s >= from_s) & (self.time_s <= to_s)
        _require_enough(int(np.sum(inside)), "samples common to all", self.test, self.reference)
        return replace(
            self,
            time_s=self.time_s[inside],
            ours={name: values[inside] for name, values in self.ours.items()},
            theirs={name: values[inside] for name, values in self.theirs.items()},
        )


def _require_enough(num: int, what: str, test: str, reference: str) -> None:
    if num < FEWEST:
        raise InputError(
            f"Expected at least {FEWEST} {what}, got {num}.",
            where=f"{test}, {reference}",
            remedy="Are they of one manoeuvre?",
        )


def pair_records(
    test: Record, reference: Record, motor: Motor, *, offset_s: float | None = None
) -> Pair:
    """Align two records and bring them to one axis, that of the more coarsely sampled one.

    The finer record is averaged over the time that each sample of the coarser one stands for
    (currents as mean squares); records of like step are interpolated by straight lines. Gaps are
    not bridged. DC and mechanical power are formed on each record's own axis before.

    Args:
        test: The record whose clock is kept.
        reference: The other, from another prototype.
        motor: The machine.
        offset_s: What is added to the reference's clock [s]; searched if None.

    Raises:
        InputError: If they share no signal or no time, or the offset cannot be found.
    """
    test, reference = with_powers(test, motor), with_powers(reference, motor)
    channels = [c for c in test.channels if c != "time_s" and has(test, c) and has(reference, c)]
    if not channels:
        raise InputError(
            f"Expected a signal that both records hold; {test.name} has "
            f"{', '.join(test.channels)}, {reference.name} has {', '.join(reference.channels)}.",
            where=f"{test.name}, {reference.name}",
            remedy="Map the columns of both in the motor file, or name them canonically.",
        )
    if offset_s is None:
        offset = find_offset(test, reference, channels)
    else:
        _require_overlap(test, reference, offset_s)
        offset = Offset(offset_s, 0.0, "by --offset")
    _require_overlap(test, reference, offset.offset_s)
    axis, method, is_averaged = _axis(test, reference, offset.offset_s)
    ours = _on(axis, test, channels, 0.0, is_averaged == "test")
    theirs = _on(axis, reference, channels, offset.offset_s, is_averaged == "reference")
    return Pair(
        test=test.name,
        reference=reference.name,
        time_s=axis,
        ours=ours,
        theirs=theirs,
        offset=offset,
        method=method,
        findings=(*offset.findings, *_not_compared(test, reference, channels)),
    )


def _require_overlap(test: Record, reference: Record, offset_s: float) -> None:
    ours, theirs = samples(test)[0], samples(reference)[0] + offset_s
    if min(ours[-1], theirs[-1]) > max(ours[0], theirs[0]):
        return
    raise InputError(
        f"Expected records of one time; with an offset of {offset_s:+.1f} s the reference runs "
        f"from {theirs[0]:.1f} to {theirs[-1]:.1f} s, the test from {ours[0]:.1f} to "
        f"{ours[-1]:.1f} s: they do not overlap.",
        where=f"{test.name}, {reference.name}",
        remedy="Give another --offset, or none to have it searched.",
    )


def _axis(test: Record, reference: Record, offset_s: float) -> tuple[np.ndarray, str, str]:
    """The coarser record's stamps inside both, how it came about, and which record is averaged."""
    ours, theirs = samples(test)[0], samples(reference)[0] + offset_s
    steps = {"test": median_step(ours), "reference": median_step(theirs)}
    coarse, fine = sorted(steps, key=lambda name: steps[name], reverse=True)
    stamps = ours if coarse == "test" else theirs
    inside = (stamps >= max(ours[0], theirs[0])) & (stamps <= min(ours[-1], theirs[-1]))
    axis = stamps[inside]
    _require_enough(axis.size, "common samples", test.name, reference.name)
    head = f"common axis: the samples of the {coarse} ({steps[coarse]:.3g} s apart)"
    if steps[fine] <= FINER * steps[coarse]:
        return axis, f"{head}; the {fine} is averaged over the time each stands for.", fine
    return axis, f"{head}; the {fine} is interpolated linearly.", ""


def _on(
    axis: np.ndarray, record: Record, channels: list[str], offset_s: float, is_averaged: bool
) -> dict[str, np.ndarray]:
    if not is_averaged:
        return {channel: _interpolated(axis, record, channel, offset_s) for channel in channels}
    kept = {name: record[name] for name in ("time_s", *channels)}
    stamps = Record(record.name, {"time_s": axis})
    means, _ = joined_channels(stamps, Record(record.name, kept), offset_s)
    place = np.searchsorted(axis, means["time_s"])
    result = {channel: np.full(axis.size, np.nan) for channel in channels}
    for channel, values in result.items():
        values[place] = means[channel]
    return result


def _interpolated(axis: np.ndarray, record: Record, channel: str, offset_s: float) -> np.ndarray:
    """Straight lines between samples; NaN outside them and in gaps."""
    time_s, values = samples(record, channel)
    clock = time_s + offset_s
    course = np.interp(axis, clock, values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(clock, axis), 1, max(clock.size - 1, 1))
    if clock.size < 2:
        return np.full(axis.size, np.nan)
    is_gap = (clock[after] - clock[after - 1]) > GAP_STEPS * median_step(samples(record)[0])
    is_sample = np.isin(axis, clock)
    return np.where(is_gap & ~is_sample, np.nan, course)


def _not_compared(test: Record, reference: Record, channels: list[str]) -> tuple[Finding, ...]:
    lines = []
    for record, other in ((test, reference), (reference, test)):
        alone = [c for c in record.channels if c not in channels and c != "time_s"]
        if alone:
            lines.append(f"{', '.join(alone)} of {record.name} (not measured in {other.name})")
    said = f"Not compared: {'; '.join(lines)}."
    return (Finding("not_compared", "note", said, test=test.name),) if lines else ()
