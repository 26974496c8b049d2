"""Figures of a validation: each signal of both prototypes over each other, and the difference."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from heatrun.reports.sheet.figures import plain

from ..analysis.compare_signals import SignalComparison
from ..analysis.pair import Pair
from .plot import CYCLE, finish, line, stacked, thin, unit, wording


def overlay(
    pair: Pair,
    row: SignalComparison,
    bands: Mapping[str, tuple[np.ndarray, np.ndarray]],
) -> Figure:
    """Return one signal of both prototypes, and their difference with the tolerance."""
    name = row.channel
    figure, (top, bottom) = stacked([1.55, 0.85])
    if name in bands:
        top.fill_between(pair.time_s / 60.0, *bands[name], color=CYCLE[0], alpha=0.2, lw=0,
                         label="95 % band of the reference")  # fmt: skip
    line(top, pair.time_s, pair.theirs[name], f"reference: {plain(pair.reference)[:40]}", 0)
    line(top, pair.time_s, pair.ours[name], f"test: {plain(pair.test)[:40]}", 1)
    top.set_ylabel(f"{wording(name)}\n[{unit(name)}]", fontsize=8)
    bottom.axhspan(-row.tolerance.value, row.tolerance.value, color=CYCLE[2], alpha=0.15, lw=0)
    bottom.axhline(0.0, color="0.6", lw=0.6)
    bottom.plot(*thin(pair.time_s, pair.ours[name] - pair.theirs[name]), color=CYCLE[6], lw=0.8)
    bottom.set_ylabel(f"difference\n[{unit(name, is_difference=True)}]", fontsize=8)
    finish([top, bottom])
    return figure
