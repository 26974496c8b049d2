"""One signal of a test, as much of it as a plot can show, and how plots draw and read it.

Of one test each signal has a colour of its own, which it keeps in every selection; of several each
test has one. Data are in seconds, ticks in seconds, minutes or hours as the window suits.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from bokeh.models import (
    AdaptiveTicker,
    CompositeTicker,
    CustomJS,
    CustomJSTickFormatter,
    Legend,
    LegendItem,
    Range1d,
)
from tsdownsample import MinMaxLTTBDownsampler

from heatrun.io.quantities import printed_unit
from heatrun.record.channels import CHANNEL, CHANNELS
from heatrun_reports.report import NOT_OF_THE_MACHINE

from .look import DASHES, INK, Look
from .words import message

GAP = 5.0
"""Steps without a reading, in medians of the signal's own step, that break the line."""

MARGIN = 0.25
"""Share of the window that is sent on each side of it, so that a pan does not show an edge."""


@dataclass(frozen=True)
class Trace:
    """The readings of one channel, or column that is none, of a test in order of time."""

    test: str
    channel: str
    time_s: np.ndarray  # Times with a reading, ascending [s], shape (reading,).
    value: np.ndarray  # Readings in the unit, shape (reading,).
    step_s: float  # Median step between readings [s].
    unit: str

    @property
    def printed_unit(self) -> str:
        """The unit as it is written on the page."""
        return printed_unit(self.unit)

    @property
    def name(self) -> str:
        """The signal as it is written on the page."""
        if self.channel not in CHANNEL:
            return self.channel
        return self.channel.removesuffix("_" + self.unit).replace("_", " ")

    @classmethod
    def of(
        cls, test: str, channel: str, time_s: np.ndarray, value: np.ndarray, unit: str | None = None
    ) -> Trace:
        """Take a channel of a record, or a column that is none, with its unit.

        Samples that the file does not have are left out; time is put in order where it runs
        backwards.

        Args:
            test: Name of the test.
            channel: As the column is called.
            time_s: Time of each sample [s], shape (time,).
            value: Reading of each sample, NaN where there is none, shape (time,).
            unit: Of a column that is no channel.
        """
        is_read = np.isfinite(value) & np.isfinite(time_s)
        if not is_read.all():
            time_s, value = time_s[is_read], value[is_read]
        steps = np.diff(time_s)
        if steps.size and steps.min() < 0.0:
            order = np.argsort(time_s, kind="stable")
            time_s, value = time_s[order], value[order]
            steps = np.diff(time_s)
        step = float(np.median(steps)) if steps.size else 0.0
        time_s, value = np.ascontiguousarray(time_s), np.ascontiguousarray(value)
        return cls(
            test, channel, time_s, value, step, CHANNEL[channel].unit if unit is None else unit
        )

    def at(self, time_s: float) -> float:
        """Return the reading nearest to a time [s]; NaN where there is none within a usual step."""
        behind = int(np.searchsorted(self.time_s, time_s))
        near = [i for i in (behind - 1, behind) if 0 <= i < self.time_s.size]
        if not near:
            return float("nan")
        best = min(near, key=lambda i: abs(float(self.time_s[i]) - time_s))
        is_near = abs(float(self.time_s[best]) - time_s) <= max(GAP * self.step_s, 1e-9)
        return float(self.value[best]) if is_near else float("nan")

    def window(self, start: float, end: float, num_points: int) -> tuple[np.ndarray, np.ndarray]:
        """Return what a plot of a time window shows.

        Every reading where there are no more than `num_points`; else the least and the greatest
        of each stretch, thinned to the points that keep the shape (MinMaxLTTB, Van Der Donckt et
        al. 2023), each of them a reading of the file. NaN stands in every gap. Times [s] and values
        have a margin on both sides of the window [s].
        """
        margin = MARGIN * (end - start)
        first, last = np.searchsorted(self.time_s, [start - margin, end + margin])
        chosen = slice(max(int(first) - 1, 0), int(last) + 1)
        t, v = self.time_s[chosen], self.value[chosen]
        wanted = int(num_points * (1.0 + 2.0 * MARGIN))
        is_gap = np.diff(t) > GAP * self.step_s
        if t.size > wanted:
            kept = MinMaxLTTBDownsampler().downsample(t, v, n_out=wanted)
            t, v = t[kept], v[kept]
            is_gap = np.diff(np.concatenate([[0], np.cumsum(is_gap)])[kept]) > 0
        where = np.flatnonzero(is_gap) + 1
        return np.insert(t, where, t[where - 1]), np.insert(v, where, np.nan)


