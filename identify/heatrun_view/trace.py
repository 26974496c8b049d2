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
    """The readings of one channel in order of time.

    Attributes:
        test: Name of the test.
        channel: Canonical channel, or the name of a column that is none.
        time_s: Times with a reading, ascending [s], shape (reading,).
        value: Readings in the unit, shape (reading,).
        step_s: Median step between readings [s].
        unit: Unit of the readings.
    """

    test: str
    channel: str
    time_s: np.ndarray
    value: np.ndarray
    step_s: float
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
        cls,
        test: str,
        channel: str,
        time_s: np.ndarray,
        value: np.ndarray,
        unit: str | None = None,
    ) -> Trace:
        """Take a channel of a record; samples that the file does not have are left out.

        Args:
            test: Name of the test.
            channel: Canonical channel, or the name of a column that is none.
            time_s: Time of each sample [s], shape (time,); put in order where it runs backwards.
            value: Reading of each sample, NaN where there is none, shape (time,).
            unit: Unit of a column that is no channel.
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
        """Return the reading nearest to a time; NaN where there is none within a usual step.

        Args:
            time_s: The time [s].
        """
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
        al. 2023), each of them a reading of the file. NaN stands in every gap.

        Args:
            start: Begin of the window [s].
            end: End of the window [s].
            num_points: Points for the window itself.

        Returns:
            Times [s] and values, with a margin on both sides of the window.
        """
        margin = MARGIN * (end - start)
        first, last = np.searchsorted(self.time_s, [start - margin, end + margin])
        chosen = slice(max(int(first) - 1, 0), int(last) + 1)
        t, v = self.time_s[chosen], self.value[chosen]
        wanted = int(num_points * (1.0 + 2.0 * MARGIN))
        is_thin = t.size > wanted
        if is_thin:
            kept = MinMaxLTTBDownsampler().downsample(t, v, n_out=wanted)
            is_gap = self._gap_between(t, kept)
            t, v = t[kept], v[kept]
        else:
            is_gap = np.diff(t) > GAP * self.step_s
        where = np.flatnonzero(is_gap) + 1
        return np.insert(t, where, t[where - 1]), np.insert(v, where, np.nan)

    def _gap_between(self, t: np.ndarray, kept: np.ndarray) -> np.ndarray:
        """Return whether a gap lies between each kept sample and the next."""
        num_gaps = np.concatenate([[0], np.cumsum(np.diff(t) > GAP * self.step_s)])
        return np.diff(num_gaps[kept]) > 0


def _fixed() -> dict[str, int]:
    """Return the number of each channel among those of its unit, which share a plot."""
    seen: dict[str, int] = {}
    found = {}
    for channel in CHANNELS:
        found[channel.name] = seen.get(channel.unit, 0)
        seen[channel.unit] = found[channel.name] + 1
    return found


MEASURED, MODEL, RESIDUAL = FIT = ("measured", "model", "residual")
"""Lines of a fit."""

FIXED = _fixed() | {name: number for number, name in enumerate(FIT)}


def colours(traces: Sequence[Trace], num_colours: int) -> list[int]:
    """Return the number of each line's colour: its test's where there are several.

    Of one test a channel has its own; another column takes one by its name, or the next that is
    free in its plot.

    Args:
        traces: The lines.
        num_colours: Colours of the palette.
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
    """Return a piece of a line for a table, as HTML.

    Args:
        colour: Of the line.
        dash: One of `DASHES`.
    """
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
    """Put a legend above each plot: its signals; above the first one the tests by colour.

    Args:
        figures: Plots by unit.
        traces: The signals.
        lines: The line of each, its colour among the tags.
        dashes: The dash of each.
    """
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
        sized = [(_legend(items), _widest_px(items)) for items in legends]
        for legend, _ in sized:
            plot.add_layout(legend, "above")
        fit = CustomJS(args={"plot": plot, "legends": sized, "in_row": IN_ROW}, code=ROWS)
        plot.js_on_change("inner_width", fit)


def _widest_px(items: Sequence[Any]) -> int:
    return MARK_PX + CHARACTER_PX * max(len(str(item.label.value)) for item in items)


def paint(plot: Any, look: Look) -> None:
    """Paint all of a plot; what has the number of a colour among its tags in that.

    Args:
        plot: A figure.
        look: Colours.
    """
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
    """Return the unit [s] and its symbol in which a window is shown.

    Args:
        span_s: Length of the window [s].
    """
    return next((unit, symbol) for longest, unit, symbol in UNITS if span_s < longest)


def spoken(time_s: float, span_s: float) -> str:
    """Return a time or a difference of times in words, as in `"12.50 min (750.0 s)"`.

    Args:
        time_s: The time [s].
        span_s: Length of the window in which it is seen [s].
    """
    unit, symbol = unit_of(span_s)
    seconds = f"{time_s:.2f} s"
    return seconds if unit == 1.0 else f"{time_s / unit:.3f} {symbol} ({seconds})"


def show_time(axis: Any, x_range: Range1d) -> None:
    """Let an axis show times of a window in the unit that suits it.

    Args:
        axis: The axis.
        x_range: The window [s].
    """
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
    is_alone = all(other.test == trace.test for other in traces)
    return trace.name if is_alone else f"{trace.name} · {trace.test}"


def cursor_table(
    traces: Sequence[Trace], a_s: float | None, b_s: float | None, span_s: float
) -> str:
    """Return the readings of all lines at two cursors and their difference, as HTML.

    Args:
        traces: The lines.
        a_s: Time of cursor A [s], None if it is not set.
        b_s: Time of cursor B [s], None if it is not set.
        span_s: Length of the window in which they are seen [s].
    """
    if a_s is None and b_s is None:
        return ""
    rows = "".join(
        f"<tr><td>{_cell(trace, traces)}</td>"
        + "".join(f"<td class='number'>{value}</td>" for value in _values(trace, a_s, b_s))
        + "</tr>"
        for trace in traces
    )
    told = [
        f"<b>{name}</b> {spoken(at, span_s)}"
        for name, at in (("A", a_s), ("B", b_s), ("Δt", _between(a_s, b_s)))
        if at is not None
    ]
    head = "<tr><th></th><th>A</th><th>B</th><th>B − A</th></tr>"
    missing = message("note", "Shift and click sets cursor B.") if b_s is None else ""
    table = f"<table style='font-size:12px'>{head}{rows}</table>"
    return f"<p>{'<br>'.join(told)}</p>{table}{missing}"


def _cell(trace: Trace, traces: Sequence[Trace]) -> str:
    name = escape(f"{trace.name} [{trace.printed_unit}]")
    if all(other.test == trace.test for other in traces):
        return name
    return f"{name}<br><span class='faded'>{escape(trace.test)}</span>"


def _between(a_s: float | None, b_s: float | None) -> float | None:
    return None if a_s is None or b_s is None else b_s - a_s


def _values(trace: Trace, a_s: float | None, b_s: float | None) -> list[str]:
    a, b = (math.nan if at is None else trace.at(at) for at in (a_s, b_s))
    return ["–" if math.isnan(value) else f"{value:.6g}" for value in (a, b, b - a)]
