"""Colours and legends of the plots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models import Legend, LegendItem

from ..look import Look
from .trace import Trace

PADDING: Any = 3  # px on all sides

IN_ROW = 4
"""Signals of a legend that stand beside each other."""


def add_legends(
    figures: Mapping[str, Any], traces: Sequence[Trace], lines: Sequence[Any],
    dashes: Sequence[str],
) -> None:  # fmt: skip
    """Put a legend into each plot: its signals by colour; in the first one the tests by dash.

    Args:
        figures: Plots by unit.
        traces: The signals.
        lines: The line of each.
        dashes: The dash of each.
    """
    for unit, plot in figures.items():
        held: dict[str, list[Any]] = {}
        for trace, line in zip(traces, lines, strict=True):
            if trace.unit == unit:
                held.setdefault(trace.name, []).append(line)
        items = [LegendItem(label=name, renderers=drawn) for name, drawn in held.items()]
        plot.add_layout(_legend(items, "top_left"))
    tests = dict(zip((trace.test for trace in traces), dashes, strict=True))
    if len(tests) > 1:
        first = next(iter(figures.values()))
        items = [
            LegendItem(
                label=test,
                renderers=[
                    first.line([np.nan], [np.nan], line_dash=dash, line_width=1.5, tags=["ink"])
                ],
            )
            for test, dash in tests.items()
        ]
        first.add_layout(_legend(items, "bottom_right"))


def paint(plot: Any, look: Look) -> None:
    """Paint all of a plot but its lines.

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
        if "ink" in renderer.glyph.tags:
            for glyph in (renderer.glyph, renderer.nonselection_glyph, renderer.muted_glyph):
                for attribute in ("line_color", "fill_color"):
                    if hasattr(glyph, attribute):
                        setattr(glyph, attribute, look.ink)


def _legend(items: list[LegendItem], location: Any) -> Legend:
    return Legend(
        items=items, location=location, ncols=min(len(items), IN_ROW), orientation="horizontal",
        label_text_font_size="11px", label_height=13, glyph_height=13, glyph_width=20,
        padding=PADDING, spacing=8, margin=4, background_fill_alpha=0.75, border_line_alpha=0.0,
        click_policy="hide",
    )  # fmt: skip