MEASURED, MODEL, RESIDUAL = FIT = ("measured", "model", "residual")
"""Lines of a fit."""

BY_UNIT = {c.unit: [each.name for each in CHANNELS if each.unit == c.unit] for c in CHANNELS}

FIXED = {name: number for names in (*BY_UNIT.values(), FIT) for number, name in enumerate(names)}
"""The number of each channel among those of its unit, which share a plot."""


def colours(traces: Sequence[Trace], num_colours: int) -> list[int]:
    """Return the number of each line's colour: its test's where there are several.

    Of one test a channel has its own; another column takes one by its name, or the next that is
    free in its plot.
    """
    tests = tests_of(traces)
    if len(tests) > 1:
        return [tests.index(trace.test) % num_colours for trace in traces]
    taken: dict[str, dict[str, int]] = {}
    for trace in traces:
        if trace.channel in FIXED:
            taken.setdefault(trace.unit, {})[trace.channel] = FIXED[trace.channel] % num_colours
    for trace in traces:
        held = taken.setdefault(trace.unit, {})
        if trace.channel in held:
            continue
        first = zlib.crc32(trace.channel.encode()) % num_colours
        turns = [(first + step) % num_colours for step in range(num_colours)]
        held[trace.channel] = next((turn for turn in turns if turn not in held.values()), first)
    return [taken[trace.unit][trace.channel] for trace in traces]


def tests_of(traces: Sequence[Trace]) -> list[str]:
    """Return the names of the tests, in order."""
    return list(dict.fromkeys(trace.test for trace in traces))


def dashes(traces: Sequence[Trace]) -> list[str]:
    """Return the dash of each line: its channel's in the plot where colours tell tests apart.

    Of one test only a model is dashed: what is measured shows below it.
    """
    if len(tests_of(traces)) == 1:
        return [DASHES[trace.channel == MODEL] for trace in traces]
    held: dict[str, list[str]] = {}
    for trace in sorted(traces, key=lambda trace: trace.channel in NOT_OF_THE_MACHINE):
        if trace.channel not in held.setdefault(trace.unit, []):
            held[trace.unit].append(trace.channel)
    return [DASHES[held[each.unit].index(each.channel) % len(DASHES)] for each in traces]


def sample(colour: str, dash: str) -> str:
    """Return a piece of a line of a colour and one of `DASHES` for a table, as HTML."""
    pattern = {"solid": "", "dashed": "6", "dotted": "2 3", "dotdash": "2 3 6 3"}.get(dash, "6 3 2")
    return (
        "<svg width='26' height='10'><line x1='0' y1='6' x2='26' y2='6' stroke-width='2' "
        f"stroke='{colour}' stroke-dasharray='{pattern}'/></svg>"
    )


PADDING: Any = 3  # px on all sides

IN_ROW, MARK_PX, CHARACTER_PX = 4, 40, 6
"""Signals of a legend that stand beside each other at most; room for a mark and a letter [px]."""

ROWS = """
for (const [legend, px] of legends) {
  const most = Math.min(legend.items.length, in_row, Math.floor(plot.inner_width / px));
  legend.ncols = Math.max(1, most);
}
"""
"""Puts as many signals beside each other as the plot is wide for."""


