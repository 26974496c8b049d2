"""The figure of page 1: measured winding, model with its 95 % band, limit of the insulation."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from .figures import COLOURS, finish, plain

LIMIT_COLOUR = "#B00020"

MOST_MARKS = 150
"""Marks of readings; more hide the line behind them."""


def certificate_figure(
    name: str, table: pd.DataFrame, network: str, title: str, limit: tuple[str, float] | None
) -> Figure:
    """Return the course of one test as a customer reads it.

    Args:
        name: The test.
        table: Its courses (`heatrun.runs.courses.band_table`).
        network: Whose prediction is drawn.
        title: Its name in words.
        limit: Insulation class and its temperature [degC]; None if it is not known.
    """
    figure = Figure(figsize=(7.2, 4.1), layout="constrained")
    axis = figure.subplots()
    minutes = table["time_s"] / 60.0
    low, high = (table[f"{network}_total_95_{side}_degC"] for side in ("low", "high"))
    band = axis.fill_between(minutes, low, high, color=COLOURS["second"], alpha=0.25, lw=0)
    (measured,) = axis.plot(
        minutes,
        table["measured_degC"],
        "o",
        color=COLOURS["measured"],
        mfc="none",
        mew=0.6,
        ms=3.0,
        markevery=max(1, len(table) // MOST_MARKS),
    )
    (model,) = axis.plot(minutes, table[f"{network}_winding_degC"], color=COLOURS["second"], lw=1.2)
    (sink,) = axis.plot(minutes, table["sink_degC"], color="0.55", lw=0.8)
    handles = [measured, model, band, sink]
    words = ["measured winding", f"model ({title})", "95 % band", "sink"]
    if limit is not None:
        letter, degC = limit
        handles.append(axis.axhline(degC, color=LIMIT_COLOUR, lw=1.0, ls="--"))
        words.append(f"limit, class {letter} ({degC:.0f} °C)")
    axis.set_xlabel("time [min]")
    axis.set_ylabel("temperature [°C]")
    axis.margins(x=0.01)
    axis.set_title(plain(name), loc="left", fontsize=9)
    figure.legend(handles, words, fontsize=8, frameon=False, ncols=5, loc="outside lower center")
    finish([axis])
    return figure
