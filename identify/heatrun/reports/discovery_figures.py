"""Figures of a discovery, drawn from its result: before and after, and where."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..discovery.localise import SENSOR, Where
from ..posterior.predict import Prediction
from ..record.blocks import Blocks
from .figures import GAP_IN, plain, save, stack

BEFORE, AFTER = "#D55E00", "#0072B2"
"""Okabe and Ito's palette, which colour-blind readers can tell apart."""

NODE_COLOURS = {"winding": "#CC79A7", "stator": "#009E73", SENSOR: "#56B4E9"}
MORE_COLOURS = ("#E69F00", "#0072B2", "#D55E00", "#F0E442")
"""Of nodes with other names, in the order in which they come."""


def draw_all(
    predictions: Sequence[tuple[Prediction, Prediction]],
    roles: Sequence[str],
    tests: Sequence[Blocks],
    before: Where,
    after: Where,
    folder: Path,
) -> list[Path]:
    """Draw the figures as PNG: before and after first, then where for each test.

    Args:
        predictions: Of base and final model, one pair per test.
        roles: Role of each test.
        tests: The calibration tests.
        before: What the base model misses.
        after: What the final model misses.
        folder: Where the files go.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = [save(gap(predictions, roles), folder / "before_after.png")]
    for index, test in enumerate(tests):
        figure = missing(test, index, before, after)
        if figure is not None:
            written.append(save(figure, folder / f"where_{index + 1}.png"))
    return written


def gap(predictions: Sequence[tuple[Prediction, Prediction]], roles: Sequence[str]) -> Figure:
    """Return the errors over time before and after, with the bands of the final model."""
    num = len(predictions)
    figure = Figure(figsize=(7.2, 0.9 + 2.0 * num))
    axes = np.atleast_1d(figure.subplots(num, 1))
    for axis, (before, after), role in zip(axes, predictions, roles, strict=True):
        minutes = after.test.time / 60.0
        low, high = (limit - after.median for limit in after.total["95"])
        axis.fill_between(minutes, low, high, color=AFTER, alpha=0.15, lw=0,
                          label="95 % band of the final model")  # fmt: skip
        pairs = [("network alone", before, BEFORE)]
        if after is not before:
            pairs.append(("with what was missing", after, AFTER))
        sizes = []
        for label, prediction, colour in pairs:
            seen = prediction.test.is_observed
            size = float(np.sqrt(np.mean(prediction.residual[seen] ** 2)))
            sizes.append(f"{label} {size:.2f} K")
            axis.plot(minutes, prediction.residual, color=colour, lw=0.9, label=label)
        axis.axhline(0.0, color="0.5", lw=0.6)
        axis.set_ylabel("measured −\nmodel [K]")
        title = f"{plain(after.test.name)} ({role})\nRMSE: {', '.join(sizes)}"
        axis.set_title(title, loc="left", fontsize=8, y=1.0)
        _trim(axis)
    axes[-1].set_xlabel("time [min]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=3, fontsize=7, frameon=False)
    stack(figure, list(axes), [0.4, *[0.65] * (num - 1)], below=0.65)
    return figure


def missing(test: Blocks, index: int, before: Where, after: Where) -> Figure | None:
    """Return what is missing over one test under its load; None if nothing is."""
    courses = [course for course in before.courses if course.test == index]
    if not courses:
        return None
    figure = Figure(figsize=(7.2, 2.6 + 1.5 * len(courses)))
    axes = figure.subplots(2 + len(courses), 1, sharex=True)
    rows = test.weight.shape
    minutes = test.block_s * (np.arange(rows[0]) + 0.5) / 60.0

    def mean(values) -> np.ndarray:
        return np.asarray(values).reshape(rows).mean(axis=1)

    axes[0].plot(minutes, np.sqrt(mean(test.inputs.current_squared)), color="#A0467A", lw=0.9)
    axes[0].set_ylabel("current [A]", color="#A0467A")
    axes[0].set_title(
        f"{plain(test.name)}: load, and what is missing", loc="left", fontsize=9, y=1.0
    )
    if test.inputs.speed is not None:
        turned = axes[0].twinx()
        turned.plot(minutes, mean(test.inputs.speed) * 30.0 / np.pi, color="0.4", lw=0.8)
        turned.set_ylabel("speed [rpm]", color="0.4")
        _trim(turned)
    axes[1].plot(minutes, test.measured, color="#222222", lw=0.9, label="winding, measured")
    axes[1].plot(minutes, mean(test.inputs.ambient), color="0.6", lw=0.8, label="sink")
    axes[1].set_ylabel("[°C]")
    axes[1].legend(fontsize=7, frameon=False)
    others = [course.node for course in courses if course.node not in NODE_COLOURS]
    colours = NODE_COLOURS | dict(zip(others, cycle(MORE_COLOURS), strict=False))
    for axis, course in zip(axes[2:], courses, strict=True):
        colour = colours[course.node]
        time = course.time_s / 60.0
        half = 1.96 * course.sd
        axis.fill_between(time, course.mean - half, course.mean + half, color=colour, alpha=0.25,
                          lw=0, label="95 %")  # fmt: skip
        axis.plot(time, course.mean, color=colour, lw=1.1, label="network alone")
        for left in after.courses:
            if after is not before and left.test == index and left.node == course.node:
                axis.plot(time, left.mean, color="0.2", lw=0.8, ls="--",
                          label="with what was missing")  # fmt: skip
        for span in before.spans:
            if span.test == test.name and span.node == course.node:
                axis.axvspan(span.from_s / 60.0, span.to_s / 60.0, color="0.9", zorder=-1)
        axis.axhline(0.0, color="0.5", lw=0.6)
        what = (
            "error of the\nreading [K]"
            if course.node == SENSOR
            else (f"missing heat,\n{course.node} [W]")
        )
        axis.set_ylabel(what)
        axis.legend(fontsize=7, frameon=False, ncols=3)
    axes[-1].set_xlabel("time [min]; grey: spans in which it is significant")
    for axis in axes:
        _trim(axis)
    stack(figure, list(axes), [0.25, *[GAP_IN] * (len(axes) - 1)], right=0.7)
    return figure


def _trim(axis: Axes) -> None:
    axis.tick_params(labelsize=8)
    axis.spines["top"].set_visible(False)
