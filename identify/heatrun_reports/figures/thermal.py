"""Figures of the thermal report: temperatures, measured against simulated, losses, heat flows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from heatrun.record.record import Record
from heatrun.runs.equilibrium import Equilibrium, SteadyRise

from ..analysis.drive import LossSplit, has
from ..bench_test_types import NOT_OF_THE_MACHINE
from ..simulated import Simulated
from .plot import CYCLE, finish, line, samples_or_nan, stacked, unit, wording

CONTINUED = 3.0
"""A course is drawn on for so many of its time constants [1], at most twice as long as the test."""


def temperatures(
    record: Record, behaviour_channels: tuple[str, ...], sink: str,
    continued: Sequence[Equilibrium] = (),
) -> Figure:  # fmt: skip
    """Return all temperatures of a test over time, what some would have come to, and below the
    rises over a sink where it was measured.
    """
    rises = [
        (number, channel)
        for number, channel in enumerate(behaviour_channels)
        if channel not in NOT_OF_THE_MACHINE and has(record, channel, sink)
    ]
    figure, (axis, *below) = stacked([2.0, 1.05] if rises else [2.3])
    for number, channel in rises:
        made = Record(record.name, {"time_s": record.time_s, "K": record[channel] - record[sink]})
        line(below[0], *samples_or_nan(made, "K"), wording(channel), number)
        below[0].set_ylabel(f"rise over\n{wording(sink)} [K]", fontsize=8)
    for number, channel in enumerate(behaviour_channels):
        line(axis, *samples_or_nan(record, channel), wording(channel), number)
    for each in continued:
        if isinstance(each.steady, SteadyRise):
            _continue(axis, each, each.steady, behaviour_channels.index(each.channel), record)
    axis.set_ylabel(f"temperature [{unit('winding_degC')}]", fontsize=8)
    finish([axis, *below])
    return figure


def _continue(
    axis: Axes, found: Equilibrium, steady: SteadyRise, number: int, record: Record
) -> None:
    colour = CYCLE[number % len(CYCLE)]
    span_s = min(CONTINUED * steady.tau_s, 2.0 * record.duration_s)
    time_s = np.linspace(steady.end_s, steady.end_s + span_s, 100)
    low, middle, high = (found.sink_degC + side for side in steady.course(time_s))
    axis.fill_between(time_s / 60.0, low, high, color=colour, alpha=0.2, lw=0)
    axis.plot(time_s / 60.0, middle, color=colour, lw=1.0, ls="--",
              label=f"{wording(found.channel)}, extrapolated (95 %)")  # fmt: skip


def losses(record: Record, split: LossSplit) -> Figure:
    """Return P_Js and P_ol over time."""
    figure, (axis,) = stacked([1.5])
    for number, (label, values) in enumerate(
        (("P_Js, winding", split.joule_W), ("P_ol, others", split.other_W))
    ):
        made = Record(record.name, {"time_s": record.time_s, "loss": values})
        line(axis, *samples_or_nan(made, "loss"), label, number)
    axis.axhline(0.0, color="0.6", lw=0.6)
    axis.set_ylabel("losses [W]", fontsize=8)
    finish([axis])
    return figure


def against(simulated: Simulated) -> Figure:
    """Return measured against simulated winding with bands, and the residuals."""
    figure, (top, bottom) = stacked([2.15, 0.9])
    found = simulated.prediction
    minutes = found.time_s / 60.0
    top.fill_between(minutes, *found.total["95"], color=CYCLE[0], alpha=0.15, lw=0,
                     label="95 % with noise")  # fmt: skip
    top.fill_between(minutes, *found.parameters["95"], color=CYCLE[0], alpha=0.35, lw=0,
                     label="95 % of the parameters")  # fmt: skip
    top.plot(minutes, found.median, color=CYCLE[0], lw=1.1, label="simulated winding")
    top.plot(minutes, found.test.measured, ".", color="#222222", ms=2.2,
             label="measured winding (block means)")  # fmt: skip
    others = [node for node in found.nodes if node != simulated.measured_node]
    for number, node in enumerate(others, start=2):
        colour = CYCLE[number % len(CYCLE)]
        label = "stator Tsr" if node == "stator" else node.replace("_", " ")
        top.fill_between(minutes, *found.nodes_95[node], color=colour, alpha=0.25, lw=0)
        top.plot(minutes, found.nodes[node], color=colour, lw=1.1,
                 label=f"{label}, simulated (95 %)")  # fmt: skip
    top.set_ylabel("temperature [°C]", fontsize=8)
    bottom.axhline(0.0, color="0.6", lw=0.6)
    bottom.plot(minutes, found.residual, color=CYCLE[1], lw=0.9)
    bottom.set_ylabel("measured −\nsimulated [K]", fontsize=8)
    finish([top, bottom])
    return figure


def flows(simulated: Simulated, labels: dict[tuple[str, str], str]) -> Figure:
    """Return the heat flows of the network over time with their bands."""
    figure, (axis,) = stacked([1.5])
    found = simulated.prediction
    minutes = found.time_s / 60.0
    for number, (link, flow) in enumerate(found.flows.items()):
        colour = CYCLE[number % len(CYCLE)]
        axis.fill_between(minutes, *found.flows_95[link], color=colour, alpha=0.25, lw=0)
        axis.plot(minutes, flow, color=colour, lw=1.0, label=labels.get(link, " to ".join(link)))
    axis.set_ylabel("heat flow [W]", fontsize=8)
    if np.any([np.min(flow) < 0.0 for flow in found.flows.values()]):
        axis.axhline(0.0, color="0.6", lw=0.6)
    finish([axis])
    return figure
