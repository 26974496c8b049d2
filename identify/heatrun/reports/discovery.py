"""The report of a discovery: two minutes' reading for the engineer, from its JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from msgspec import UNSET

from ..io.quantities import clean, printed_unit, quantity, rounded
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

VERDICTS = {
    "adequate": "Nothing is missing",
    "named": "Found what was missing",
    "ambiguous": "Found a set that these tests cannot separate",
    "unexplained": "Something is missing that no effect of the catalogue accounts for",
    "not_identifiable": "Not identifiable from these tests",
}

LIMITS = (
    "An effect is in the model where half of the evidence asks for it, beside all others that are, "
    "and where it closes more than 0.05 K. Held-out tests have no say in it. The laws of the "
    "catalogue stand for the machine's own: a name says which of them fits, not that no other "
    "could.",
    "Half of the evidence counts because no law is an exact copy. A rival is told where it would "
    "explain the greater part of what the effect does, with a probability above 5 %.",
)


def write_report(result: DiscoveryResult, figures: Sequence[Path], path: Path) -> Path:
    """Write the report as PDF.

    Args:
        result: What stands in `discovery.json`.
        figures: Before and after first, then where.
        path: Where it goes; written whole or not at all.
    """
    return typeset(TEMPLATES / "discovery.typ", report_content(result), figures, path)


def report_content(result: DiscoveryResult) -> dict[str, Any]:
    """Return the words of the report."""
    test = result.next_test
    left = result.adequacy.after
    return {
        "title": clean(result.motor.name),
        "version": f"heatrun {result.heatrun_version}",
        "verdict": VERDICTS[result.verdict],
        "sentence": result.sentence,
        "effects": [_effect(effect) for effect in result.effects],
        "gap": [
            _gap(name, gap)
            for name, gap in (
                ("calibration tests", result.calibration), ("held-out tests", result.holdout)
            )
            if gap is not None
        ],
        "parameters": [parameter_row(n, p) for n, p in result.parameters.items()],
        "next": [] if test is None else [
            f"From {test.start}: {test.what}. Expected log Bayes factor between "
            f"{' and '.join(test.separates)}: {test.expected_log_bayes_factor:.0f}."
        ],
        "profile": [] if test is None else [
            [f"{s.minutes:.0f}", f"{s.current_A:.0f}", f"{s.speed_rpm:.0f}"]
            for s in test.profile
        ],
        "where_words": _where(result.localisation.before),
        "spans": [_span(span) for span in result.where],
        "candidates": [_candidate(row) for row in result.candidates],
        "rivals": [
            [effect.id, rival.id, f"{number(rival.delta_log_evidence):+.1f}",
             f"{100 * max(number(rival.share_of_gap), 0):.0f} %", rival.reason]
            for effect in result.effects
            for rival in effect.rivals
        ],
        "left": (
            f"Slow misfit {left.slow_misfit_K:.2f} K"
            f"{'' if left.rmse_K is UNSET else f' in an RMSE of {left.rmse_K:.2f} K'}, noise of a "
            f"block mean {left.noise_K:.2f} K, low-frequency excess "
            f"{left.low_frequency_excess:.1f} (1 if only noise)."
        ),
        "limits": list(LIMITS),
    }  # fmt: skip


def _effect(effect: FoundEffect) -> list[str]:
    numbers = "; ".join(
        f"{name} = {quantity(rounded(p.value), p.unit)} "
        f"({rounded(p.interval_95[0])} … {rounded(p.interval_95[1])})"
        for name, p in effect.parameters.items()
    )
    return [
        effect.id,
        effect.law,
        numbers,
        f"{effect.probability:.2f}",
        effect.equivalents_in_words() or "–",
    ]


def _gap(name: str, gap: Gap | HeldOutGap) -> list[str]:
    return [
        name,
        f"{gap.rmse_before_K:.2f}", f"{gap.rmse_after_K:.2f}",
        f"{gap.max_before_K:.2f}", f"{gap.max_after_K:.2f}",
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


def _where(where: LocalisedMisfit) -> str:
    if not where.nodes:
        return "No heat is missing anywhere that the tests would show, and the reading is sound."
    nodes = " and ".join(where.nodes)
    words = [f"The evidence puts what is missing at: {nodes}."]
    for node, drivers in where.dependence.items():
        known = {name: value for name, value in drivers.items() if value is not None}
        ranked = sorted(known.items(), key=lambda item: -abs(item[1]))
        told = ", ".join(f"{name.replace('_', ' ')} {signed(value, 2)}" for name, value in ranked)
        words.append(f"Correlation of what is missing at the {node} with {told}.")
    words.append(
        "It is estimated jointly with the network, which takes part of any cause upon itself."
    )
    return " ".join(words)


def _span(span: MissingSpan) -> list[str]:
    missing, unit = span.missing
    low, high = span.interval_95
    return [
        clean(span.test),
        f"{span.from_s / 60:.0f}",
        f"{span.to_s / 60:.0f}",
        span.node,
        f"{missing:+.3g} {unit}",
        f"{low:+.3g} … {high:+.3g}",
    ]


def _candidate(row: CandidateFate) -> list[str]:
    name = f"{row.id} in {clean(row.test)}" if row.test else row.id
    return [
        name,
        row.status,
        "–" if row.visible_K is UNSET else f"{row.visible_K:.2f}",
        "–" if row.log_evidence is None else f"{row.log_evidence:+.1f}",
        row.reason,
    ]
