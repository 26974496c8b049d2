"""The signals of the chosen tests: linked plots, and what is seen as CSV.

With them stand the windows of a test that count, cut by mouse and written into the motor file, and
prototypes laid over each other on one clock, each moved to where its signals fit.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import panel as pn

from heatrun.errors import InputError
from heatrun.record.channels import CHANNELS
from heatrun.record.record import Record
from heatrun_reports.analysis.offset import find_offset

from ..background import Latest, Soon, in_order
from ..linked import Band, Plots, Told
from ..look import NARROW_PX, WIDE, Screen, button, on_change, stacked, text_pane
from ..motor_text import (
    Window,
    read_motor_file,
    refuse_sent,
    windows_of,
    windows_text,
    with_window,
    without_window,
    write_motor_file,
    write_windows,
)
from ..store import Opened
from ..trace import Trace, cursor_table, tests_of
from ..words import error_message, message

if TYPE_CHECKING:
    from .page import Page

STEP_S = 0.1
"""Windows are rounded to it [s]: finer than a mouse can choose."""


class Cutting:
    """A form with the windows of a test; hidden until a window is selected."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._spans: dict[str, Window] = {}
        self._shifts_s: Mapping[str, float] = {}
        self._selected: Window | None = None
        self._windows: list[Window] = []
        self._in_file: list[Window] = []
        self._test = pn.widgets.Select(name="Test", sizing_mode=WIDE)
        self._keep = button("Use it", lambda: self._change(with_window), 90)
        self._leave = button("Leave it out", lambda: self._change(without_window), 110)
        clear = button("Start again", lambda: self._set([]), 100)
        self._write = button(
            "Write into the motor file", self._write_file, 200, button_type="primary"
        )
        self._said, self._text, self._result = text_pane(), text_pane(), text_pane()
        self.view = stacked(
            text_pane("<h3>Part of the test that counts</h3>"),
            self._test,
            self._said,
            pn.FlexBox(self._keep, self._leave, clear),
            self._text,
            self._write,
            self._result,
            visible=False,
        )
        on_change(self._begin, self._test)

    def offer(self, tests: Sequence[Opened], shifts_s: Mapping[str, float]) -> None:
        """Take the tests that are shown, and by how much later than in its own time each is [s]."""
        self._shifts_s = shifts_s
        self._spans = {
            each.record.name: (float(each.record.time_s[0]), float(each.record.time_s[-1]))
            for each in tests
        }
        names = list(self._spans)
        if names != self._test.options:
            chosen = self._test.value
            self._test.options = names
            self._test.value = chosen if chosen in names else (names[0] if names else None)

    def select(self, start_s: float, end_s: float) -> None:
        """Take a window that was selected with the mouse, in the times of the plots [s].

        Its begin may lie behind its end.
        """
        first, last = self._spans.get(str(self._test.value), (0.0, 0.0))
        shift_s = self._shifts_s.get(str(self._test.value), 0.0)
        low, high = sorted((start_s - shift_s, end_s - shift_s))
        window = tuple(round(round(min(max(at, first), last) / STEP_S) * STEP_S, 1)
                       for at in (low, high))  # fmt: skip
        if window[1] <= window[0]:
            return
        self._selected = (window[0], window[1])
        if not self.view.visible:
            self._begin()
        self.view.visible = True
        self._result.object = ""
        self._show()

    def _begin(self) -> None:
        """Start from what the motor file says of the test."""
        self._windows, self._in_file = [], []
        try:
            if self._page.motor_path is not None and self._test.value is not None:
                motor = self._page.motor_path
                data = read_motor_file(motor)
                self._in_file = windows_of(data, str(self._test.value), motor.name)
                self._windows = self._in_file
        except InputError as error:
            self._result.object = error_message(error)
        self._show()

    def _change(self, how: Callable[[Sequence[Window], Window], list[Window]]) -> None:
        if self._selected is not None:
            whole = [self._spans[str(self._test.value)]] if how is without_window else []
            self._set(how(self._windows or whole, self._selected))

    def _set(self, windows: list[Window]) -> None:
        self._windows = windows
        self._result.object = ""
        self._show()

    def _show(self) -> None:
        said = "Select a window: “Select” in the bar, then drag."
        if self._selected is not None:
            start, end = self._selected
            said = f"Selected: <b>{start:.1f} … {end:.1f} s</b> ({(end - start) / 60:.2f} min)"
        self._said.object = f"<p>{said}</p>"
        if self._windows:
            lines = windows_text(str(self._test.value), self._windows)
            self._text.object = f"<pre>{escape(lines)}</pre>"
        else:
            self._text.object = message("note", "No window is chosen: all of the test counts.")
        self._write.disabled = not self._windows

    def _write_file(self) -> None:
        try:
            self._result.object = message("note", self._written())
        except InputError as error:
            self._result.object = error_message(error)

    def _written(self) -> str:
        motor, name = self._page.motor_path, str(self._test.value)
        if motor is None:
            raise InputError("Expected a motor file.", remedy="Choose one in the side panel.")
        root = self._page.root
        refuse_sent(root, motor)
        before = read_motor_file(motor)
        if windows_of(before, name, motor.name) != self._in_file:
            self._begin()
            raise InputError(
                f"The parts of '{name}' have changed in the motor file; nothing was written.",
                where=motor.name,
                remedy="Above stands what it says now: choose again, and write that.",
            )
        after = write_windows(before, name, self._windows, motor.name)
        write_motor_file(root, motor, before, after)
        self._in_file = windows_of(after, name, motor.name)
        return f"Written into {motor.name}; the rest of the file is as it was."


