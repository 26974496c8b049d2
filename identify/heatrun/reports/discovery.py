"""The report of a discovery: two minutes' reading for the engineer, from its JSON.

Its figures are drawn from the result: before and after, and where.
"""

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from msgspec import UNSET

from ..discovery.localise import SENSOR, Where
from ..io.quantities import clean, printed_unit, quantity, rounded
from ..io.texts import Texts
from ..posterior.predict import Prediction
from ..record.blocks import Blocks
from ..results import DiscoveryResult
from ..results.discovery import (
    CandidateFate,
    FoundEffect,
    Gap,
    ParameterBeforeAfter,
    ValueWithInterval,
)
from ..results.model import LocalisedMisfit, MissingSpan
from ..results.values import number
from .certificate import ENGLISH
from .figures import GAP_IN, finish, plain, save, stack
from .pdf import TEMPLATES, typeset
from .printed import signed

LABELS = (
    "disagree", "missing_effect", "law", "parameters_95", "probability", "not_apart", "rmse_before",
    "max_before", "after_K", "band_before", "after", "had_been_off", "network_alone",
    "with_missing", "off_by", "would_separate", "duty_minutes", "current_A", "speed_rpm", "where",
    "test", "from_min", "to_min", "node", "what_missing", "considered", "effect", "fate",
    "visible_K", "log_bayes", "why", "visible_means", "rivals_of", "found", "rival", "left_over",
    "page", "of",
)  # fmt: skip
"""Texts that the template sets by itself."""


def write_report(result: DiscoveryResult, figures: Sequence[Path], path: Path, say: Texts) -> Path:
    """Write the report as PDF."""
    return typeset(TEMPLATES / "discovery.typ", report_content(result, say), figures, path)


def report_content(result: DiscoveryResult, say: Texts) -> dict[str, Any]:
    """Return the words of the report; what the table of texts lacks stays English, and is said."""
    content = _content(result, say)
    remark = [] if say.is_whole else [say("rest_in_english")]
    return {**content, "limits": [*content["limits"], *remark]}


def _content(result: DiscoveryResult, say: Texts) -> dict[str, Any]:
    test = result.next_test
    left = result.adequacy.after
    return {
        "title": clean(result.motor.name),
        "version": f"heatrun {result.heatrun_version}",
        "verdict": say(f"verdict_{result.verdict}"),
        "sentence": say.again(result.sentence),
        "effects": [_effect(effect, say) for effect in result.effects],
        "gap": [
            _gap(say(key), gap, say)
            for key, gap in (
                ("fitted_tests", result.calibration), ("held_out_tests", result.holdout)
            )
            if gap is not None
        ],
        "parameters": [
            [say.number(cell) for cell in parameter_row(n, p)]
            for n, p in result.parameters.items()
        ],
        "next": [] if test is None else [
            say("next_duty", start=test.start, what=test.what,
                effects=" and ".join(test.separates),
                n=f"{test.expected_log_bayes_factor:.0f}")
        ],
        "profile": [] if test is None else [
            [f"{s.minutes:.0f}", f"{s.current_A:.0f}", f"{s.speed_rpm:.0f}"]
            for s in test.profile
        ],
        "where_words": _where(result.localisation.before, say),
        "spans": [_span(span, say) for span in result.where],
        "candidates": [_candidate(row, say) for row in result.candidates],
        "rivals": [
            [effect.id, rival.id, say.number(f"{number(rival.delta_log_evidence):+.1f}"),
             "–" if rival.probability is UNSET else say.number(f"{rival.probability:.2g}"),
             say.again(rival.reason)]
            for effect in result.effects
            for rival in effect.rivals
        ],
        "left": say(
            "left_of_misfit", misfit=f"{left.slow_misfit_K:.2f}",
            rmse="–" if left.rmse_K is UNSET else f"{left.rmse_K:.2f}",
            noise=f"{left.noise_K:.2f}", excess=f"{left.low_frequency_excess:.1f}",
        ),
        "limits": [say("limit_asked"), say("limit_half")],
        "labels": {key: say(key) for key in LABELS},
    }  # fmt: skip