def add_legends(
    figures: Mapping[str, Any], traces: Sequence[Trace], lines: Sequence[Any],
    dashes: Sequence[str],
) -> None:  # fmt: skip
    """Put a legend above each plot: its signals; above the first one the tests by colour."""
    colour = dict(zip((trace.test for trace in traces), (each.glyph.tags for each in lines),
                      strict=True))  # fmt: skip

    def marked(plot: Any, label: str, held: Sequence[Any], tags: Sequence[Any], dash: str) -> Any:
        mark = plot.line([np.nan], [np.nan], line_dash=dash, line_width=2, tags=tags)
        return LegendItem(label=label, renderers=[*held, mark])

    for unit, plot in figures.items():
        held: dict[str, list[tuple[Any, str]]] = {}
        for trace, line, dash in zip(traces, lines, dashes, strict=True):
            if trace.unit == unit:
                held.setdefault(trace.name, []).append((line, dash))
        legends = [
            [
                marked(plot, name, [line for line, _ in drawn],
                       [INK] if len(colour) > 1 else drawn[0][0].glyph.tags, drawn[0][1])
                for name, drawn in held.items()
            ]
        ]  # fmt: skip
        if len(colour) > 1 and plot is next(iter(figures.values())):
            legends.append([marked(plot, test, [], tags, "solid") for test, tags in colour.items()])
        sized = []
        for items in legends:
            longest = max(len(str(item.label.value)) for item in items)
            sized.append((_legend(items), MARK_PX + CHARACTER_PX * longest))
            plot.add_layout(sized[-1][0], "above")
        fit = CustomJS(args={"plot": plot, "legends": sized, "in_row": IN_ROW}, code=ROWS)
        plot.js_on_change("inner_width", fit)


def paint(plot: Any, look: Look) -> None:
    """Paint all of a plot; what has the number of a colour among its tags in that."""
    plot.background_fill_color = look.paper
    plot.border_fill_color = look.paper
    plot.outline_line_color = look.faint
    for axis in (*plot.xaxis, *plot.yaxis):
        axis.axis_label_text_color = look.ink
        axis.axis_label_text_font_style = "normal"
        axis.major_label_text_color = look.ink
        axis.axis_line_color = look.faint
        axis.major_tick_line_color = look.faint
        axis.minor_tick_line_color = None
    for grid in (*plot.xgrid, *plot.ygrid):
        grid.grid_line_color = look.faint
    for legend in plot.legend:
        legend.background_fill_color = look.paper
        legend.label_text_color = look.ink
    for renderer in plot.renderers:
        for number in renderer.glyph.tags:
            colour = look.colour(number)
            for glyph in (renderer.glyph, renderer.nonselection_glyph, renderer.selection_glyph,
                          renderer.muted_glyph):  # fmt: skip
                for attribute in ("line_color", "fill_color"):
                    if hasattr(glyph, attribute):
                        setattr(glyph, attribute, colour)


def _legend(items: list[LegendItem]) -> Legend:
    return Legend(
        items=items, location="top_left", ncols=1, orientation="horizontal",
        label_text_font_size="11px", label_height=13, glyph_height=13, glyph_width=20,
        padding=PADDING, spacing=8, margin=0, border_line_alpha=0.0, click_policy="hide",
    )  # fmt: skip


UNITS: tuple[tuple[float, float, str], ...] = (
    (180.0, 1.0, "s"),
    (10_800.0, 60.0, "min"),
    (float("inf"), 3600.0, "h"),
)
"""For windows shorter than the first [s], the unit [s] and its symbol."""

UNIT_JS = """
const span = x_range.end - x_range.start;
const [unit, symbol] = span < 180 ? [1, "s"] : span < 10800 ? [60, "min"] : [3600, "h"];
"""

FORMAT = (
    UNIT_JS
    + """
const step = ticks.length > 1 ? Math.abs(ticks[1] - ticks[0]) / unit : 1;
let digits = 0;
while (digits < 4 && Math.abs(Math.round(step * 10 ** digits) / (step * 10 ** digits) - 1) > 1e-3) {
  digits++;
}
return (tick / unit).toFixed(digits);
"""
)

LABEL = UNIT_JS + "axis.axis_label = `time [${symbol}]`;"


def unit_of(span_s: float) -> tuple[float, str]:
    """Return the unit [s] and its symbol in which a window of a length [s] is shown."""
    return next((unit, symbol) for longest, unit, symbol in UNITS if span_s < longest)


