"""Linked plots of signals: one per unit, one time axis, bands, cursors and a choice of a window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from bokeh.events import MouseLeave, MouseMove, SelectionGeometry, Tap
from bokeh.layouts import gridplot
from bokeh.models import (
    BoxSelectTool,
    ColumnDataSource,
    CrosshairTool,
    CustomJS,
    Div,
    Label,
    Range1d,
    Span,
)
from bokeh.plotting import figure

from heatrun.io.quantities import printed_unit
from heatrun.record.channels import CHANNELS

from .look import INK, WIDE, Look
from .trace import (
    HELP,
    HOVER,
    Trace,
    add_legends,
    colours,
    dashes,
    label_of,
    paint,
    sample,
    show_time,
    tests_of,
)

NUM_POINTS = 2000
"""Points of a line over the width of the window: more than a laptop's screen has columns."""

AXIS_PX = 48
LEAST_PX, TALLEST_PX = 92, 420
"""Least height of a plot that can be read, and greatest that is of use."""

NARROWEST_PX = 240
"""Width below which a plot is cut; it takes all the room there is [px]."""

AT_END = 0.002
"""Share of the window within which its end is at the last sample, and goes with it."""

ROOM = 0.02
"""Share of the record that can be seen before its first and behind its last sample."""


@dataclass(frozen=True)
class Told:
    """Whom the plots tell of what the user does, and what the user can do, as HTML."""

    # Gets a function when the window has changed; calls it soon, and once for many changes in a
    # row.
    schedule: Callable[[Callable[[], None]], None]
    # Gets the time [s] of a click, and whether shift was held.
    tapped: Callable[[float, bool], None]
    selected: Callable[[float, float], None]  # Gets begin and end [s] of a selected window.
    help: str = HELP


@dataclass
class Line:
    """A trace in a plot: the colour's number and dash of its line, its points, its sample."""

    trace: Trace
    colour: int
    dash: str
    source: ColumnDataSource = field(
        default_factory=lambda: ColumnDataSource({"t": [], "v": []}, name="signal")
    )
    sample: Div = field(default_factory=lambda: Div(text=""))


