"""The figures of the coverage study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from coverage_gates import (
    GROUPS,
    NETWORK,
    NOISE,
    NUM_BINS,
    TIMES,
    Row,
    binomial_limits,
    chosen,
    coverage,
    envelope,
    histogram,
    is_inside,
    rank,
)
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

CELLS = (
    "as declared", "exact instruments", "slower noise", "stronger noise", "noise that doubles",
    "heavy tails", "truncated", "large errors, declared", "large errors, not declared",
    "errors taken as none", "point samples at 1 Hz", "unevenly soaked",
)  # fmt: skip
COLOURS = ("#1f4e79", "#c55a11", "#548235", "#7f6000")


def draw_coverage(rows: Sequence[Row], path: Path) -> None:
    """Draw the coverage of 95 % intervals by cell and parameter, with binomial limits."""
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    axis = figure.subplots()
    shown = [cell for cell in CELLS if chosen(rows, cell, "quick")]
    axis.axvspan(93.0, 97.0, color="#dde8dd", zorder=0)
    axis.axvline(95.0, color="0.4", linewidth=0.8)
    for place, cell in enumerate(shown):
        mine = chosen(rows, cell, "quick")
        for offset, (name, colour) in enumerate(zip(NETWORK, COLOURS, strict=True)):
            share = coverage(rank(mine, "quick", name), 0.95)
            low, high = binomial_limits(share, len(mine))
            height = place + 0.17 * (offset - 1.5)
            label = name if place == 0 else None
            axis.plot([100 * low, 100 * high], [height] * 2, color=colour, linewidth=1.5)
            axis.plot([100 * share], [height], "o", color=colour, markersize=4, label=label)
    ticks = [f"{cell} ({len(chosen(rows, cell, 'quick'))})" for cell in shown]
    axis.set_yticks(range(len(shown)), ticks)
    axis.invert_yaxis()
    axis.set_xlabel("true value inside the 95 % interval [%], with 95 % binomial limits")
    axis.legend(loc="upper left")
    _save(figure, path)


def draw_ranks(rows: Sequence[Row], path: Path) -> None:
    """Draw the rank histograms of the draws from the prior with their envelope."""
    drawn = chosen(rows, "prior draws", "quick")
    if not drawn:
        return
    figure = Figure(figsize=(10.0, 7.0), layout="constrained")
    names = (*NETWORK, *TIMES, *NOISE, "end")
    axes = figure.subplots(-(-len(names) // 4), 4, sharex=True, sharey=True).ravel()
    for spare in axes[len(names) :]:
        spare.set_axis_off()
    for axis, name in zip(axes, names, strict=False):
        ranks = rank(drawn, "quick", name)
        size = next(len(group) for group in GROUPS if name in group)
        low, high = envelope(ranks.size, size)
        axis.axhspan(low, high, color="#dde8dd")
        edges = np.linspace(0.0, 1.0, NUM_BINS + 1)
        axis.stairs(histogram(ranks), edges, color=COLOURS[0])
        word = "" if is_inside(ranks, size) else ", outside"
        axis.set_title(f"{'held-out end' if name == 'end' else name}{word}", fontsize=9)
    figure.supxlabel("share of the posterior below the truth")
    figure.supylabel(f"records of {len(drawn)}")
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=110, metadata={"Software": None})
