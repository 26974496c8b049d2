"""The signals of the chosen tests: linked plots, cursor, bands, and what is seen as CSV."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
import panel as pn

from ...bench.channels.schema import CHANNELS
from ...errors import InputError
from ..look import Look, pane_css
from ..plots import Band, Plots, linked_plots
from ..store import Opened
from ..trace import Trace
from ..words import message

SETTLE_MS = 30
"""Wait after a change of the window: the wheel sends many, one redraw serves them."""

MAX_CELLS = 5_000_000
"""Largest CSV download [cell]; the browser holds it in memory."""


class Signals:
    """The plots of the chosen signals.

    Attributes:
        view: What goes on the page.
    """

    def __init__(self, look: Look) -> None:
        self._look = look
        self._traces: list[Trace] = []
        self._plots: Plots | None = None
        self._is_scheduled = False
        self._plot_place = pn.Column(sizing_mode="stretch_width", min_width=480)
        self._read_place = pn.Column(width=330)
        self._csv = pn.widgets.FileDownload(
            callback=self._as_csv, filename="window.csv", label="CSV of this window",
            button_type="default", width=180, visible=False,
        )  # fmt: skip
        self._problem = pn.pane.HTML("", stylesheets=[pane_css(look)], visible=False)
        self.view = pn.Column(
            pn.Row(self._plot_place, pn.Column(self._csv, self._problem, self._read_place)),
            sizing_mode="stretch_width",
        )

    def show(self, tests: Sequence[Opened], channels: Sequence[str], bands: Sequence[Band]) -> None:
        """Draw channels of tests; the window stays where it covers the same span.

        Args:
            tests: Laid over each other, each from its own time zero.
            channels: Canonical names; a test without one leaves it out.
            bands: Predicted courses.
        """
        traces = [
            Trace.of(each.record.name, channel, each.record.time_s, each.record[channel])
            for channel in _in_order(channels)
            for each in tests
            if channel in each.record
        ]
        self._traces = [trace for trace in traces if trace.time_s.size]
        if not self._traces:
            words = "Choose tests on the left." if not tests else "Choose signals on the left."
            note = pn.pane.HTML(message("note", words), stylesheets=[pane_css(self._look)])
            self._plots, self._csv.visible = None, False
            self._plot_place[:], self._read_place[:] = [note], []
            return
        before = self._plots
        plots = linked_plots(self._traces, bands, self._look, self._schedule)
        if before is not None and before.x_range.bounds == plots.x_range.bounds:
            plots.x_range.start, plots.x_range.end = before.x_range.start, before.x_range.end
            plots.update()
        self._plots, self._csv.visible = plots, True
        self._plot_place[:] = [pn.pane.Bokeh(plots.layout, sizing_mode="stretch_width")]
        self._read_place[:] = [pn.pane.Bokeh(plots.readout)]

    def _schedule(self, update: Any) -> None:
        if self._is_scheduled or pn.state.curdoc is None:
            return
        self._is_scheduled = True

        def settle() -> None:
            self._is_scheduled = False
            update()

        pn.state.curdoc.add_timeout_callback(settle, SETTLE_MS)

    def _as_csv(self) -> io.StringIO:
        """Return all samples in the window, as the file has them, on one column of times."""
        self._problem.visible = False
        try:
            return io.StringIO(self._csv_text())
        except InputError as error:
            self._problem.object, self._problem.visible = message("error", str(error)), True
            return io.StringIO(f"{error}\n")

    def _csv_text(self) -> str:
        assert self._plots is not None
        start, end = self._plots.window
        columns = {}
        for trace in self._traces:
            inside = (trace.time_s >= start) & (trace.time_s <= end)
            is_first = np.diff(trace.time_s[inside], prepend=-np.inf) > 0.0
            times, values = trace.time_s[inside][is_first], trace.value[inside][is_first]
            several = any(other.test != trace.test for other in self._traces)
            name = f"{trace.channel} {trace.test}" if several else trace.channel
            columns[name] = pd.Series(values, index=times)
        if sum(column.size for column in columns.values()) > MAX_CELLS:
            raise InputError(
                f"The window holds more than {MAX_CELLS:,} values.",
                remedy="Zoom in, or choose fewer signals; the whole test is in its own file.",
            )
        table = pd.DataFrame(columns)
        table.index.name = "time_s"
        return table.to_csv(float_format="%.9g")


def _in_order(channels: Sequence[str]) -> list[str]:
    known = [channel.name for channel in CHANNELS]
    return sorted(channels, key=known.index)
