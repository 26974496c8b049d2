"""Figures of a discovery, drawn from its result: before and after, and where."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..discovery.localise import SENSOR, Where
from ..io.texts import Texts
from ..posterior.predict import Prediction
from ..record.blocks import Blocks
from .figures import GAP_IN, finish, plain, save, stack

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
    say: Texts,
) -> list[Path]:
    """Draw the figures as PNG: before and after first, then where for each test.

    Args:
        predictions: Of base and final model, one pair per test.
        roles: Role of each test.
        tests: The calibration tests.
        before: What the base model misses.
        after: What the final model misses.
        folder: Where the files go.
        say: The texts in the language of the report.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = [save(gap(predictions, roles, say), folder / "before_after.png")]
    for index, test in enumerate(tests):
        figure = missing(test, index, before, after, say)
        if figure is not None:
            written.append(save(figure, folder / f"where_{index + 1}.png"))
    return written


def gap(
    predictions: Sequence[tuple[Prediction, Prediction]], roles: Sequence[str], say: Texts
) -> Figure:
    """Return the errors over time before and after, with the bands of the final model."""
    num = len(predictions)
    figure = Figure(figsize=(7.2, 0.9 + 2.0 * num))
    axes = np.atleast_1d(figure.subplots(num, 1))
    for axis, (before, after), role in zip(axes, predictions, roles, strict=True):
        minutes = after.test.time / 60.0
        low, high = (limit - after.median for limit in after.total["95"])
        axis.fill_between(minutes, low, high, color=AFTER, alpha=0.15, lw=0,
                          label=say("band_final"))  # fmt: skip
        pairs = [(say("network_alone"), before, BEFORE)]
        if after is not before:
            pairs.append((say("with_missing"), after, AFTER))
        sizes = []
        for label, prediction, colour in pairs:
            seen = prediction.test.is_observed
            size = float(np.sqrt(np.mean(prediction.residual[seen] ** 2)))
            sizes.append(say.number(f"{label} {size:.2f} K"))
            axis.plot(minutes, prediction.residual, color=colour, lw=0.9, label=label)
        axis.axhline(0.0, color="0.5", lw=0.6)
        axis.set_ylabel(say("residual_K"))
        title = f"{plain(after.test.name)} ({say(role)})\nRMSE: {', '.join(sizes)}"
        axis.set_title(title, loc="left", fontsize=8, y=1.0)
    axes[-1].set_xlabel(say("time_min"))
    finish(list(axes), say)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=3, fontsize=7, frameon=False)
    stack(figure, list(axes), [0.4, *[0.65] * (num - 1)], below=0.65)
    return figure


def missing(test: Blocks, index: int, before: Where, after: Where, say: Texts) -> Figure | None:
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
    axes[0].set_ylabel(say("current_A"), color="#A0467A")
    axes[0].set_title(say("load_and_missing", test=plain(test.name)), loc="left", fontsize=9, y=1.0)
    if test.inputs.speed is not None:
        turned = axes[0].twinx()
        turned.plot(minutes, mean(test.inputs.speed) * 30.0 / np.pi, color="0.4", lw=0.8)
        turned.set_ylabel(say("speed_rpm"), color="0.4")
        finish([turned], say)
    axes[1].plot(minutes, test.measured, color="#222222", lw=0.9, label=say("measured_winding"))
    axes[1].plot(minutes, mean(test.inputs.ambient), color="0.6", lw=0.8, label=say("sink"))
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
        axis.plot(time, course.mean, color=colour, lw=1.1, label=say("network_alone"))
        for left in after.courses:
            if after is not before and left.test == index and left.node == course.node:
                axis.plot(time, left.mean, color="0.2", lw=0.8, ls="--",
                          label=say("with_missing"))  # fmt: skip
        for span in before.spans:
            if span.test == test.name and span.node == course.node:
                axis.axvspan(span.from_s / 60.0, span.to_s / 60.0, color="0.9", zorder=-1)
        axis.axhline(0.0, color="0.5", lw=0.6)
        node = say.again(course.node.replace("_", " "))
        is_sensor = course.node == SENSOR
        what = say("reading_error_K") if is_sensor else say("missing_heat_W", node=node)
        axis.set_ylabel(what)
        axis.legend(fontsize=7, frameon=False, ncols=3)
    axes[-1].set_xlabel(say("time_grey"))
    finish(list(axes), say)
    stack(figure, list(axes), [0.25, *[GAP_IN] * (len(axes) - 1)], right=0.7)
    return figure
