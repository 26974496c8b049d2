"""Values of the load that no machine had: markers of a bus, overrange of an analyser, bursts.

A signal that is not valid comes as the largest number of its bits, 0xFFFF, also when scaled by 10
or 100. Whatever a value is called, its heat must show: what would warm the winding by kelvins, and
does not, was not there.
"""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from ..io.quantities import rounded
from ..record.channels import CHANNEL, OF_LOAD
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import channel_of, is_measured, place, runs, samples
from ..record.stretch import bridge, windows, within
from ..record.units import find_unit
from .advice import Remedy, widened
from .quick_fit import quick_fit

BITS = (10, 12, 14, 15, 16, 23, 24, 31, 32)
SCALES = (1.0, 10.0, 100.0, 1000.0)
MARKER_TOLERANCE = 1e-6
"""A marker comes back exact but for the rounding of a text [1]."""

BEYOND = 2.5
"""Factor over all else of a channel [1] from which a few samples are looked at."""

MARKED = 1.2
"""Factor [1] that does for the value of a marker in a current, and for its copper loss over the
recorded losses: chance does not hit both."""

FEW = 0.02
"""Share of the samples [1] that are a few."""

FOLLOWS = 1.5
"""Factor [1] by which the current must rise for a load beyond all others to be one."""

CONTRADICTION = 10.0
"""Copper loss over the recorded losses, or a power over all else under one current [1], that no
instrument explains, and no inrush: its power is in the losses too."""

NOTHING, MOMENT = 0.01, 3
"""In parts of the largest value [1], what a lost message reads, and samples that it lasts."""

SHOWS_S = 120.0
"""So long after a burst its heat has reached the winding, wherever it was made [s]."""

LEAST_K, SHOWN = 3.0, 0.3
"""What it must make at least [K], and the share of that [1] which the reading does not show."""

STEADY = 0.5
"""Share of the largest other value [1] within which a load is the same before and after: a start
draws more than its load, for a moment."""


def of_the_load(record: Record) -> list[str]:
    """Return the channels of the load that were read: what follows from a column says the same."""
    read = {one.channel for one in record.mapping} or record.channels.keys()
    return [
        name
        for name in record.channels
        if name in read and name in CHANNEL and CHANNEL[name].quantity in OF_LOAD
    ]


