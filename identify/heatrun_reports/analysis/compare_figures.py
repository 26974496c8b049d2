"""Energy, distance and consumption of two prototypes over the time in common, with verdicts."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from heatrun.bench.record import Record
from heatrun.errors import InputError
from heatrun.motor import Motor

from .compare_signals import SignalComparison
from .drive import DC, TERMINALS, electrical_power
from .general_information import FIGURES, NEEDS, general_information
from .tolerances import Tolerance, tolerance_of_figure

FigureVerdict = Literal["agrees", "differs", "input", "not comparable", "not judged"]

OF_THE_DRIVE = ("dc_power_W", "electrical_power_W")
"""Powers whose energy stands in the General Information table already."""


@dataclass(frozen=True)
class FigureComparison:
    """One figure of two prototypes over the time in common.

    Attributes:
        name: As in the General Information table, or `energy_of_CHANNEL_kWh`.
        label: As printed.
        unit: As printed.
        test: Of the test; None where undefined.
        reference: Of the reference; None where undefined.
        difference_percent: Test minus reference over the reference's magnitude [%]; None where
            that is 0 or undefined.
        tolerance: What counts as agreement.
        verdict: Of the figure.
        note: Why there is no verdict; else empty.
    """

    name: str
    label: str
    unit: str
    test: float | None
    reference: float | None
    difference_percent: float | None
    tolerance: Tolerance
    verdict: FigureVerdict
    note: str = ""


def within(record: Record, from_s: float, to_s: float) -> Record:
    """Return the part of a record between two moments on its own clock [s]."""
    inside = (record.time_s >= from_s) & (record.time_s <= to_s)
    return replace(record, channels={n: values[inside] for n, values in record.channels.items()})


def compare_figures(
    test: Record,
    reference: Record,
    motor: Motor,
    signals: Sequence[SignalComparison],
    given: Mapping[str, float],
    inputs: Container[str] = (),
) -> tuple[FigureComparison, ...]:
    """Compare the General Information of two records, and the energies of other powers.

    Args:
        test: The test, cut to the time in common.
        reference: The other record, cut to it too.
        motor: Gives gear ratio and wheel radius.
        signals: The comparison signal by signal.
        given: Tolerances of the user by name.
        inputs: Channels of a test that drove the reference: what follows from its speed is no
            evidence either.

    Returns:
        Figures that both records have, in the order of the table.
    """
    found = []
    try:
        ours, theirs = (general_information(record, motor) for record in (test, reference))
    except InputError:  # fewer than two samples of a power or a speed: there is no figure
        return ()
    places = [_place(record, motor) for record in (test, reference)]
    for name, label, unit in FIGURES:
        a, b = getattr(ours, name), getattr(theirs, name)
        if a is None or b is None:
            continue
        one = _compared(name, label, unit, a, b, given)
        if name == "reduction_percent":
            one = replace(one, difference_percent=None, verdict="not judged")
        elif "power" in NEEDS[name] and places[0] != places[1]:
            words = f"power of the test {places[0]}, of the reference {places[1]}"
            one = replace(one, verdict="not comparable", note=words)
        elif "speed" in NEEDS[name] and "speed_rpm" in inputs:
            one = replace(one, verdict="input")
        found.append(one)
    has_energy = any(one.name == "energy_kWh" for one in found)
    for signal in signals:
        if signal.energy_kWh is None or (has_energy and signal.channel in OF_THE_DRIVE):
            continue
        name = f"energy_of_{signal.channel.removesuffix('_W')}_kWh"
        one = _compared(name, f"Energy by {_words(signal.channel)}", "kWh", *signal.energy_kWh, {})
        found.append(replace(one, verdict="input") if signal.verdict == "input" else one)
    return tuple(found)


def evidence(figures: Sequence[FigureComparison]) -> tuple[FigureComparison, ...]:
    """Return the figures that are judged."""
    without: Container[str] = ("input", "not comparable", "not judged")
    return tuple(one for one in figures if one.verdict not in without)


def _compared(
    name: str, label: str, unit: str, a: float, b: float, given: Mapping[str, float]
) -> FigureComparison:
    tolerance = tolerance_of_figure(name, b, given)
    percent = 100.0 * (a - b) / abs(b) if b != 0.0 else None
    # what follows from sums may be off by their rounding
    slack = 1e-9 * max(abs(a), abs(b))
    agrees = bool(np.abs(a - b) <= tolerance.value + slack)
    return FigureComparison(
        name, label, unit, a, b, percent, tolerance, "agrees" if agrees else "differs"
    )


def _place(record: Record, motor: Motor) -> str:
    """Where the electrical power was taken, in words; empty if it was not."""
    try:
        formula = electrical_power(record, motor).formula
    except InputError:
        return ""
    return next((place.partition(":")[0] for place in (DC, TERMINALS) if place in formula), "")


def _words(channel: str) -> str:
    return channel.removesuffix("_W").replace("_", " ")
