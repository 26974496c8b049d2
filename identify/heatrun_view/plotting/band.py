"""A predicted course with its 95 % band."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource


@dataclass(frozen=True)
class Band:
    """A predicted course with its 95 % band, in a plot of temperatures.

    Attributes:
        label: For the legend.
        time_s: Times [s], shape (block,).
        median: Predicted reading [degC], shape (block,).
        low: Lower limit [degC], shape (block,).
        high: Upper limit [degC], shape (block,).
        test: The test that it belongs to.
        measured: Measured means of the blocks [degC], NaN where there is none, shape (block,).
    """

    label: str
    time_s: np.ndarray
    median: np.ndarray
    low: np.ndarray
    high: np.ndarray
    test: str
    measured: np.ndarray


def draw_band(plot: Any, band: Band) -> None:
    """Draw a band into the plot of temperatures.

    Args:
        plot: A figure.
        band: The band.
    """
    source = ColumnDataSource(
        {"t": band.time_s, "v": band.median, "low": band.low, "high": band.high}, name="band"
    )
    plot.varea("t", "low", "high", source=source, fill_alpha=0.18, tags=["ink"])
    plot.line("t", "v", source=source, line_width=1.2, tags=["ink"])