def load_spike(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report samples of current, powers, torque, speed or voltage that no machine had.

    Told by a value far beyond all else of its channel that is a marker, that the recorded losses
    contradict, or whose heat the winding does not show.
    """
    read = {one.channel: one for one in record.mapping}
    for name in of_the_load(record):
        time_s, values = samples(record, name)
        is_far, rest = _beyond(values)
        is_near = not is_far.any()
        if is_near and CHANNEL[name].quantity == "phase current":
            is_far, rest = _beyond(values, MARKED)
        if not is_far.any():
            yield from _dropped(record, name)
            continue
        first, past = runs(is_far)
        spans = windows(time_s, is_far)
        largest = float(values[np.argmax(np.abs(values))])
        unit = find_unit(read[name].unit, CHANNEL[name].quantity) if name in read else None
        marker = _marker(largest / (unit.factor if unit else 1.0))
        denied = _contradiction(record, motor, name, spans, MARKED if is_near else CONTRADICTION)
        unshown = "" if is_near else _unshown(record, motor, spans)
        if is_near:
            is_told = marker and denied
        elif marker or _is_steady(values, first, past, rest):
            is_told = marker or denied or unshown
        else:  # a start draws more than its load, and its energy turns the rotor
            is_cut = first[0] == 0 or past[-1] == values.size  # the record may begin with its end
            is_far_off = abs(largest) > CONTRADICTION * rest and not is_cut
            is_told = denied and (unshown or is_far_off)
        if not is_told:
            continue
        why = [each for each in (marker, denied, unshown) if each]
        step_s = float(np.median(np.diff(time_s)))
        lasts_s = float(np.sum(past - first)) * step_s
        advice = ". Find out what the logger writes for a value that is not valid."
        times = f"{rounded(abs(largest) / rest)} times the next largest value" if rest else ""
        yield Finding(
            "load_spike",
            "error",
            f"{name} reads {largest:.6g} {CHANNEL[name].unit} for {lasts_s:.3g} s"
            f"{f', {times}' if times else ''}: {', and '.join(why)}.",
            place(record, name, spans[0][0], spans[-1][1]),
            Remedy("To run straight over it: ", widened(record, "bridge", spans), advice),
            values={
                "largest": largest,
                "times_the_next": abs(largest) / rest if rest else math.inf,
                "num_samples": float(np.sum(is_far)),
                "from_s": spans[0][0],
                "to_s": spans[-1][1],
            },
        )


def _dropped(record: Record, name: str) -> Iterator[Finding]:
    """Yield samples of a power or a torque that read nothing, for a moment, under a steady load,
    beside which the other side of the balance goes on: a message was lost.
    """
    spans, wrong_W = _dropped_windows(record, name)
    if not spans:
        return
    count = int(np.sum(within(record.time_s, spans)))
    yield Finding(
        "load_spike",
        "error",
        f"{name} reads 0 in {count} samples amid a steady load, while the other side of the "
        f"balance goes on: losses_W is {wrong_W:.3g} W there.",
        place(record, name, spans[0][0], spans[-1][1]),
        Remedy("Leave these lines out of the file. Or to run straight over them: ",
               widened(record, "bridge", spans),
               ". Find out what the logger writes where a message is lost."),
        values={"largest": 0.0, "times_the_next": 0.0, "num_samples": float(count),
                "from_s": spans[0][0], "to_s": spans[-1][1]},
    )  # fmt: skip


def _dropped_windows(record: Record, name: str) -> tuple[list[tuple[float, float]], float]:
    """Return the windows [s] of lost messages, and what the losses read there [W]."""
    time_s, values, losses = samples(record, name, "losses_W")
    if time_s.size < 3 or name == "losses_W" or CHANNEL[name].quantity not in ("power", "torque"):
        return [], 0.0
    size, usual = np.abs(values), float(np.quantile(np.abs(losses), 1.0 - FEW))
    lost = np.zeros(size.size, dtype=bool)
    for a, b in zip(*runs(size <= NOTHING * np.max(size)), strict=True):
        if a > 0 and b < size.size and b - a <= MOMENT:
            beside = sorted((size[a - 1], size[b]))
            own = max(SHOWN * usual, abs(losses[a - 1]), abs(losses[b]))
            is_wrong = np.min(np.abs(losses[a:b])) > BEYOND * own
            lost[a:b] = beside[0] > STEADY * beside[1] and is_wrong
    if not lost.any() or np.mean(lost) > FEW:
        return [], 0.0
    return windows(time_s, lost), float(np.median(losses[lost]))


def spike_windows(record: Record, finding: Finding) -> list[tuple[float, float]]:
    """Return the windows [s] of a finding of `load_spike`."""
    name = channel_of(finding)
    if not finding.values["largest"]:
        return _dropped_windows(record, name)[0]
    time_s, values = samples(record, name)
    return windows(time_s, _beyond(values, min(BEYOND, finding.values["times_the_next"] or 0.0))[0])


def _beyond(values: np.ndarray, factor: float = BEYOND) -> tuple[np.ndarray, float]:
    """Return where few samples lie far beyond all others, and the largest of those."""
    size = np.abs(values)
    ranked = np.sort(size)
    tail = ranked[int((1.0 - FEW) * ranked.size) :]
    if tail.size < 2:
        return np.zeros(values.size, dtype=bool), 0.0
    ratios = tail[1:] / np.maximum(tail[:-1], 1e-3 * tail[-1])
    at = int(np.argmax(ratios))
    if ratios[at] < factor or not np.all(is_measured(values)):
        return np.zeros(values.size, dtype=bool), 0.0
    return size > tail[at], float(tail[at])


def _is_steady(values: np.ndarray, first: np.ndarray, past: np.ndarray, rest: float) -> bool:
    """Whether the load is the same before and after all bursts."""
    before = values[np.maximum(first - 1, 0)]
    after = values[np.minimum(past, values.size - 1)]
    return bool(np.all(np.abs(after - before) < STEADY * rest))


def _marker(value: float) -> str:
    """Return what a value in the unit of its column is known as, empty if it is none."""
    size = abs(value)
    for bits, scale in itertools.product(BITS, SCALES):
        for whole in (2.0**bits - 1.0, 2.0**bits) if value < 0.0 else (2.0**bits - 1.0,):
            if abs(size * scale - whole) <= MARKER_TOLERANCE * whole:
                units = f" in units of 1/{scale:.0f}" if scale > 1 else ""
                return f"0x{int(whole):X}{units}, the marker of a signal that is not valid"
    digits = f"{size:.10g}".replace(".", "").rstrip("0")
    if len(digits) >= 4 and set(digits) == {"9"}:
        return "the overrange of an instrument"
    return ""


def _contradiction(
    record: Record,
    motor: Motor,
    name: str,
    spans: list[tuple[float, float]],
    least: float = CONTRADICTION,
) -> str:
    """Return what another channel says against a burst, empty if none does.

    Power and torque take current, and current makes losses.
    """
    time_s, current, losses, winding = samples(
        record, "phase_current_A", "losses_W", "winding_degC"
    )
    if time_s.size < 3:
        return ""
    inside = within(time_s, spans)
    if not inside.any() or inside.all():
        return ""
    quantity = CHANNEL[name].quantity
    if quantity in ("power", "torque"):
        first, past = runs(inside)
        size = np.abs(current)
        beside = np.maximum(size[np.maximum(first - 1, 0)], size[np.minimum(past, size.size - 1)])
        if np.all(size[inside] < FOLLOWS * np.maximum(np.repeat(beside, past - first), 1e-12)):
            return f"the phase current stays at {rounded(float(np.median(beside)))} A"
    elif quantity == "phase current" and motor.losses == "balance" and motor.phase_resistance_ohm:
        copper = float(np.median(motor.copper_loss_W(current, winding)[inside]))
        total = float(np.median(losses[inside]))
        if copper > least * max(total, 1e-12):
            return f"its copper loss is {rounded(copper)} W, the recorded losses {rounded(total)} W"
    return ""


def _unshown(record: Record, motor: Motor, spans: list[tuple[float, float]]) -> str:
    """Return what heat of bursts the winding does not show, empty where it may."""
    mended = bridge(record, spans, "")
    fit = quick_fit(mended, motor)
    time_s, heat_W = samples(record, "losses_W")
    straight_W = samples(mended, "losses_W")[1]
    reading_s, reading = samples(record, "winding_degC")
    if fit is None or heat_W.size != straight_W.size or reading.size < 2:
        return ""
    energy_J = float(np.trapezoid(np.abs(heat_W - straight_W), time_s))
    lasting = np.exp(-SHOWS_S / np.array(fit.taus_s))
    expected_K = energy_J / len(spans) * float(np.min(fit.response_K_per_J @ lasting))
    # in the middle of the blocks, so that a bend of the reading within one is in both
    unfitted_K = np.interp(fit.time_s, reading_s, reading) - fit.fitted_degC
    edges_s = np.array(spans) + np.array([0.0, SHOWS_S])
    shown_K = np.diff(np.interp(edges_s, fit.time_s, unfitted_K))
    if expected_K < max(LEAST_K, 3.0 * fit.rms_K) or np.max(shown_K) > SHOWN * expected_K:
        return ""
    return (
        f"the winding shows none of its {rounded(energy_J / 1e3)} kJ ({rounded(expected_K)} K at "
        "least)"
    )
