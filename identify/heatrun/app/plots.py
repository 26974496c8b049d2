"""Linked plots of signals: one plot per unit, one time axis, a cursor that reads all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from bokeh.events import MouseLeave, MouseMove
from bokeh.layouts import gridplot
from bokeh.models import (
    ColumnDataSource,
    CrosshairTool,
    CustomJS,
    Div,
    Range1d,
    Span,
)
from bokeh.plotting import figure

from ..bench.channels.schema import CHANNEL, CHANNELS
from .look import DASHES, Look
from .trace import Trace

NUM_POINTS = 2000
"""Points of a line over the width of the window: more than a laptop's screen has columns."""

HEIGHT_PX = {"degC": 300}
OTHER_HEIGHT_PX = 170

READ = """
const t = cb_obj.x;
const nearest = (xs) => {
  let low = 0, high = xs.length - 1;
  if (high < 0) return -1;
  while (high - low > 1) {
    const mid = (low + high) >> 1;
    if (xs[mid] <= t) low = mid; else high = mid;
  }
  return Math.abs(xs[low] - t) <= Math.abs(xs[high] - t) ? low : high;
};
let rows = "";
for (const [label, unit, sample, source] of lines) {
  const at = nearest(source.data.t);
  const value = at < 0 ? NaN : source.data.v[at];
  const text = Number.isFinite(value) ? value.toPrecision(6).replace(/\\.?0+$/, "") : "–";
  rows += `<tr><td style="overflow-wrap:anywhere">${sample} ${label}</td>`
    + `<td style="text-align:right;padding:0 6px"><b>${text}</b></td><td>${unit}</td></tr>`;
}
readout.text = `<p><b>t = ${t.toFixed(2)} s</b></p><table>${rows}</table>`;
"""
"""Reads every line at the cursor; labels come escaped."""


@dataclass(frozen=True)
class Band:
    """A predicted course with its 95 % band, in a plot of temperatures.

    Attributes:
        label: For the legend.
        time_s: Times [s], shape (block,).
        median: Predicted reading [degC], shape (block,).
        low: Lower limit [degC], shape (block,).
        high: Upper limit [degC], shape (block,).
    """

    label: str
    time_s: np.ndarray
    median: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Plots:
    """Plots in a column, and how they are brought up to date.

    Attributes:
        layout: The column.
        readout: The table of values at the cursor.
        x_range: The time window that all share [s].
        update: Sends what the current window shows.
    """

    layout: Any
    readout: Div
    x_range: Range1d
    update: Callable[[], None]

    @property
    def window(self) -> tuple[float, float]:
        """Begin and end of the time window [s]."""
        return _number(self.x_range.start), _number(self.x_range.end)


def linked_plots(
    traces: Sequence[Trace], bands: Sequence[Band], look: Look, schedule: Callable[..., None]
) -> Plots:
    """Draw traces.

    Args:
        traces: At least one, each with a reading; of several tests if they are laid over each
            other.
        bands: Predicted courses.
        look: Colours.
        schedule: Told a function when the window has changed; calls it soon, and once for many
            changes in a row.
    """
    start = min(float(trace.time_s[0]) for trace in traces)
    end = max(float(trace.time_s[-1]) for trace in traces)
    end = end if end > start else start + 1.0
    x_range = Range1d(
        start=start, end=end, bounds=(start - 0.02 * (end - start), end + 0.02 * (end - start))
    )
    cursor = Span(dimension="height", line_color=look.ink, line_alpha=0.4, line_dash="dashed")
    sources = [ColumnDataSource({"t": [], "v": []}, name="signal") for _ in traces]
    styles = _styles(traces, look)
    readout = Div(
        text=_hint(traces, styles, bands, look), width=320, name="readout",
        styles={"color": look.ink, "font-size": "12px"},
    )  # fmt: skip
    lines = [
        [escape(_label(trace, traces)), escape(_unit(trace)), _sample(colour, dash), source]
        for trace, (colour, dash), source in zip(traces, styles, sources, strict=True)
    ]
    read = CustomJS(args={"lines": lines, "readout": readout}, code=READ)
    leave = CustomJS(args={"readout": readout, "hint": readout.text}, code="readout.text = hint;")

    figures = []
    units = sorted({_unit(trace) for trace in traces}, key=_place)
    for position, unit in enumerate(units):
        is_last = position == len(units) - 1
        plot = figure(
            height=HEIGHT_PX.get(unit, OTHER_HEIGHT_PX) + (30 if is_last else 0),
            sizing_mode="stretch_width",
            x_range=x_range,
            y_axis_label=_axis_label(unit, traces),
            x_axis_label="time [s]" if is_last else None,
            tools="xpan,xwheel_zoom,xbox_zoom,box_zoom,reset,save",
            active_scroll="xwheel_zoom",
            active_drag="xbox_zoom",
            output_backend="canvas",
            min_border_left=70,
            name=f"plot {unit}",
        )
        _paint(plot, look)
        plot.xaxis.visible = is_last
        if unit == "degC":
            for band in bands:
                _draw_band(plot, band, look)
        for trace, (colour, dash), source in zip(traces, styles, sources, strict=True):
            if _unit(trace) == unit:
                plot.line(
                    "t", "v", source=source, line_color=colour, line_dash=dash, line_width=1.4
                )
        plot.add_tools(CrosshairTool(overlay=cursor))
        plot.js_on_event(MouseMove, read)
        plot.js_on_event(MouseLeave, leave)
        figures.append(plot)
    layout = gridplot(
        [[plot] for plot in figures], merge_tools=True, sizing_mode="stretch_width",
        toolbar_location="right", toolbar_options={"logo": None},
    )  # fmt: skip

    def update() -> None:
        window = _number(x_range.start), _number(x_range.end)
        for trace, source in zip(traces, sources, strict=True):
            t, v = trace.window(*window, NUM_POINTS)
            source.data = {"t": t, "v": v}

    update()

    def changed(attr: str, old: float, new: float) -> None:
        schedule(update)

    x_range.on_change("start", changed)
    x_range.on_change("end", changed)
    return Plots(layout, readout, x_range, update)


