"""The report of a discovery: two minutes' reading for the engineer, from its JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from msgspec import UNSET

from ..io.quantities import clean, printed_unit, quantity, rounded
from ..io.texts import Texts
from ..results import DiscoveryResult
from ..results.discovery import (
    CandidateFate,
    FoundEffect,
    Gap,
    HeldOutGap,
    ParameterBeforeAfter,
    ValueWithInterval,
)
from ..results.model import LocalisedMisfit, MissingSpan
from ..results.values import number
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
    """Write the report as PDF.

    Args:
        result: What stands in `discovery.json`.
        figures: Before and after first, then where.
        path: Where it goes; written whole or not at all.
        say: The texts in the language of the report.
    """
    return typeset(TEMPLATES / "discovery.typ", report_content(result, say), figures, path)


def report_content(result: DiscoveryResult, say: Texts) -> dict[str, Any]:
    """Return the words of the report; what the table of texts lacks stays English, and is said."""
    content = _content(result, say)
    remark = [say("rest_in_english")] if say.unknown else []
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
        effect.law,
        say.number(numbers),
        say.number(f"{effect.probability:.2f}"),
        effect.equivalents_in_words() or "–",
    ]


def _gap(name: str, gap: Gap | HeldOutGap, say: Texts) -> list[str]:
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
