"""The winding at switch-off for people: lines for the terminal, files with a figure."""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING

import numpy as np

from ..io.quantities import quantity
from ..io.texts import Texts
from ..reports.printed import told
from .cooling import NUM_DRAWS
from .result import Limit, ShutdownResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito's palette, which colour-blind readers can tell apart."""


def text(result: ShutdownResult, *, verbose: bool = False) -> str:
    """Return a result in a dozen lines.

    Args:
        result: The result.
        verbose: Whether the budget and how the file was read follow.
    """
    lines = [*answer_lines(result), "", "By hand from the same readings", *_by_hand(result)]
    if verbose:
        lines += ["", "Uncertainty budget (GUM)", *_budget(result)]
        lines += ["", *result.notes]
    return "\n".join(lines)


def answer_lines(result: ShutdownResult, say: Texts | None = None) -> list[str]:
    """Return the answer, what is left to the limits, what it comes from, doubts about that.

    Args:
        result: The result.
        say: The texts in the language of the page; None for English.
    """
    say = say or Texts()
    low, high = result.winding_95_degC
    if result.is_determinable:
        lines = [
            f"Winding at switch-off: {result.winding_degC:.1f} °C (95 % {low:.1f} … {high:.1f} °C)",
            f"Rise over the sink of {result.sink_degC:.1f} °C: {result.rise_K:.1f} K "
            f"(95 % {result.rise_95_K[0]:.1f} … {result.rise_95_K[1]:.1f} K)",
            *map(_limit, result.limits),
        ]
    else:
        lines = [
            f"NOT DETERMINABLE: {result.reason}",
            f"The readings allow {low:.1f} … {high:.1f} °C (95 %) at switch-off.",
        ]
    lines += [
        *result.left_out,
        f"First reading {result.first_reading_s:.0f} s after switch-off: "
        f"{result.reading_degC[0]:.1f} °C; scatter {result.scatter_K:.2g} K; prior of "
        f"{result.prior}",
    ]
    return [*map(say.again, lines), *(told(one, say)[0] for one in result.findings)]


def _limit(limit: Limit) -> str:
    ends = limit.margin_95_K
    left = f"{limit.margin_K:.1f} K left (95 % {ends[0]:.1f} … {ends[1]:.1f} K)"
    if limit.margin_K < 0.0:
        left = f"{-limit.margin_K:.1f} K too hot (95 % {-ends[1]:.1f} … {-ends[0]:.1f} K)"
    name = f"{limit.name[0].upper()}{limit.name[1:]} {quantity(f'{limit.value:g}', limit.unit)}"
    return f"{name}: {left}; within it with a probability of {100.0 * limit.probability:.0f} %"


def hand_cells(result: ShutdownResult) -> list[tuple[str, str, str, str]]:
    """Return the methods by hand: name, winding [degC], difference to the answer [K], source."""
    return [
        (row.method, "not applicable", "", row.source)
        if math.isnan(row.degC)
        else (row.method, f"{row.degC:.1f}", f"{row.degC - result.winding_degC:+.1f}", row.source)
        for row in result.by_hand
    ]


def _by_hand(result: ShutdownResult) -> list[str]:
    return [
        f"  {method:<42} " + (f"{degC:>7} °C  {off:>6} K" if off else degC) + f"  ({source})"
        for method, degC, off, source in hand_cells(result)
    ]


LEAST_SHARE = 5e-3
"""Of a source that has a row of its own where people read [1]; files hold all."""

BUDGET = ("source", "u", "K per unit", "K", "share")
"""Headings of the budget; u is the standard uncertainty."""


def budget_cells(result: ShutdownResult) -> list[tuple[str, str, str, str, str]]:
    """Return the budget in the columns of `BUDGET`; sources without a share in one row."""
    rows = []
    rest = [row for row in result.budget if row.share < LEAST_SHARE]
    for row in (row for row in result.budget if row.share >= LEAST_SHARE):
        sd, slope = row.standard_uncertainty, row.sensitivity
        u = "" if sd is None else quantity(f"{sd:.2g}", row.unit)
        c = "" if slope is None else f"{slope:.3g}"
        rows.append((row.source, u, c, f"{row.contribution:.3f}", f"{100 * row.share:.1f} %"))
    if rest:
        part = math.hypot(*(row.contribution for row in rest))
        share = f"{100 * sum(row.share for row in rest):.1f} %"
        rows.append((f"{len(rest)} others", "", "", f"{part:.3f}", share))
    return rows


def budget_sum(result: ShutdownResult) -> str:
    """Return what the budget comes to."""
    return (
        f"standard uncertainty {result.gum_uncertainty_K:.3f} K to first order (GUM), "
        f"{result.standard_uncertainty_K:.3f} K by {NUM_DRAWS} draws (JCGM 101)"
    )


def _budget(result: ShutdownResult) -> list[str]:
    rows = (BUDGET, *budget_cells(result))
    width = max(len(source) for source, *_ in rows)
    lines = [
        f"  {source:<{width}} {u:>11} {c:>11} {part:>7} {share:>7}"
        for source, u, c, part, share in rows
    ]
    return [*lines, f"  {budget_sum(result)}"]


def table(result: ShutdownResult) -> bytes:
    """Return readings and curve as CSV: time, reading, median and 95 % limits of the winding."""
    curve = [np.interp(result.reading_time_s, result.time_s, one) for one in result.curve_degC]
    rows = zip(result.reading_time_s, result.reading_degC, *curve, strict=True)
    lines = ["time_s,reading_degC,low_95_degC,winding_degC,high_95_degC"]
    lines += [",".join(f"{value:.6g}" for value in row) for row in rows]
    return ("\n".join(lines) + "\n").encode()


def drawn(result: ShutdownResult) -> Figure:
    """Return the figure: readings, extrapolation with its band, methods by hand."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.2), layout="constrained")
    axis = figure.add_subplot()
    low, median, high = result.curve_degC
    axis.fill_between(result.time_s, low, high, color="#0072B2", alpha=0.2, lw=0, label="95 %")
    axis.plot(result.time_s, median, color="#0072B2", lw=1.2, label="winding")
    axis.plot(result.reading_time_s, result.reading_degC, "o", color="#222222", ms=3,
              label="readings")  # fmt: skip
    for row, colour in zip(result.by_hand[1:], COLOURS, strict=False):
        if not math.isnan(row.degC):
            axis.plot(row.time_s, row.degC, "D", color=colour, ms=5, clip_on=False,
                      label=row.method)  # fmt: skip
    for one in result.limits:
        degC = one.value if one.unit == "degC" else one.value + result.sink_degC
        if degC < 1.15 * high.max():
            axis.axhline(degC, color="#B00020", lw=0.9, ls="-" if one.unit == "degC" else "--",
                         label=one.name)  # fmt: skip
    axis.axvline(0.0, color="#999999", lw=0.6)
    axis.set(xlabel="Time since switch-off [s]", ylabel="Temperature [°C]",
             title=f"{result.motor}, {result.readings}")  # fmt: skip
    axis.grid(lw=0.3)
    figure.legend(fontsize=7, frameon=False, ncols=3, loc="outside lower center")
    return figure


def figure(result: ShutdownResult, say: Texts | None = None) -> bytes:
    """Return the figure as PNG, in the language of `say`; English if None."""
    from ..reports.figures import again

    stream = io.BytesIO()
    again(drawn(result), say or Texts()).savefig(
        stream, format="png", dpi=150, metadata={"Software": None}
    )
    return stream.getvalue()