def _effect(effect: FoundEffect, say: Texts) -> list[str]:
    numbers = "; ".join(
        f"{name} = {quantity(rounded(p.value), p.unit)} "
        f"({rounded(p.interval_95[0])} … {rounded(p.interval_95[1])})"
        for name, p in effect.parameters.items()
    )
    return [
        effect.id,
        say("law_words", law=effect.law),
        say.number(numbers),
        say.number(f"{effect.probability:.2f}"),
        effect.equivalents_in_words() or "–",
    ]


def _gap(name: str, gap: Gap, say: Texts) -> list[str]:
    errors_K = gap.rmse_before_K, gap.rmse_after_K, gap.max_before_K, gap.max_after_K
    return [
        name,
        *(say.number(f"{error:.2f}") for error in errors_K),
        f"{100 * gap.coverage_95_before:.0f} %", f"{100 * gap.coverage_95_after:.0f} %",
    ]  # fmt: skip


def parameter_row(name: str, entry: ParameterBeforeAfter) -> list[str]:
    """Return the printed cells of a parameter: before, after, and how far it had been off."""

    def interval(figure: ValueWithInterval) -> str:
        return " … ".join(rounded(limit, 4) for limit in figure.interval_95)

    before, after = entry.before, entry.after
    off = entry.wrong_by
    return [
        f"{name} [{printed_unit(entry.unit)}]",
        rounded(before.value, 4), interval(before),
        rounded(after.value, 4), interval(after),
        "–" if off is None else f"{signed(100 * off, 1)} %",
    ]  # fmt: skip


def _where(where: LocalisedMisfit, say: Texts) -> str:
    if not where.nodes:
        return say("nowhere")
    nodes = {node: say.again(node.replace("_", " ")) for node in where.nodes}
    words = [say("missing_at", nodes=f" {say('and')} ".join(nodes.values()))]
    for node, drivers in where.dependence.items():
        known = {name: value for name, value in drivers.items() if value is not None}
        ranked = sorted(known.items(), key=lambda item: -abs(item[1]))
        told = ", ".join(
            f"{say.again(name.replace('_', ' '))} {say.number(signed(value, 2))}"
            for name, value in ranked
        )
        there = say.again(node.replace("_", " "))
        words.append(say("correlation_at", node=there, drivers=told))
    return " ".join([*words, say("estimated_jointly")])


def _span(span: MissingSpan, say: Texts) -> list[str]:
    missing, unit = span.missing
    low, high = span.interval_95
    return [
        clean(span.test),
        f"{span.from_s / 60:.0f}",
        f"{span.to_s / 60:.0f}",
        say.again(span.node.replace("_", " ")),
        say.number(f"{missing:+.3g} {unit}"),
        say.number(f"{low:+.3g} … {high:+.3g}"),
    ]


def _candidate(row: CandidateFate, say: Texts) -> list[str]:
    name = say("effect_in", effect=row.id, test=clean(row.test)) if row.test else row.id
    return [
        name,
        say.again(row.status),
        "–" if row.visible_K is UNSET else say.number(f"{row.visible_K:.2f}"),
        "–" if row.log_evidence is None else say.number(f"{row.log_evidence:+.1f}"),
        say.again(row.reason),
    ]


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
    """Draw the figures as PNG: before and after first, then where for each test."""
    folder.mkdir(parents=True, exist_ok=True)
    written = [save(gap(predictions, roles, say), folder / "before_after.png")]
    for index, test in enumerate(tests):
        figure = missing(test, index, before, after, say)
        if figure is not None:
            written.append(save(figure, folder / f"where_{index + 1}.png"))
    return written


def gap(
    predictions: Sequence[tuple[Prediction, Prediction]], roles: Sequence[str], say: Texts = ENGLISH
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


def missing(
    test: Blocks, index: int, before: Where, after: Where, say: Texts = ENGLISH
) -> Figure | None:
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