def spoken(time_s: float, span_s: float) -> str:
    """Return a time [s] as seen in a window of a length [s], as in `"12.50 min (750.0 s)"`."""
    unit, symbol = unit_of(span_s)
    seconds = f"{time_s:.2f} s"
    return seconds if unit == 1.0 else f"{time_s / unit:.3f} {symbol} ({seconds})"


def show_time(axis: Any, x_range: Range1d) -> None:
    """Let an axis show times of a window [s] in the unit that suits it."""
    axis.ticker = CompositeTicker(
        tickers=[
            AdaptiveTicker(
                base=10, mantissas=[1, 2, 5], min_interval=0.001, max_interval=0.5,
                num_minor_ticks=0,
            ),
            AdaptiveTicker(
                base=60, mantissas=[1, 2, 5, 10, 15, 30], min_interval=1.0, num_minor_ticks=0
            ),
        ],
        desired_num_ticks=8,
    )  # fmt: skip
    axis.formatter = CustomJSTickFormatter(args={"x_range": x_range}, code=FORMAT)
    span_s = float(x_range.end) - float(x_range.start)  # pyright: ignore[reportArgumentType]
    axis.axis_label = f"time [{unit_of(span_s)[1]}]"
    label = CustomJS(args={"axis": axis, "x_range": x_range}, code=LABEL)
    x_range.js_on_change("start", label)
    x_range.js_on_change("end", label)


HOVER = (
    UNIT_JS
    + """
const t = cb_obj.x;
const nearest = (xs) => {
  let low = 0, high = xs.length - 1;
  const room = 0.005 * span;
  if (high < 0 || t < xs[0] - room || t > xs[high] + room) return -1;
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
  rows += `<tr><td style="overflow-wrap:anywhere">${sample.text} ${label}</td>`
    + `<td style="text-align:right;padding:0 6px"><b>${text}</b></td><td>${unit}</td></tr>`;
}
const shown = unit == 1 ? "" : `${(t / unit).toFixed(3)} ${symbol} · `;
readout.text = `<p><b>t = ${shown}${t.toFixed(2)} s</b></p><table>${rows}</table>`;
"""
)
"""Reads every line at the mouse; labels come escaped."""

MOUSE = "Mouse: all signals at that time. Wheel: zoom. Drag: zoom to a span."
LOOK_AT = f"<p style='opacity:0.7'>{MOUSE}</p>"
HELP = (
    f"<p style='opacity:0.7'>{MOUSE} Click: cursor A. Shift and click: cursor B. “Select” in the "
    "bar, then drag: a window for the motor file.</p>"
)


def label_of(trace: Trace, traces: Sequence[Trace]) -> str:
    """Return how a line is called: with its test where there are several."""
    return f"{trace.name} · {trace.test}" if len(tests_of(traces)) > 1 else trace.name


def cursor_table(
    traces: Sequence[Trace], a_s: float | None, b_s: float | None, span_s: float
) -> str:
    """Return the readings of all lines at two cursors [s] and their difference, as HTML.

    A cursor that is not set is None; the times are seen in a window of a length [s].
    """
    if a_s is None and b_s is None:
        return ""
    rows, several = "", len(tests_of(traces)) > 1
    for trace in traces:
        name = escape(f"{trace.name} [{trace.printed_unit}]")
        name += f"<br><span class='faded'>{escape(trace.test)}</span>" if several else ""
        a, b = (math.nan if at is None else trace.at(at) for at in (a_s, b_s))
        values = ("–" if math.isnan(each) else f"{each:.6g}" for each in (a, b, b - a))
        cells = "".join(f"<td class='number'>{value}</td>" for value in values)
        rows += f"<tr><td>{name}</td>{cells}</tr>"
    between = None if a_s is None or b_s is None else b_s - a_s
    told = [
        f"<b>{name}</b> {spoken(at, span_s)}"
        for name, at in (("A", a_s), ("B", b_s), ("Δt", between))
        if at is not None
    ]
    head = "<tr><th></th><th>A</th><th>B</th><th>B − A</th></tr>"
    missing = message("note", "Shift and click sets cursor B.") if b_s is None else ""
    table = f"<table style='font-size:12px'>{head}{rows}</table>"
    return f"<p>{'<br>'.join(told)}</p>{table}{missing}"