class Plots:
    """Plots in a column, and the table of values at the mouse.

    Attributes:
        x_range: The time window that all share [s].
        cursors: Two times that are marked in all plots.
    """

    def __init__(
        self, traces: Sequence[Trace], bands: Sequence[Band], look: Look, height: int, told: Told
    ) -> None:
        """Draw traces.

        Args:
            traces: At least one, each with a reading; of several tests if they are laid over each
                other.
            bands: Predicted courses.
            look: Colours.
            height: Of all plots together [px].
            told: Whom to tell of clicks and selections.
        """
        looks = zip(traces, colours(traces, len(look.palette)), dashes(traces), strict=True)
        self._lines = [Line(*each) for each in looks]
        self._help = told.help
        tests = tests_of(traces)
        self._bands = [
            (band, tests.index(band.test) if len(tests) > 1 and band.test in tests else INK)
            for band in bands
        ]
        start, end = _span(traces)
        self.x_range = Range1d(start=start, end=end, bounds=_bounds(start, end))
        self.x_range.reset_start, self.x_range.reset_end = start, end
        self.cursors = Cursors()
        self.readout = Div(text="", sizing_mode=WIDE, name="readout")
        self._figures: dict[str, Any] = {}
        for unit in sorted({trace.unit for trace in traces}, key=_place):
            self._figures[unit] = self._figure(unit)
        self._draw(told)
        self.layout = gridplot(
            [[plot] for plot in self._figures.values()], merge_tools=True,
            sizing_mode=WIDE, toolbar_location="right", toolbar_options={"logo": None},
        )  # fmt: skip
        self.resize(height)
        self.paint(look)
        self.update()
        for end_of in ("start", "end"):
            self.x_range.on_change(end_of, lambda attr, old, new: told.schedule(self.update))

    @property
    def traces(self) -> list[Trace]:
        """The signals of the lines."""
        return [line.trace for line in self._lines]

    @property
    def window(self) -> tuple[float, float]:
        """Begin and end of the time window [s]."""
        start: Any = self.x_range.start
        end: Any = self.x_range.end
        return float(start), float(end)

    def update(self) -> None:
        """Send what the current window shows."""
        for line in self._lines:
            t, v = line.trace.window(*self.window, NUM_POINTS)
            line.source.data = {"t": t, "v": v}

    def grow(self, traces: Sequence[Trace]) -> None:
        """Show the same signals with more readings; a window at their end goes with it."""
        first, last = _span(self.traces)
        start, end = self.window
        for line, trace in zip(self._lines, traces, strict=True):
            line.trace = trace
        new_first, new_last = _span(traces)
        is_whole = start <= first + AT_END * (last - first)
        is_at_end = end >= last - AT_END * (end - start)
        self.x_range.bounds = _bounds(new_first, new_last)
        self.x_range.reset_start, self.x_range.reset_end = new_first, new_last
        if is_at_end:
            start = new_first if is_whole else start + new_last - end
            self.x_range.update(start=start, end=new_last)
        self.update()

    def move_to(self, start: float, end: float) -> None:
        """Show another window [s]."""
        self.x_range.update(start=start, end=end)
        self.update()

    def resize(self, height: int) -> None:
        """Share a height [px] among the plots; that of temperatures gets twice as much."""
        shares = {unit: 2.0 if unit == "degC" else 1.0 for unit in self._figures}
        each = (height - AXIS_PX) / sum(shares.values())
        for unit, plot in self._figures.items():
            wanted = min(max(shares[unit] * each, LEAST_PX), TALLEST_PX)
            plot.height = round(wanted) + (AXIS_PX if plot.xaxis.visible else 0)

    def paint(self, look: Look) -> None:
        """Show everything in other colours."""
        for plot in self._figures.values():
            paint(plot, look)
        self.cursors.paint(look)
        rows = ""
        for line in self._lines:
            line.sample.text = sample(look.colour(line.colour), line.dash)
            name = escape(label_of(line.trace, self.traces))
            rows += f"<tr><td>{line.sample.text} {name}</td></tr>"
        for band, colour in self._bands:
            piece = sample(look.colour(colour), _dash_of(colour))
            rows += f"<tr><td>{piece} {escape(band.label)}</td></tr>"
        self.readout.text = f"<table>{rows}</table>{self._help}"
        self.readout.tags = [self.readout.text]

    def _figure(self, unit: str) -> Any:
        plot = figure(
            width=NARROWEST_PX, height=LEAST_PX, sizing_mode=WIDE, x_range=self.x_range,
            y_axis_label=f"[{printed_unit(unit)}]" if unit else None,
            tools="xpan,xwheel_zoom,xbox_zoom,box_zoom,reset,save", active_scroll="xwheel_zoom",
            active_drag="xbox_zoom", output_backend="canvas", min_border_left=70,
            min_border_top=2, min_border_bottom=2, name=f"plot {unit}",
        )  # fmt: skip
        # of no lines: it names a window, and selects no readings
        plot.add_tools(BoxSelectTool(dimensions="width", renderers=[], description="Select"))
        plot.xaxis.visible = False
        return plot

    def _draw(self, told: Told) -> None:
        """Fill the plots and connect them."""
        last = list(self._figures.values())[-1]
        last.xaxis.visible = True
        if "degC" in self._figures:
            for band, colour in self._bands:
                draw_band(self._figures["degC"], band, colour)
        traces = self.traces
        drawn = [
            self._figures[line.trace.unit].line(
                "t", "v", source=line.source, line_dash=line.dash, line_width=1.5,
                tags=[line.colour],
            )
            for line in self._lines
        ]  # fmt: skip
        add_legends(self._figures, traces, drawn, [line.dash for line in self._lines])
        lines = [
            [escape(label_of(line.trace, traces)), escape(line.trace.printed_unit), line.sample,
             line.source]
            for line in self._lines
        ]  # fmt: skip
        hover = CustomJS(
            args={"lines": lines, "readout": self.readout, "x_range": self.x_range}, code=HOVER
        )
        leave = CustomJS(args={"readout": self.readout}, code="readout.text = readout.tags[0];")
        for plot in self._figures.values():
            show_time(plot.xaxis[0], self.x_range)
            self.cursors.mark(plot)
            plot.js_on_event(MouseMove, hover)
            plot.js_on_event(MouseLeave, leave)
            plot.on_event(Tap, lambda event: told.tapped(event.x, _has_shift(event)))
            plot.on_event(SelectionGeometry, lambda event: _selected(event, told))


