"""Figures of the reports: courses over time, torque-speed plane, two prototypes over each other."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from heatrun.record.channels import CHANNEL
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.samples import has, integral, samples
from heatrun.reports.figures import GAP_IN, plain, stack

from .analysis.drive import OperatingMap, bridged_steps, electrical_power, measured, with_powers
from .analysis.pair import Pair
from .analysis.validation import SignalComparison
from .report import unit
from .simulated import Limits

CYCLE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222", "#999933")
"""Okabe and Ito's palette, which colour-blind readers can tell apart, and an olive."""

SYMBOLS = ("u_d", "u_q", "i_d", "i_q")
"""Names that are no words."""

WIDTH_IN = 7.2
LEGEND_CHARACTERS, MARK_CHARACTERS = 120, 7
"""Characters of 7 pt that fit across a panel, and how many of them the mark of a label takes."""

ROW_IN = 0.14
"""Height of a line of a legend [in]."""

MAX_POINTS = 3000
"""Points of a line: several per pixel of the printed width."""


def stacked(*panels: tuple[str, float]) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels, with label and height [in], under each other on one time axis."""
    heights = [height for _, height in panels]
    figure = Figure(figsize=(WIDTH_IN, sum(heights) + 0.4))
    grid = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)
    axes = list(grid[:, 0])
    for axis, (label, _) in zip(axes, panels, strict=True):
        axis.set_ylabel(label, fontsize=8)
    return figure, axes


def with_differences(channel: str, *heights: float) -> tuple[Figure, list[Axes]]:
    """Return panels of a signal and, below, of differences in it."""
    label, below = (unit(channel, is_difference=is_below) for is_below in (False, True))
    above = f"{wording(channel)}\n[{label}]"
    figure, axes = stacked((above, heights[0]), (f"difference\n[{below}]", heights[1]))
    axes[1].axhline(0.0, color="0.6", lw=0.6)
    return figure, axes


def thin(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a course with fewer points in minutes; lowest and highest of each stretch stay."""
    if values.size <= MAX_POINTS:
        return time_s / 60.0, values
    width = 2 * values.size // MAX_POINTS + 1
    starts = np.arange(0, values.size, width)
    filled = np.where(np.isfinite(values), values, 0.0)
    kept = [
        starts[k] + pick(filled[start : start + width])
        for k, start in enumerate(starts)
        for pick in (np.argmin, np.argmax)
    ]
    order = np.unique(kept)
    return time_s[order] / 60.0, values[order]


def line(
    axis: Axes, time_s: np.ndarray, values: np.ndarray, label: str = "", number: int = 0,
    **look: Any,
) -> None:  # fmt: skip
    """Draw a course over minutes, in the colour of a number."""
    look = {"color": CYCLE[number % len(CYCLE)], "lw": 0.9, "label": label, **look}
    axis.plot(*thin(time_s, values), **look)


def band(
    axis: Axes, time_s: np.ndarray, sides: Limits, label: str = "", number: int = 0,
    alpha: float = 0.2,
) -> None:  # fmt: skip
    """Draw what lies between two courses over minutes, in the colour of a number."""
    colour = CYCLE[number % len(CYCLE)]
    axis.fill_between(time_s / 60.0, *sides, color=colour, alpha=alpha, lw=0, label=label)