def _number(value: Any) -> float:
    return float(value)


def _styles(traces: Sequence[Trace], look: Look) -> list[tuple[str, str]]:
    """Return colour and dash of each line: a colour per channel of a unit, a dash per test.

    More channels of a unit than colours go on with the next dash.
    """
    tests = list(dict.fromkeys(trace.test for trace in traces))
    seen: dict[str, list[str]] = {}
    for trace in traces:
        channels = seen.setdefault(_unit(trace), [])
        if trace.channel not in channels:
            channels.append(trace.channel)
    found = []
    for trace in traces:
        turn, colour = divmod(seen[_unit(trace)].index(trace.channel), len(look.palette))
        dash = DASHES[(tests.index(trace.test) + turn) % len(DASHES)]
        found.append((look.palette[colour], dash))
    return found


def _draw_band(plot: Any, band: Band, look: Look) -> None:
    source = ColumnDataSource(
        {"t": band.time_s, "v": band.median, "low": band.low, "high": band.high}, name="band"
    )
    plot.varea("t", "low", "high", source=source, fill_color=look.ink, fill_alpha=0.18)
    plot.line("t", "v", source=source, line_color=look.ink, line_width=1.2)


def _paint(plot: Any, look: Look) -> None:
    plot.background_fill_color = look.paper
    plot.border_fill_color = look.paper
    plot.outline_line_color = look.faint
    for axis in (plot.xaxis, plot.yaxis):
        axis.axis_label_text_color = look.ink
        axis.axis_label_text_font_style = "normal"
        axis.major_label_text_color = look.ink
        axis.axis_line_color = look.faint
        axis.major_tick_line_color = look.faint
        axis.minor_tick_line_color = None
    for grid in (plot.xgrid, plot.ygrid):
        grid.grid_line_color = look.faint
    plot.xaxis.formatter.use_scientific = False


def _hint(
    traces: Sequence[Trace], styles: Sequence[tuple[str, str]], bands: Sequence[Band], look: Look
) -> str:
    rows = "".join(
        f"<tr><td>{_sample(colour, dash)} {escape(_label(trace, traces))}</td></tr>"
        for trace, (colour, dash) in zip(traces, styles, strict=True)
    )
    rows += "".join(
        f"<tr><td>{_sample(look.ink, 'solid')} {escape(band.label)}</td></tr>" for band in bands
    )
    return (
        f"<table>{rows}</table><p style='opacity:0.7'>The cursor reads all signals. Wheel: zoom. "
        "Drag: zoom to a span. Arrows in the bar: reset.</p>"
    )


def _sample(colour: str, dash: str) -> str:
    """Return a piece of the line for the table beside the plots."""
    pattern = {"solid": "", "dashed": "6", "dotted": "2 3", "dotdash": "2 3 6 3"}.get(dash, "6 3 2")
    return (
        "<svg width='26' height='10'><line x1='0' y1='6' x2='26' y2='6' stroke-width='2' "
        f"stroke='{colour}' stroke-dasharray='{pattern}'/></svg>"
    )


def _place(unit: str) -> int:
    """Return where a unit's plot stands: temperatures first, then as in the schema."""
    units = [channel.unit for channel in CHANNELS]
    return -1 if unit == "degC" else units.index(unit)


def _axis_label(unit: str, traces: Sequence[Trace]) -> str:
    names = {_name(trace) for trace in traces if _unit(trace) == unit}
    return f"{names.pop()} [{unit}]" if len(names) == 1 else f"[{unit}]"


def _unit(trace: Trace) -> str:
    return CHANNEL[trace.channel].unit


def _name(trace: Trace) -> str:
    return trace.channel.removesuffix("_" + _unit(trace)).replace("_", " ")


def _label(trace: Trace, traces: Sequence[Trace]) -> str:
    is_alone = all(other.test == trace.test for other in traces)
    return _name(trace) if is_alone else f"{_name(trace)} · {trace.test}"
