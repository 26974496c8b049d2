"""Results as plain text for the terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..bench import Finding
from ..bench.channels.column_mapping import mapping_text
from ..io.printable import printable
from ..io.quantities import printed_unit, quantity, rounded
from ..results import DiscoveryResult, FitResult
from ..results.derived import AT_REST, LOADED, DerivedFigure
from ..results.values import known
from ..runs.verdict import headline
from .sheet.printed import interval_ends

CURRENT, UNASKED = "_current_A", "continuous_current_A"
"""End of the names of ratings, and the one that nobody needs to ask for by `--rating`."""

MOST_SPANS = 6
"""Of what is missing; more of them are in the report."""

_MARK = {"error": "ERROR  ", "warning": "warning", "note": "note   "}


def ranked(findings: Sequence[Finding]) -> list[Finding]:
    """Return findings, the gravest first."""
    order = {"error": 0, "warning": 1, "note": 2}
    return sorted(findings, key=lambda finding: order[finding.severity])


def findings_text(findings: Sequence[Finding]) -> str:
    """Return findings, the gravest first, a paragraph each."""
    if not findings:
        return "No findings: the records are as a fit wants them."
    return "\n".join(
        printable(
            f"{_MARK[f.severity]}  {'' if f.where.startswith(f.test) else f'[{f.test}] '}"
            f"{f.sentence()}  ({f.id})"
        )
        for f in ranked(findings)
    )


def result_text(result: FitResult) -> str:
    """Return the heart of a result: parameters with ranges, errors, verdict, findings."""
    said = headline(result)
    lines = [f"Motor: {result.motor.name}", "", f"{said.use.upper()}: {said.sentence}"]
    for model in result.models.values():
        effects = "".join(f", {effect.id}" for effect in model.effects)
        lines += ["", f"{model.title.capitalize()}{effects}"]
        width = max([7, *map(len, model.parameters)])
        for name, entry in model.parameters.items():
            low, high = interval_ends(entry.interval_95, entry.sd)
            lines.append(
                f"  {name:<{width}} {rounded(entry.value, 5):>11} {printed_unit(entry.unit):<4} "
                f"95 % {low} … {high}   {entry.identifiability or ''}: {entry.why or ''}"
            )
        lines += [
            f"  {_resistance(name, figure)}"
            for name, figure in model.derived.items()
            if name.endswith((LOADED, AT_REST))
        ]
        for row in model.residuals:
            lines.append(
                f"  {row.role:<11} {row.test}: RMSE {row.rmse_K:.2f} K, max "
                f"{row.max_K:.1f} K, end {row.end_K:+.2f} K, "
                f"{100 * row.coverage_95:.0f} % inside the 95 % band"
            )
        for body in known(model.bodies) or ():
            lines.append(
                f"  {body.role:<11} {body.test}, {body.body} "
                f"{'fitted as' if body.fitted else 'against'} {body.node}: RMSE "
                f"{body.rmse_K:.2f} K, {100 * body.coverage_95:.0f} % inside the 95 % band"
            )
        lines += [
            f"  {_rating(name, figure)}"
            for name, figure in model.derived.items()
            if name.endswith(CURRENT) and (name != UNASKED or not known(figure.refused))
        ]
        lines.append(f"  {model.posterior.verdict}")
        if model.about_missing():
            lines.append(f"  {model.about_missing()}")
    lines += ["", result.verdict.sentence]
    if result.comparison is not None:
        lines += [f"  {sentence}" for sentence in result.comparison.words]
    columns = mapping_text(result.tests)
    if columns:
        lines += ["", columns]
    graver = [f for f in result.findings if f.severity != "note"]
    if graver:
        lines += ["", "Findings"]
        lines += [
            f"  {_MARK[f.severity]} {f.where}: {f.message} {f.remedy}".rstrip() for f in graver
        ]
    return "\n".join(printable(line) for text in lines for line in text.split("\n"))


def _resistance(name: str, figure: DerivedFigure) -> str:
    """Return a resistance at stated conditions."""
    low, high = figure.ends
    return (
        f"{name}: {rounded(figure.median, 4)} K/W  95 % {rounded(low, 3)} … {rounded(high, 3)}   "
        f"{known(figure.condition)}"
    )


def _rating(name: str, figure: DerivedFigure) -> str:
    """Return a current at the insulation limit, or why there is none."""
    if refused := known(figure.refused):
        return f"{name}: refused, {refused}"
    value = "not determined" if math.isnan(figure.median) else f"{rounded(figure.median, 4)} A"
    low, high = figure.ends
    return (
        f"{name}: {value}  95 % {rounded(low, 4)} … {rounded(high, 4)}   {known(figure.condition)}"
    )


def discovery_text(result: DiscoveryResult) -> str:
    """Return what a discovery found, for the terminal."""
    lines = [f"{result.verdict.upper()}: {result.sentence}", ""]
    for effect in result.effects:
        figures = ", ".join(
            f"{name} = {quantity(rounded(p.value), p.unit)} "
            f"({rounded(p.interval_95[0])} … {rounded(p.interval_95[1])})"
            for name, p in effect.parameters.items()
        )
        lines.append(f"{effect.id}: {figures}")
        if effect.equivalents:
            lines.append(f"  not distinguishable from {effect.equivalents_in_words()}")
    for name, gap in (("calibration", result.calibration), ("held out", result.holdout)):
        if gap is not None:
            lines.append(
                f"{name}: {gap.rmse_before_K:.2f} K RMSE before, {gap.rmse_after_K:.2f} K "
                f"after (noise {gap.noise_floor_K:.2f} K); 95 % band holds "
                f"{100 * gap.coverage_95_before:.0f} % before, "
                f"{100 * gap.coverage_95_after:.0f} % after"
            )
    if result.holdout is not None and result.holdout.took_part_in_selection:
        lines.append(result.holdout.sentence)
    if result.where:
        lines.append("What the network alone misses, with 95 % intervals:")
    for span in result.where[:MOST_SPANS]:
        missing, unit = span.missing
        low, high = span.interval_95
        lines.append(
            f"  {span.test}, {span.from_s / 60:.0f} to {span.to_s / 60:.0f} min, "
            f"{span.node}: {missing:+.3g} {unit} ({low:+.3g} … {high:+.3g})"
        )
    if len(result.where) > MOST_SPANS:
        lines.append(f"  and {len(result.where) - MOST_SPANS} more in discovery.pdf")
    test = result.next_test
    if test is not None:
        lines.append(
            f"To separate {' and '.join(test.separates)}: {test.what} (expected log Bayes "
            f"factor {test.expected_log_bayes_factor:.0f})"
        )
    return "\n".join(printable(line) for line in lines)