class Aligning:
    """The switch and what it found.

    Attributes:
        shifts_s: By name of the test, what is added to its times [s]; 0 for one that is not there.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        """Take whom to tell that the shifts are others."""
        self.shifts_s: Mapping[str, float] = {}
        self._records: tuple[Record, ...] = ()
        self._changed, self._latest = changed, Latest()
        self._switch = pn.widgets.Toggle(name="Align clocks", width=120)
        self._said = text_pane()
        on_change(self._find, self._switch)
        self.view = stacked(self._switch, self._said, visible=False)

    def offer(self, tests: Sequence[Opened]) -> None:
        """Take the tests that are shown; the first keeps its clock."""
        names = [record.name for record in self._records]
        self._records = tuple(each.record for each in tests)
        self.view.visible = len(self._records) > 1
        if names != [record.name for record in self._records]:
            self._latest.forget()
            self.shifts_s, self._said.object = {}, ""
            self._switch.value = False

    def _find(self) -> None:
        records = self._records

        def show(found: tuple[dict[str, float], str] | str) -> None:
            self.shifts_s, self._said.object = ({}, found) if isinstance(found, str) else found
            self._changed()

        if self._switch.value:
            self._said.object = "<p class='faded'>Looking for the offsets …</p>"
            self._latest.ask("clocks", lambda: shifts_of(records), show)
        else:
            self._latest.forget()
            show(({}, ""))


def shifts_of(records: Sequence[Record]) -> tuple[dict[str, float], str]:
    """Return what is added to the times of each test [s], and what is to be said of it as HTML.

    The first keeps its clock. What a command advises is left out: its options are not on the page.
    """
    first, *others = records
    shifts: dict[str, float] = {}
    said = []
    for other in others:
        channels = [name for name in first.channels if name in other and name != "time_s"]
        try:
            found = find_offset(first, other, channels)
        except InputError as error:
            said.append(error_message(InputError(error.problem, where=error.where)))
            continue
        shifts[other.name] = found.offset_s
        said.append(
            f"<p><b>{escape(other.name)}</b> {found.offset_s:+.2f} s ± {found.sd_s:.2f} s on the "
            f"clock of {escape(first.name)} ({escape(found.method)})</p>"
        )
        said += [message("warning", each.message) for each in found.findings]
    return shifts, "".join(said)


MAX_CELLS = 5_000_000
"""Largest CSV download [cell]; the browser holds it in memory."""

ABOVE_PX = 120
"""What stands above and below the plots [px]: header, tabs, margins."""

LEAST_PX = 340
READOUT_PX = 310


class Signals:
    """The plots of the chosen signals."""

    def __init__(self, cutting: Cutting, redraw: Callable[[], None]) -> None:
        """Take the form that selected windows go to, and what shows everything again."""
        self._screen = Screen()
        self._plots: Plots | None = None
        self._soon = Soon()
        self._cutting = cutting
        self._aligning = Aligning(redraw)
        self._plot_place, self._read_place = stacked(), stacked()
        self._csv = pn.widgets.FileDownload(
            callback=self._as_csv, filename="window.csv", label="CSV of this window",
            button_type="default", width=170,
        )  # fmt: skip
        self._no_cursors = button("Clear cursors", self._clear_cursors, 110, visible=False)
        self._cursor_table = text_pane()
        self._problem = text_pane(visible=False)
        self._side = pn.Column(
            pn.FlexBox(self._csv, self._no_cursors), self._problem, self._aligning.view,
            self._read_place,
            self._cursor_table, cutting.view, visible=False,
        )  # fmt: skip
        self.view = stacked()
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

        The tests are laid over each other, each from its own time zero; one without a channel
        leaves it out. Others are columns that are no channel, bands predicted courses.
        """
        self._aligning.offer(tests)
        self._cutting.offer(tests, self._aligning.shifts_s)
        traces = self._traces_of(tests, channels, others)
        self._say_undrawn(tests, others)
        if not traces:
            words = f"Choose {'signals' if tests else 'tests'} in the side panel."
            self._plots, self._side.visible = None, False
            self._plot_place[:], self._read_place[:] = [text_pane(message("note", words))], []
            return
        before = self._plots
        told = Told(self._soon, self._tapped, self._cutting.select)
        shifts_s = self._aligning.shifts_s
        bands = [replace(band, time_s=band.time_s + shifts_s.get(band.test, 0.0)) for band in bands]
        plots = Plots(traces, bands, self._screen.look, self._height, told)
        if before is not None and before.x_range.bounds == plots.x_range.bounds:
            plots.move_to(*before.window)
        for number, time_s in enumerate(before.cursors.times_s if before is not None else ()):
            plots.cursors.set(number, time_s)
        self._plots, self._side.visible = plots, True
        self._plot_place[:] = [pn.pane.Bokeh(plots.layout, sizing_mode=WIDE)]
        self._read_place[:] = [pn.pane.Bokeh(plots.readout, sizing_mode=WIDE)]
        self._say_cursors()

    def grow(self, tests: Sequence[Opened], channels: Sequence[str], others: Sequence[str]) -> bool:
        """Show what has come to the tests; return False where the lines are not the same ones."""
        traces = self._traces_of(tests, channels, others)
        if self._plots is None or _identities(traces) != _identities(self._plots.traces):
            return False
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
        self._side.sizing_mode = WIDE if is_narrow else None
        parts = (self._plot_place, self._side)
        kind = pn.Column if is_narrow else pn.Row
        if not self.view or not isinstance(self.view[0], kind):
            self.view[:] = [kind(*parts, sizing_mode=WIDE)]

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
        if np.isfinite(time_s):
            self._set_cursors({int(is_second): float(time_s)})

    def _clear_cursors(self) -> None:
        self._set_cursors({0: None, 1: None})

    def _set_cursors(self, times_s: Mapping[int, float | None]) -> None:
        if self._plots is not None:
            with in_order():
                for number, time_s in times_s.items():
                    self._plots.cursors.set(number, time_s)
            self._say_cursors()

    def _say_cursors(self) -> None:
        assert self._plots is not None
        a_s, b_s = self._plots.cursors.times_s
        start, end = self._plots.window
        self._no_cursors.visible = a_s is not None or b_s is not None
        self._cursor_table.object = cursor_table(self._plots.traces, a_s, b_s, end - start)

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
        traces = self._plots.traces
        several = len(tests_of(traces)) > 1
        columns = {}
        for trace in traces:
            inside = (trace.time_s >= start) & (trace.time_s <= end)
            is_first = np.diff(trace.time_s[inside], prepend=-np.inf) > 0.0
            times, values = trace.time_s[inside][is_first], trace.value[inside][is_first]
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