def _selected(event: Any, told: Told) -> None:
    geometry = event.geometry
    if event.final and geometry.get("type") == "rect":
        told.selected(float(geometry["x0"]), float(geometry["x1"]))


def _has_shift(event: Any) -> bool:
    modifiers = getattr(event, "modifiers", None)
    if isinstance(modifiers, dict):
        return bool(modifiers.get("shift"))
    return bool(getattr(modifiers, "shift", False))


def _span(traces: Sequence[Trace]) -> tuple[float, float]:
    start = min(float(trace.time_s[0]) for trace in traces)
    end = max(float(trace.time_s[-1]) for trace in traces)
    return start, end if end > start else start + 1.0


def _bounds(start: float, end: float) -> tuple[float, float]:
    return start - ROOM * (end - start), end + ROOM * (end - start)


def _place(unit: str) -> tuple[int, str]:
    """Return where a unit's plot stands: temperatures first, then as in the schema."""
    units = [channel.unit for channel in CHANNELS]
    if unit == "degC":
        return -1, unit
    return (units.index(unit) if unit in units else len(units)), unit


@dataclass(frozen=True)
class Band:
    """A predicted course with its 95 % band, in a plot of temperatures."""

    label: str  # For the legend.
    time_s: np.ndarray  # Times [s], shape (block,).
    median: np.ndarray  # Predicted reading [degC], shape as `time_s`; so have its limits.
    low: np.ndarray
    high: np.ndarray
    test: str  # The test that it belongs to.
    measured: np.ndarray  # Measured means of the blocks [degC], NaN where there is none.


def draw_band(plot: Any, band: Band, colour: int) -> None:
    """Draw a band into the plot of temperatures, in the colour of a number."""
    source = ColumnDataSource(
        {"t": band.time_s, "v": band.median, "low": band.low, "high": band.high}, name="band"
    )
    plot.varea("t", "low", "high", source=source, fill_alpha=0.18, tags=[colour])
    dash = _dash_of(colour)
    plot.line("t", "v", source=source, line_width=1.2, line_dash=dash, tags=[colour])


def _dash_of(colour: int) -> str:
    """Return the dash of a predicted course, which has the colour of its test where it has one."""
    return "solid" if colour == INK else "dotted"


class Cursors:
    """Two cursors and the line that goes with the mouse.

    Attributes:
        times_s: Where A and B stand [s], None for one that is not set.
    """

    def __init__(self) -> None:
        self.times_s: list[float | None] = [None, None]
        self._mouse = Span(dimension="height", line_alpha=0.4, line_dash="dashed")
        self._marks: tuple[list[tuple[Span, Label]], ...] = ([], [])

    def mark(self, plot: Any) -> None:
        """Let a plot show the cursors."""
        plot.add_tools(CrosshairTool(overlay=self._mouse))
        for name, marks in zip(("A", "B"), self._marks, strict=True):
            mark = Span(dimension="height", line_width=1.5, visible=False)
            label = Label(
                x=0, y=2, y_units="screen", text=name, x_offset=3, visible=False,
                text_font_size="12px", text_font_style="bold",
            )  # fmt: skip
            plot.add_layout(mark)
            plot.add_layout(label)
            marks.append((mark, label))

    def set(self, number: int, time_s: float | None) -> None:
        """Put cursor A (0) or B (1) somewhere [s], or take it away."""
        self.times_s[number] = time_s
        for mark, label in self._marks[number]:
            if time_s is not None:
                mark.location, label.x = time_s, time_s
            mark.visible = label.visible = time_s is not None

    def paint(self, look: Look) -> None:
        """Show them in other colours."""
        self._mouse.line_color = look.ink
        for marks, colour in zip(self._marks, look.cursors, strict=True):
            for mark, label in marks:
                mark.line_color = label.text_color = colour
