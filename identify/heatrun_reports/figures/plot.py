"""What the figures of all reports share: size, thinning, labels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from heatrun.bench.channels.schema import CHANNEL

CYCLE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222", "#999933")
"""Okabe and Ito's palette, which colour-blind readers can tell apart, and an olive."""

SYMBOLS = ("u_d", "u_q", "i_d", "i_q")
"""Names that are no words."""

WIDTH_IN = 7.2
LEGEND_CHARACTERS, MARK_CHARACTERS = 120, 7
"""Characters of 7 pt that fit across a panel, and how many of them the mark of a label takes."""

MAX_POINTS = 3000
"""Points of a line: several per pixel of the printed width."""


def stacked(heights: Sequence[float]) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels under each other on one time axis.

    Args:
        heights: Of each panel [in].
    """
    figure = Figure(figsize=(WIDTH_IN, sum(heights) + 0.5), layout="constrained")
    grid = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=list(heights))
    return figure, list(grid[:, 0])


def thin(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a course with fewer points in minutes; lowest and highest of each stretch stay.

    Args:
        time_s: Shape (time,).
        values: Shape (time,).
    """
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


def line(axis: Axes, time_s: np.ndarray, values: np.ndarray, label: str, number: int = 0) -> None:
    """Draw a course over minutes."""
    axis.plot(*thin(time_s, values), color=CYCLE[number % len(CYCLE)], lw=0.9, label=label)


def finish(axes: Sequence[Axes], *, is_over_time: bool = True) -> None:
    """Set what all panels share; the last one carries the time."""
    for axis in axes:
        axis.tick_params(labelsize=8)
        axis.spines["top"].set_visible(False)
        axis.spines["right"].set_visible(False)
        handles, labels = axis.get_legend_handles_labels()
        if labels:
            axis.legend(
                handles, labels, fontsize=7, frameon=False, ncols=_num_columns(labels),
                loc="lower left", bbox_to_anchor=(0.0, 0.99), borderaxespad=0.1,
            )  # fmt: skip
    if is_over_time:
        axes[-1].set_xlabel("time [min]")


def _num_columns(labels: Sequence[str]) -> int:
    """So many columns of a legend as fit over a panel; each is as wide as its longest label."""
    longest = max(len(label) for label in labels) + MARK_CHARACTERS
    return max(1, min(4, len(labels), LEGEND_CHARACTERS // longest))


def unit(channel: str, *, is_difference: bool = False) -> str:
    """Return the unit of a channel as it is printed."""
    symbol = CHANNEL[channel].unit
    if symbol == "degC":
        return "K" if is_difference else "°C"
    return {"L_per_min": "L/min", "km_per_h": "km/h", "Nm": "N m"}.get(symbol, symbol)


def wording(channel: str) -> str:
    """Return the name of a channel without its unit, in words; symbols stay as they are."""
    stem = channel.removesuffix(f"_{_suffix(channel)}")
    if stem in SYMBOLS:
        return stem
    return stem.replace("_", " ").replace("dc ", "DC ")


def _suffix(channel: str) -> str:
    return {"km/h": "km_per_h", "L/min": "L_per_min"}.get(
        CHANNEL[channel].unit, CHANNEL[channel].unit
    )