def finish(axes: Sequence[Axes], *, is_over_time: bool = True) -> None:
    """Set what all panels share; the last one carries the time."""
    above = []
    for axis in axes:
        axis.tick_params(labelsize=8)
        axis.spines["top"].set_visible(False)
        axis.spines["right"].set_visible(False)
        handles, labels = axis.get_legend_handles_labels()
        above.append(GAP_IN)
        if labels:
            num_columns = _num_columns(labels)
            above[-1] += ROW_IN * -(-len(labels) // num_columns)
            axis.legend(
                handles, labels, fontsize=7, frameon=False, ncols=num_columns,
                loc="lower left", bbox_to_anchor=(0.0, 0.99), borderaxespad=0.1,
            )  # fmt: skip
    if is_over_time:
        axes[-1].set_xlabel("time [min]")
        stack(axes[0].figure, axes, above)  # pyright: ignore[reportArgumentType]


def _num_columns(labels: Sequence[str]) -> int:
    """So many columns of a legend as fit over a panel; each is as wide as its longest label."""
    longest = max(len(label) for label in labels) + MARK_CHARACTERS
    return max(1, min(4, len(labels), LEGEND_CHARACTERS // longest))


def wording(channel: str) -> str:
    """Return the name of a channel without its unit, in words; symbols stay as they are."""
    symbol = CHANNEL[channel].unit
    suffix = {"km/h": "km_per_h", "L/min": "L_per_min"}.get(symbol, symbol)
    stem = channel.removesuffix(f"_{suffix}")
    return stem if stem in SYMBOLS else stem.replace("_", " ").replace("dc ", "DC ")


PANELS = (
    ("vehicle_speed_km_per_h",),
    ("speed_rpm",),
    ("torque_Nm",),
    ("dc_power_W", "electrical_power_W", "mechanical_power_W", "losses_W"),
    ("dc_voltage_V", "u_d_V", "u_q_V"),
    ("dc_current_A", "phase_current_A", "i_d_A", "i_q_A"),
    (
        "winding_degC", "stator_degC", "yoke_degC", "tooth_degC", "end_winding_degC",
        "housing_degC", "rotor_degC", "magnet_degC", "bearing_degC", "controller_degC",
        "coolant_degC", "coolant_out_degC", "ambient_degC",
    ),
    ("coolant_flow_L_per_min",),
    ("fan",),
)  # fmt: skip
"""Which channels share a panel, from drive to temperatures."""

QUANTITY = {
    "rpm": "speed", "N m": "torque", "W": "power", "V": "voltage", "A": "current",
    "°C": "temperature", "km/h": "road speed", "L/min": "coolant flow", "1": "fan",
}  # fmt: skip
"""What a panel shows, by the unit of its signals."""


def courses(record: Record, motor: Motor) -> Figure:
    """Return all signals of a record over time, like with like."""
    full = with_powers(record, motor)
    panels = [[c for c in names if has(full, c)] for names in PANELS]
    panels = [names for names in panels if names]
    symbols = [unit(names[0]) for names in panels]
    figure, axes = stacked(
        *((f"{QUANTITY[each]}\n[{each}]", 1.5 if each == "°C" else 0.9) for each in symbols)
    )
    for axis, names in zip(axes, panels, strict=True):
        for number, name in enumerate(names):
            line(axis, *with_gaps(*samples(full, name)), wording(name), number)
    finish(axes)
    return figure


def energy_course(record: Record, motor: Motor) -> Figure:
    """Return power and energy drawn so far, with and without regeneration.

    Raises:
        InputError: If no electrical power was recorded.
    """
    time_s, values = measured(record, electrical_power(record, motor).values)
    steps = bridged_steps(time_s)
    figure, (top, bottom) = stacked(("power [kW]", 1.2), ("energy so far [Wh]", 1.35))
    line(top, time_s, values / 1000.0, "electrical power")
    top.axhline(0.0, color="0.6", lw=0.6)
    for number, (label, power) in enumerate(
        (("energy", values), ("without regeneration", np.maximum(values, 0.0)))
    ):
        line(bottom, time_s, integral(power, steps) / 3600.0, label, number)
    finish([top, bottom])
    return figure


def plane(record: Record, found: OperatingMap | None) -> Figure:
    """Return the torque-speed plane: operating points, and power and efficiency where known."""
    num_panels = 1 if found is None else 3
    figure = Figure(figsize=(WIDTH_IN, 2.15 if num_panels == 3 else 2.55), layout="constrained")
    panels = figure.subplots(1, num_panels, sharey=True, squeeze=False)[0]
    time_s, speed, torque = samples(record, "speed_rpm", "torque_Nm")
    order = np.linspace(0, time_s.size - 1, min(time_s.size, 4000)).astype(int)
    points = panels[0].scatter(
        speed[order], torque[order], c=time_s[order] / 60.0, s=3, cmap="viridis", rasterized=True
    )
    _colour_bar(figure, panels[0], points, "time [min]")
    panels[0].set_ylabel("torque [N m]", fontsize=8)
    panels[0].set_title("operating points", fontsize=8, loc="left")
    if found is not None:
        known = found.efficiency[np.isfinite(found.efficiency)]
        least = float(np.quantile(known, 0.1)) - 0.05 if known.size else 0.0
        limits = {"cmap": "viridis", "vmin": max(0.0, 100.0 * least), "vmax": 100.0}
        for axis, values, look, title, label in (
            (panels[1], found.power_W / 1000.0, {"cmap": "cividis"}, "electrical power",
             "mean power [kW]"),
            (panels[2], 100.0 * found.efficiency, limits, "efficiency", "efficiency [%]"),
        ):  # fmt: skip
            drawn = axis.pcolormesh(found.speed_rpm, found.torque_Nm, values, **look)
            _colour_bar(figure, axis, drawn, label)
            axis.set_title(title, fontsize=8, loc="left")
    for axis in panels:
        axis.set_xlabel("speed [rpm]", fontsize=8)
    finish(list(panels), is_over_time=False)
    return figure


def with_gaps(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a course for drawing: gaps stay open."""
    gaps = np.flatnonzero(bridged_steps(time_s) == 0.0)
    middle = 0.5 * (time_s[gaps] + time_s[gaps + 1])
    return np.insert(time_s, gaps + 1, middle), np.insert(values, gaps + 1, np.nan)


def _colour_bar(figure: Figure, axis: Axes, drawn, label: str) -> None:
    bar = figure.colorbar(drawn, ax=axis, location="bottom", shrink=0.9, pad=0.02)
    bar.set_label(label, fontsize=7)
    bar.ax.tick_params(labelsize=7)


def overlay(pair: Pair, row: SignalComparison, bands: Mapping[str, Limits]) -> Figure:
    """Return one signal of both prototypes, and their difference with the tolerance."""
    name, time_s = row.channel, pair.time_s
    figure, (top, bottom) = with_differences(name, 1.25, 0.7)
    if name in bands:
        band(top, time_s, bands[name], "95 % band of the reference")
    line(top, time_s, pair.theirs[name], f"reference: {plain(pair.reference)[:40]}", 0)
    line(top, time_s, pair.ours[name], f"test: {plain(pair.test)[:40]}", 1)
    bottom.axhspan(-row.tolerance.value, row.tolerance.value, color=CYCLE[2], alpha=0.15, lw=0)
    line(bottom, time_s, pair.ours[name] - pair.theirs[name], number=6, lw=0.8)
    finish([top, bottom])
    return figure
