"""The signals of the chosen tests: linked plots, cursors, bands, and what is seen as CSV."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import panel as pn

from heatrun.bench.channels.schema import CHANNELS
from heatrun.errors import InputError

from ..background import Soon, in_order
from ..frame import Screen
from ..look import NARROW_PX
from ..pane import text_pane
from ..plotting.band import Band
from ..plotting.linked import Plots, Told
from ..plotting.readout import cursor_table
from ..plotting.trace import Trace
from ..store import Opened
from ..words import message
from .aligning import Aligning
from .cutting import Cutting

MAX_CELLS = 5_000_000
"""Largest CSV download [cell]; the browser holds it in memory."""

ABOVE_PX = 120
"""What stands above and below the plots [px]: header, tabs, margins."""

LEAST_PX = 340
READOUT_PX = 310


class Signals:
    """The plots of the chosen signals.

    Attributes:
        view: What goes on the page.
    """

    def __init__(self, cutting: Cutting, redraw: Callable[[], None]) -> None:
        """Take the form that selected windows go to, and what shows everything again."""
        self._screen = Screen()
        self._traces: list[Trace] = []
        self._shown: list[tuple[str, str]] = []
        self._plots: Plots | None = None
        self._soon = Soon()
        self._cutting = cutting
        self._aligning = Aligning(redraw)
        self._plot_place = pn.Column(sizing_mode="stretch_width")
        self._read_place = pn.Column(sizing_mode="stretch_width")
        self._csv = pn.widgets.FileDownload(
            callback=self._as_csv, filename="window.csv", label="CSV of this window",
            button_type="default", width=170,
        )  # fmt: skip
        self._no_cursors = pn.widgets.Button(name="Clear cursors", width=110, visible=False)
        self._no_cursors.on_click(lambda _: self._clear_cursors())
        self._cursor_table = text_pane()
        self._problem = text_pane(visible=False)
        self._side = pn.Column(
            pn.FlexBox(self._csv, self._no_cursors), self._problem, self._aligning.view,
            self._read_place,
            self._cursor_table, cutting.view, visible=False,
        )  # fmt: skip
        self.view = pn.Column(sizing_mode="stretch_width")
        self._arrange()

    def look_like(self, screen: Screen) -> None:
        """Show everything as the browser has room and colours."""
        self._screen = screen
        if self._plots is not None:
            with in_order():
                self._plots.paint(screen.look)
                self._plots.resize(self._height)
        self._arrange()

    def show(
        self, tests: Sequence[Opened], channels: Sequence[str], others: Sequence[str],
        bands: Sequence[Band],
    ) -> None:  # fmt: skip
        """Draw channels of tests; the window stays where it covers the same span.

        Args:
            tests: Laid over each other, each from its own time zero.
            channels: Canonical names; a test without one leaves it out.
            others: Names of columns that are no channel.
            bands: Predicted courses.
        """
        self._aligning.offer(tests)
        self._cutting.offer(tests, self._aligning.shifts_s)
        self._traces = self._traces_of(tests, channels, others)
        self._say_undrawn(tests, others)
        if not self._traces:
            words = "Choose tests on the left." if not tests else "Choose signals on the left."
            self._plots, self._side.visible, self._shown = None, False, []
            self._plot_place[:], self._read_place[:] = [text_pane(message("note", words))], []
            return
        before = self._plots
        told = Told(self._soon, self._tapped, self._selected)
        shifts_s = self._aligning.shifts_s
        bands = [replace(band, time_s=band.time_s + shifts_s.get(band.test, 0.0)) for band in bands]
        plots = Plots(self._traces, bands, self._screen.look, self._height, told)
        if before is not None and before.x_range.bounds == plots.x_range.bounds:
            plots.move_to(*before.window)
        for number, time_s in enumerate(before.cursors.times_s if before is not None else ()):
            plots.cursors.set(number, time_s)
        self._plots, self._side.visible = plots, True
        self._shown = _identities(self._traces)
        self._plot_place[:] = [pn.pane.Bokeh(plots.layout, sizing_mode="stretch_width")]
        self._read_place[:] = [pn.pane.Bokeh(plots.readout, sizing_mode="stretch_width")]
        self._say_cursors()

    def grow(self, tests: Sequence[Opened], channels: Sequence[str], others: Sequence[str]) -> bool:
        """Show what has come to the tests; return False where the lines are not the same ones.

        Args:
            tests: As `show`.
            channels: As `show`.
            others: As `show`.
        """
        traces = self._traces_of(tests, channels, others)
        if self._plots is None or _identities(traces) != self._shown:
            return False
        self._traces = traces
        self._cutting.offer(tests, self._aligning.shifts_s)
        with in_order():
            self._plots.grow(traces)
        self._say_cursors()
        return True

    @property
    def _height(self) -> int:
        return max(self._screen.height - ABOVE_PX, LEAST_PX)

    def _arrange(self) -> None:
        """Put the readings beside the plots, or below them where there is no room."""
        is_narrow = self._screen.width < NARROW_PX
        # no width of its own: the layouts above would keep it as the least that they need
        self._side.styles = {} if is_narrow else {"flex": f"0 0 {READOUT_PX}px"}
        self._side.sizing_mode = "stretch_width" if is_narrow else None
        parts = (self._plot_place, self._side)
        kind = pn.Column if is_narrow else pn.Row
        if not self.view or not isinstance(self.view[0], kind):
            self.view[:] = [kind(*parts, sizing_mode="stretch_width")]

    def _traces_of(
        self, tests: Sequence[Opened], channels: Sequence[str], others: Sequence[str]
    ) -> list[Trace]:
        time_s = {id(each): self._time_of(each) for each in tests}
        traces = [
            Trace.of(each.record.name, channel, time_s[id(each)], each.record[channel])
            for channel in _in_order(channels)
            for each in tests
            if channel in each.record
        ]
        traces += [
            Trace.of(each.record.name, name, time_s[id(each)], other.values, other.unit)
            for name in others
            for each in tests
            if each.others is not None and (other := each.others.get(name)) is not None
        ]
        return [trace for trace in traces if trace.time_s.size]

    def _say_undrawn(self, tests: Sequence[Opened], others: Sequence[str]) -> None:
        held = {name for each in tests for name in each.others or ()}
        names = [name for name in others if name not in held]
        words = f"{', '.join(names)}: no numbers on the test's time axis, nothing to draw."
        self._problem.object = message("note", words) if names else ""
        self._problem.visible = bool(names)

    def _time_of(self, test: Opened) -> np.ndarray:
        """Return the times at which a test is shown [s], shape (time,)."""
        shift_s = self._aligning.shifts_s.get(test.record.name, 0.0)
        return test.record.time_s + shift_s if shift_s else test.record.time_s

    def _tapped(self, time_s: float, is_second: bool) -> None:
        if self._plots is not None and np.isfinite(time_s):
            with in_order():
                self._plots.cursors.set(1 if is_second else 0, float(time_s))
            self._say_cursors()

    def _clear_cursors(self) -> None:
        if self._plots is not None:
            with in_order():
                self._plots.cursors.set(0, None)
                self._plots.cursors.set(1, None)
            self._say_cursors()

    def _say_cursors(self) -> None:
        assert self._plots is not None
        a_s, b_s = self._plots.cursors.times_s
        start, end = self._plots.window
        self._no_cursors.visible = a_s is not None or b_s is not None
        self._cursor_table.object = cursor_table(self._traces, a_s, b_s, end - start)

    def _selected(self, start_s: float, end_s: float) -> None:
        self._cutting.select(start_s, end_s)

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


def _identities(traces: Sequence[Trace]) -> list[Any]:
    return [(trace.test, trace.channel, trace.unit) for trace in traces]


def _in_order(channels: Sequence[str]) -> list[str]:
    known = [channel.name for channel in CHANNELS]
    return sorted(channels, key=known.index)
