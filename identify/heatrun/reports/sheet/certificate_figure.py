"""The figure of page 1: measured winding, model with its 95 % band, limit of the insulation."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from ..texts import Texts
from .figures import COLOURS, finish, plain

LIMIT_COLOUR = "#B00020"

MOST_MARKS = 150
"""Marks of readings; more hide the line behind them."""


def certificate_figure(
    name: str,
    table: pd.DataFrame,
    network: tuple[str, str],
    limit: tuple[str, float] | None,
    say: Texts,
    aspect: float,
) -> Figure:
    """Return the course of one test as a customer reads it, with the residuals below.

    Args:
        name: The test.
        table: Its courses (`heatrun.runs.courses.band_table`).
        network: Whose prediction is drawn, and its title.
        limit: Insulation class and its temperature [degC]; None if it is not known.
        say: The texts in the language of the sheet.
        aspect: Height over width [1].
    """
    order, title = network
    figure = Figure(figsize=(7.2, 7.2 * aspect), layout="constrained")
    axis, below = figure.subplots(2, 1, sharex=True, height_ratios=[3.4, 1.0])
    minutes = table["time_s"] / 60.0
    low, high = (table[f"{order}_total_95_{side}_degC"] for side in ("low", "high"))
    band = axis.fill_between(minutes, low, high, color=COLOURS["second"], alpha=0.25, lw=0)
    marks = {"color": COLOURS["measured"], "mfc": "none", "mew": 0.6, "ms": 3.0}
    every = max(1, len(table) // MOST_MARKS)
    (measured,) = axis.plot(minutes, table["measured_degC"], "o", **marks, markevery=every)
    predicted = table[f"{order}_winding_degC"]
    (model,) = axis.plot(minutes, predicted, color=COLOURS["second"], lw=1.2)
    (sink,) = axis.plot(minutes, table["sink_degC"], color="0.55", lw=0.8)
    handles = [measured, model, band, sink]
    words = [say("measured_winding"), say("model_named", network=title), say("band"), say("sink")]
    if limit is not None:
        letter, degC = limit
        handles.append(axis.axhline(degC, color=LIMIT_COLOUR, lw=1.0, ls="--"))
        words.append(say("limit_of_class", letter=letter, T=f"{degC:.0f}"))
    below.fill_between(
        minutes, low - predicted, high - predicted, color=COLOURS["second"], alpha=0.25, lw=0
    )
    below.axhline(0.0, color=COLOURS["second"], lw=1.2)
    below.plot(minutes, table[f"{order}_residual_K"], color=COLOURS["measured"], lw=0.7)
    below.set_ylabel(say("residual_K"))
    below.set_xlabel(say("time_min"))
    axis.set_ylabel(say("temperature_degC"))
    axis.margins(x=0.01)
    axis.set_title(plain(name), loc="left", fontsize=9)
    figure.legend(
        handles, words, fontsize=7.5, frameon=False, ncols=5, loc="outside lower center",
        columnspacing=1.2, handlelength=1.6,
    )  # fmt: skip
    figure.align_ylabels()
    finish([axis, below], say)
    return figure
