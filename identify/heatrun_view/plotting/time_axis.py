"""The time axis: data in seconds, ticks in seconds, minutes or hours as the window suits."""

from __future__ import annotations

from typing import Any

from bokeh.models import AdaptiveTicker, CompositeTicker, CustomJS, CustomJSTickFormatter, Range1d

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
