"""What is read off the plots: all lines under the mouse, and at two cursors with the difference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from ..words import message
from .time_axis import UNIT_JS, spoken
from .trace import Trace

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
