"""Results as plain text for the terminal."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING

from ..checks.suitability import WEAK
from ..io.quantities import aligned, percent, printable, printed_unit, quantity, rounded
from ..readers.mapping import mapping_text
from ..record.motor import Certificate
from ..record.record import Finding
from ..results import DiscoveryResult, FitResult
from ..results.model import DerivedFigure, DescribedTest, FittedModel
from ..results.values import known
from ..runs.verdict import (
    BEFORE_PARAMETERS,
    LEFT_OUT,
    concerns,
    deciding,
    favoured,
    headline,
    not_told_apart,
    restrictions,
    thermal,
)
from .certificate import ENGLISH, at_end, certificate_content, stated_lines
from .printed import format_interval, format_value, interval_ends, ranked

if TYPE_CHECKING:  # JAX comes with it
    from ..runs.before_after import BeforeAfter, Change

ASKED = re.compile(r"(?!continuous_current_A).*_current_A|(time_to_limit_\d|starts_|pause_).*")
UNASKED = "continuous_current_A"
"""Names of ratings, and the one that nobody needs to ask for by `--rating`."""

BY_RISE = ("rise_margin_K", "continuous_current_by_rise_A")
"""What the permitted rise leaves and allows."""

RATED_BY = {
    "continuous_current_by_rise_A": "Continuous current (S1)",
    "continuous_current_A": "Continuous current (S1)",
    "steady_rise_K": "Steady rise",
}
"""What a bench decides on when it compares two runs, in words."""

MOST_SPANS = 6
"""Of what is missing; more of them are in the report."""

_MARK = {"error": "ERROR  ", "warning": "warning", "note": "note   "}


def findings_text(findings: Sequence[Finding], *, verbose: bool = False) -> str:
    """Return findings, the gravest first, a paragraph each; notes only if `verbose`, else warnings
    that differ by their test alone once, with the tests that they concern.
    """
    shown = [f for f in ranked(findings) if verbose or f.severity != "note"]
    alike: dict[Hashable, list[Finding]] = {}
    for f in shown:
        channel = f.where.removeprefix(f.test).split(", ")[1:2]
        key = f.id, f.remedy, *channel
        before = [each.test for each in alike.get(key, ())]
        is_apart = verbose or f.severity == "error" or f.test in before
        alike.setdefault((*key, len(alike)) if is_apart else key, []).append(f)
    lines = (
        printable(
            f"{_MARK[f.severity]}  {'' if f.where.startswith(f.test) else f'[{f.test}] '}"
            f"{f.sentence()}  ({f.id}{f'; {names} too' if names else ''})"
        )
        for f, *others in alike.values()
        for names in (", ".join(each.test for each in others),)
    )
    return "\n".join(dict.fromkeys(lines))  # parts of a file share what it says


MOST_LINES = 12
"""Of a result, unless that many ratings were asked for."""


def result_text(
    result: FitResult, run: str = "RUN", *, sheet: str = "", verbose: bool = False
) -> str:
    """Return a result in a dozen lines: verdict, parameters, errors and what to do next.

    Args:
        result: What stands in `fit.json`.
        run: The run folder, as it is to be typed.
        sheet: Path of the sheet; empty where there is none.
        verbose: Whether all networks, how they were drawn, columns and warnings follow.
    """
    model = result.models[favoured(result)]
    said, *restricted = verdict_lines(result)
    head = [said, " ".join(restricted)] if restricted else [said]
    tail = []
    taus = [
        "{} s ({} … {})".format(*_told_apart(tau.median, *tau.ends))
        for name in ("tau_s", "tau_fast_s", "tau_slow_s")
        if (tau := model.derived.get(name)) is not None and not math.isnan(tau.median)
    ]
    if taus:
        tail.append(f"Time constant{'s' if len(taus) > 1 else ''}: {' and '.join(taus)}, losses "
                    "held; in brackets 95 % intervals")  # fmt: skip
    tail.append(f"RMSE: fitted {_errors(model, 'calibration')}; held out "
                f"{_errors(model, 'holdout')}")  # fmt: skip
    warnings = (f for f in result.findings if f.severity != "note")
    ids = list(dict.fromkeys(f.id for f in warnings if concerns(f, result)))
    told = f"warnings ({', '.join(ids)}), " if ids else ""
    rest = "" if verbose else f"with -v: {told}all networks, how each column was read"
    last = "; ".join(filter(None, [sheet and f"Sheet: {sheet}", rest]))
    last = [f"Next: {next_step(result, run)}", *filter(None, [last[:1].upper() + last[1:]])]
    tail += [_rating(*each) for each in model.derived.items() if ASKED.fullmatch(each[0])]
    room = MOST_LINES - len(head) - len(tail) - len(last)
    lines = [*head, *_parameters(result, model, room), *tail, *last]
    lines += _rest(result) if verbose else []
    return "\n".join(printable(line) for text in lines for line in text.split("\n"))


def _told_apart(value: float, low: float, high: float) -> tuple[str, ...]:
    """Return a value and its limits to three digits, or five where both limits are one in three."""
    digits = 3 if rounded(low) != rounded(high) else 5
    texts = (f"{one:#.{digits}g}".rstrip(".") for one in (value, low, high))  # 84.0 and not 84
    return tuple(rounded(float(text), digits) if "e" in text else text for text in texts)


def verdict_lines(result: FitResult) -> list[str]:
    """Return whether a result can be used, what restricts it, and which effects may be others."""
    said = headline(result)
    return [f"{said.use.upper()}: {said.sentence}", *restrictions(result), *not_told_apart(result)]


def next_step(result: FitResult, run: str) -> str:
    """Return the one thing to do next: what decides the verdict comes first."""
    decisive = deciding(result)
    if decisive and decisive[0].id in BEFORE_PARAMETERS:
        return decisive[0].remedy
    network = thermal(result.models[favoured(result)])
    for judgement in ("not identifiable", "weak"):
        poor = {
            name: entry for name, entry in network.items() if entry.identifiability == judgement
        }
        for name, entry in poor.items():
            # what a longer test would give stands behind what is in the way
            longer = (known(entry.why) or "").partition(". ")[2]
            if longer:
                return f"{longer.rstrip('.')} for {name}"
        remedies = [f.remedy for f in result.findings if f.id in ("no_heating", *WEAK)]
        if poor and any(remedies):
            return next(filter(None, remedies))
    if decisive:
        is_plain = LEFT_OUT in {finding.id for finding in decisive}
        return (is_plain and _without_plain(result.command)) or decisive[0].remedy
    if headline(result).use != "usable":
        return "add a test with several steps of load and a cool-down"
    if all(test.role != "holdout" for test in result.tests):
        return "see how well it predicts a test that was not fitted: --holdout TEST"
    return f"heatrun simulate {result.motor.path or 'MOTOR.toml'} {run} TEST predicts other loads"


def _without_plain(command: str) -> str:
    """Return the command of a run without --plain and its folder; empty if it has none."""
    words = shlex.split(command)
    if "--plain" not in words:
        return ""
    words.remove("--plain")
    place = words.index("--out") if "--out" in words else len(words)
    del words[place : place + 2]
    return shlex.join(word for word in words if not word.startswith("--out="))


def _parameters(result: FitResult, model: FittedModel, most: int) -> list[str]:
    """Return the parameters as page 1 of the sheet has them, and the conditions of the tests, in at
    most so many lines: several parameters share one where there are more of them.

    Where effects change a resistance, that at stated conditions takes the place of its law.
    """
    content = certificate_content(result, Certificate())
    rows, effects = [], {}
    for line, (name, meaning, text, judged) in zip(
        stated_lines(model), content["parameters"], strict=True
    ):
        if judged == ENGLISH("of_motor_file"):
            continue
        effect, dot, own = name.partition(".")
        if dot:
            effects.setdefault(effect, []).append(f"{own} {text} ({meaning})")
        else:
            condition = "" if line.figure is None else f" at {known(line.figure.condition)}"
            rows.append((name, text, judged + condition))
    behind = [f"in the tests: {dict(content['statement'])['Conditions']}"]
    if effects:
        told = (f"{effect}: {', '.join(parts)}" for effect, parts in effects.items())
        behind.insert(0, "; ".join(told))
    each = max(1, -(-len(rows) // max(1, most - len(behind))))
    if each == 1:
        widths = [max([0, *(len(row[i]) for row in rows)]) for i in range(2)]
        rows = [(row[0].ljust(widths[0]), row[1].ljust(widths[1]), row[2]) for row in rows]
    cells = [("  " if each == 1 else " ").join(row) for row in rows]
    together = ["; ".join(cells[at : at + each]) for at in range(0, len(cells), each)]
    return [f"  {line}" for line in (*together, *behind)]


def _errors(model: FittedModel, role: str) -> str:
    """Return the errors of the tests of a role, the worst of them."""
    rows = [row for row in model.residuals if row.role == role]
    if not rows:
        return "none"
    worst = max(rows, key=lambda row: row.rmse_K)
    among = f" in {worst.test}, the worst of {len(rows)}" if len(rows) > 1 else ""
    return f"{worst.rmse_K:.2f} K (largest error {max(row.max_K for row in rows):.1f} K){among}"


def _rest(result: FitResult) -> list[str]:
    """Return what the dozen lines leave out."""
    lines = []
    for model in result.models.values():
        lines += ["", f"{model.title.capitalize()} {model.effects_in_words()}".rstrip()]
        width = max([7, *map(len, model.parameters)])
        for name, entry in model.parameters.items():
            low, high = interval_ends(entry.interval_95, entry.sd)
            lines.append(
                f"  {name:<{width}} {rounded(entry.value, 5):>11} {printed_unit(entry.unit):<4} "
                f"95 % {low} … {high}   {entry.identifiability or ''}: {entry.why or ''}"
            )
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
        for name in ("steady_rise_K", *BY_RISE, UNASKED):
            figure = model.derived.get(name)
            if figure is not None and not known(figure.refused):
                lines.append(f"  {_rating(name, figure)}")
        lines.append(f"  {model.posterior.verdict}")
        if model.about_missing():
            lines.append(f"  {model.about_missing()}")
    lines += [f"  {said}" for test in result.tests if (said := _at_end(test))]
    lines += ["", result.verdict.sentence]
    if result.comparison is not None:
        lines += [f"  {sentence}" for sentence in result.comparison.words]
    columns = mapping_text(result.tests)
    if columns:
        lines += ["", columns]
    return [*lines, "", findings_text(result.findings, verbose=True)]


def _at_end(test: DescribedTest) -> str:
    """Return whether the winding had settled when a test ended, and where its readings tend to."""
    found, said = known(test.equilibrium), at_end(test)
    if found is None:
        return said
    for what, rise, ends, how in (
        ("its readings alone tend", found.continued_K, found.continued_95_K, "by one exponential"),
        ("the network tends", found.network_K, found.network_95_K, "under its last load"),
    ):
        if rise is not None and ends is not None:
            both = format_interval(ends, 0.5 * (ends[1] - ends[0]))
            said += (
                f"; {what} to a rise of {rounded(rise, 3)} K (95 % {both} K), extrapolated {how}"
            )
    return said


def _rating(name: str, figure: DerivedFigure) -> str:
    """Return a current at a limit of the insulation or what is left to it, or why there is none."""
    if refused := known(figure.refused):
        return f"{name}: none; {refused}"
    value = (
        "not determined"
        if math.isnan(figure.median)
        else quantity(rounded(figure.median, 4), known(figure.unit) or "")
    )
    low, high = (rounded(end, 4) if math.isfinite(end) else "∞" for end in figure.ends)
    return f"{name}: {value}  95 % {low} … {high}   {known(figure.condition)}"


def changes_text(found: BeforeAfter) -> str:
    """Return what changed between two runs: the one sentence, the ratings, the table, what is not
    compared.
    """
    lines = [found.sentence, *_ratings(found), *found.notes, ""]
    head = ["", "before (95 %)", "after (95 %)", "after - before (95 %)", "relative (95 %)", "grew",
            f"changed > {rounded(100.0 * found.size)} %"]  # fmt: skip
    rows = [head]
    for each in found.changes:
        name = f"{each.name} [{printed_unit(each.unit)}]".replace(" []", "")
        rows.append([name, *_cells(each), percent(each.grew), percent(each.changed)])
    lines += aligned(rows)
    conditions = {each.name: each.condition for each in found.changes if each.condition}
    for title, told in (("Holds at", conditions), ("Not compared", found.not_compared)):
        if told:
            by_text: dict[str, list[str]] = {}
            for name, text in told.items():
                by_text.setdefault(text, []).append(name)
            lines += ["", title, *(f"  {', '.join(of)}: {text}" for text, of in by_text.items())]
    return "\n".join(printable(line) for line in lines)


def _cells(change: Change) -> list[str]:
    """Return before, after, the difference and the relative one with their intervals."""
    cells = []
    for one in (change.before, change.after, change.difference):
        low, high = one.interval_95
        U = 0.5 * (high - low)
        cells.append(f"{format_value(one.value, U)[0]} ({format_interval((low, high), U)})")
    low, high = (f"{100.0 * end:+.1f}" for end in change.relative.interval_95)
    return [*cells, f"{100.0 * change.relative.value:+.1f} % ({low} … {high})"]


def _ratings(found: BeforeAfter) -> list[str]:
    """Return what the machine is rated by before and after, where both runs state it."""
    lines, changes = [], {each.name: each for each in found.changes}
    for name in (name for name in RATED_BY if name in changes):
        change = changes[name]
        before, after, _, relative = _cells(change)
        grew = change.relative.value >= 0.0
        chance = percent(change.grew if grew else 1.0 - change.grew)
        verb, unit = "grew" if grew else "fell", printed_unit(change.unit)
        at, _, losses = change.condition.partition(", other losses")
        _, word, beyond = losses.partition("extrapolated, ")
        lines.append(f"{RATED_BY[name]} at {at}: {before} {unit} before, {after} {unit} after, "
                     f"{relative}; probability {chance} that it {verb}"
                     f"{', ' if word else ''}{word}{beyond}.")  # fmt: skip
    return lines


def discovery_text(result: DiscoveryResult) -> str:
    """Return what a discovery found, for the terminal."""
    lines = [f"{result.verdict.upper().replace('_', ' ')}: {result.sentence}"]
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
