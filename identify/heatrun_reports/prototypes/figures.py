"""Figures of several prototypes: each signal of all over each other, and the differences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.reports.figures import plain

from ..analysis.drive import has, with_powers
from ..figures.plot import CYCLE, finish, line, samples_or_nan, stacked, thin, unit, wording

if TYPE_CHECKING:
    from .confront import Confrontation

PAIR_COLOURS = (6, 3, 4, 7, 5)
"""Colours of the differences, apart from those of the prototypes."""


def overlay(found: Confrontation, motor: Motor, channel: str) -> Figure:
    """Return one signal of all prototypes on one clock, and the differences of the pairs."""
    figure, (top, bottom) = stacked([1.25, 0.75])
    for number, prototype in enumerate(found.prototypes):
        record = _in_window(found, prototype.role, with_powers(prototype.record, motor))
        if not has(record, channel):
            continue
        _band(top, found, number, channel)
        line(top, *samples_or_nan(record, channel), plain(prototype.role), number)
    top.set_ylabel(f"{wording(channel)}\n[{unit(channel)}]", fontsize=8)
    bottom.axhline(0.0, color="0.6", lw=0.6)
    for number, pair in enumerate(found.pairs):
        signal = next((s for s in pair.validation.signals if s.channel == channel), None)
        if signal is None or signal.verdict == "not comparable":
            continue
        common = pair.validation.pair
        clock = common.time_s + found.shift_s[pair.later.role]
        colour = CYCLE[PAIR_COLOURS[number % len(PAIR_COLOURS)]]
        difference = common.ours[channel] - common.theirs[channel]
        bottom.plot(*thin(clock, difference), color=colour, lw=0.8, label=plain(pair.name))
        for limit in (-signal.tolerance.value, signal.tolerance.value):
            bottom.axhline(limit, color=colour, lw=0.7, ls="--")
    bottom.set_ylabel(f"difference\n[{unit(channel, is_difference=True)}]", fontsize=8)
    finish([top, bottom])
    return figure


def networks(found: Confrontation) -> Figure:
    """Return each measured winding with the prediction of the network, and the difference."""
    figure, (top, bottom) = stacked([1.9, 0.95])
    channel = "winding_degC"
    roles = [prototype.role for prototype in found.prototypes]
    bottom.axhline(0.0, color="0.6", lw=0.6)
    for one in found.networks:
        colour = roles.index(one.prototype.role)
        common = one.validation.pair
        clock = common.time_s + found.shift_s[one.prototype.role]
        name = plain(one.prototype.role)
        low, high = one.validation.bands[channel]
        top.fill_between(clock / 60.0, low, high, color=CYCLE[colour % len(CYCLE)], alpha=0.2, lw=0)
        line(top, clock, common.ours[channel], f"{name}, measured", colour)
        top.plot(*thin(clock, common.theirs[channel]), color=CYCLE[colour % len(CYCLE)], lw=0.9,
                 ls="--", label=f"network driven by {plain(one.driven_by)} (95 %)")  # fmt: skip
        line(bottom, clock, common.ours[channel] - common.theirs[channel], name, colour)
    top.set_ylabel("winding [°C]", fontsize=8)
    bottom.set_ylabel("measured −\npredicted [K]", fontsize=8)
    finish([top, bottom])
    return figure


def _in_window(found: Confrontation, role: str, record: Record) -> Record:
    """A record on the clock kept, cut to the time in common."""
    clock = record.time_s + found.shift_s[role]
    inside = (clock >= found.window_s[0]) & (clock <= found.window_s[1])
    channels = {name: values[inside] for name, values in record.channels.items()}
    return Record(record.name, {**channels, "time_s": clock[inside]})


def _band(axis: Axes, found: Confrontation, number: int, channel: str) -> None:
    """The 95 % band of a simulated prototype."""
    prototype = found.prototypes[number]
    if channel not in prototype.reference.bands:
        return
    clock = prototype.record.time_s + found.shift_s[prototype.role]
    inside = (clock >= found.window_s[0]) & (clock <= found.window_s[1])
    low, high = (np.asarray(side)[inside] for side in prototype.reference.bands[channel])
    axis.fill_between(clock[inside] / 60.0, low, high, color=CYCLE[number % len(CYCLE)], alpha=0.2,
                      lw=0, label=f"95 % band of {plain(prototype.role)}")  # fmt: skip
