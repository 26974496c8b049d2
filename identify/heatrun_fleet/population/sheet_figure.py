"""The figure of a type sheet: each machine before and after, in the limits of its type."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font

from heatrun.io.quantities import printed_unit
from heatrun.reports.figures import COLOURS, finish, plain

from ..results.population import PopulationMachine, PopulationResult

ALONE, GIVEN, OTHER = "0.62", COLOURS["second"], COLOURS["first"]

PER_FIGURE = 4
"""Parameters of a figure; more make further figures."""

MOST_NAMES = 40
"""Machines whose names fit under the panels."""

MOST_MACHINES = 400
"""Machines that are drawn: more are thinned out evenly, but for those that do not fit."""

MOST_MARKED = 12
"""Names inside a panel."""

MOST_ROOM = 2.0
"""What a panel shows beyond the machines, at most, over their range [1]."""

LONGEST_NAME = 14
"""Letters of a machine's name in the figure."""


def type_figures(result: PopulationResult) -> list[Figure]:
    """Return the figures of all parameters."""
    names = list(result.parameters)
    shown = shown_machines(result.machines)
    return [
        _figure(result, names[first : first + PER_FIGURE], shown)
        for first in range(0, len(names), PER_FIGURE)
    ]


def shown_machines(machines: Sequence[PopulationMachine]) -> list[PopulationMachine]:
    """Return the machines that are drawn, in their order.

    Args:
        machines: All of them.
    """
    if len(machines) <= MOST_MACHINES:
        return list(machines)
    every = -(-len(machines) // MOST_MACHINES)
    return [m for place, m in enumerate(machines) if m.is_outlier or place % every == 0]


def _figure(
    result: PopulationResult,
    names: Sequence[str],
    shown: Sequence[PopulationMachine],
) -> Figure:
    has_names = len(shown) <= MOST_NAMES
    height_in = 1.3 * len(names) + (1.1 if has_names else 0.6)
    figure = Figure(figsize=(7.2, height_in), layout="constrained")
    axes = list(figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0])
    for axis, name in zip(axes, names, strict=True):
        _panel(axis, result, name, shown)
    place = np.arange(len(shown))
    axes[-1].set_xlim(-0.7, len(shown) - 0.3)
    if has_names:
        axes[-1].set_xticks(place, [_short(machine.name) for machine in shown], rotation=90)
    else:
        axes[-1].set_xticks([])
        axes[-1].set_xlabel("machines in the order of the fleet", fontsize=8)
    handles, words = axes[0].get_legend_handles_labels()
    figure.legend(handles, words, fontsize=7, frameon=False, ncols=5, loc="outside upper center")
    finish(axes)
    for axis in axes:
        axis.spines["right"].set_visible(False)
        axis.tick_params(labelsize=6 if has_names else 7)
    return figure


def _panel(
    axis: Axes, result: PopulationResult, name: str, shown: Sequence[PopulationMachine]
) -> None:
    said = result.parameters[name]
    low, high = said.tolerance_95_95
    axis.axhspan(low, high, color=GIVEN, alpha=0.10, lw=0, label="tolerance limits 95/95")
    axis.axhline(said.median.value, color=GIVEN, lw=0.6, alpha=0.7)
    own = [machine.parameters[name] for machine in shown]
    is_other = np.array([machine.is_outlier for machine in shown], dtype=bool)
    at = np.arange(len(shown), dtype=float)
    thick = max(0.5, min(2.2, 120.0 / len(shown)))
    apart = 0.18 if len(shown) <= 2 * MOST_NAMES else 0.0
    alone = np.array([entry.alone_interval_95 for entry in own])
    given = np.array([entry.interval_95 for entry in own])
    value = np.array([entry.value for entry in own])
    axis.vlines(
        at - apart, *alone.T, color=ALONE, lw=0.8 * thick, label="its own tests alone (95 %)"
    )
    for mask, colour, label in (
        (~is_other, GIVEN, "given all machines (95 %)"),
        (is_other, OTHER, "does not fit the type"),
    ):
        if mask.any():
            axis.vlines(at[mask] + apart, *given[mask].T, color=colour, lw=thick, label=label)
            axis.plot(at[mask] + apart, value[mask], ".", color=colour, ms=min(4.0, 2.0 + thick))
    _frame(axis, np.concatenate([given.ravel(), [low, high]]), value)
    _mark(axis, name, at + apart, value, shown)
    unit = printed_unit(said.unit)
    axis.set_ylabel(f"{plain(name)}\n[{unit}]" if unit else plain(name), fontsize=7)


def _frame(axis: Axes, ends: np.ndarray, values: np.ndarray) -> None:
    """Show what is given all machines; what is far off is cut: a short test, or too few machines.

    Args:
        axis: The panel.
        ends: Ends of intervals.
        values: What must be seen.
    """
    low, high = float(values.min()), float(values.max())
    reach = MOST_ROOM * max(high - low, 0.1 * abs(high))
    low = max(float(ends.min()), low - reach)
    high = min(float(ends.max()), high + reach)
    room = 0.08 * (high - low) or 0.05 * abs(high) or 1.0
    axis.set_ylim(low - room, high + room)


def _mark(
    axis: Axes, name: str, at: np.ndarray, value: np.ndarray, shown: Sequence[PopulationMachine]
) -> None:
    """Write the names of the machines that differ in this parameter beside them."""
    places = [
        place for place, machine in enumerate(shown)
        if machine.is_outlier and name in machine.different
    ]  # fmt: skip
    places.sort(key=lambda place: -abs(shown[place].parameters[name].distance_sd))
    for number, place in enumerate(sorted(places[:MOST_MARKED])):
        is_left = place > 0.8 * len(shown)
        up = (number % 3 - 1) * 5  # neighbours do not hide each other's names
        axis.annotate(
            _short(shown[place].name), (at[place], value[place]),
            xytext=(-4 if is_left else 4, up), textcoords="offset points",
            ha="right" if is_left else "left", va="center", fontsize=6, color=OTHER,
        )  # fmt: skip


def _short(name: str) -> str:
    """Return a name as the figure has room and letters for it."""
    letters = "".join(c if c == " " or ord(c) in _letters() else f"U+{ord(c):04X}" for c in name)
    cut = letters if len(letters) <= LONGEST_NAME else f"{letters[: LONGEST_NAME - 1]}…"
    return plain(cut)


@cache
def _letters() -> frozenset[int]:
    """Return the letters that the figures' font can draw."""
    return frozenset(get_font(findfont("DejaVu Sans")).get_charmap())
