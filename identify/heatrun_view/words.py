"""Sentences and tables of the page as HTML; everything that comes from a file is escaped."""

import traceback
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from heatrun.errors import InputError
from heatrun.io.quantities import printed_unit, rounded
from heatrun.record.record import Finding
from heatrun.reports.terminal import ranked, verdict_lines
from heatrun.results import DiscoveryResult, FitResult
from heatrun.runs.verdict import favoured
from heatrun.shutdown.printed import BUDGET, answer_lines, budget_cells, budget_sum, hand_cells
from heatrun.shutdown.result import ShutdownResult


def message(kind: str, text: str) -> str:
    """Return a framed sentence of plain text, an `"error"`, a `"warning"` or a `"note"`."""
    return f'<p class="{kind}">{escape(text)}</p>'


def error_message(error: InputError) -> str:
    """Return what was expected, what came, where and what to do."""
    where = f"<b>{escape(error.where)}</b>: " if error.where else ""
    return f'<p class="error">{where}{escape(error.problem)} {escape(error.remedy)}</p>'


def problem(name: str, error: Exception) -> str:
    """Return what went wrong with a file as HTML; what is not the file's fault is printed too."""
    if isinstance(error, InputError):
        return error_message(error)
    if isinstance(error, MemoryError):
        return message("error", f"{name}: there is not enough memory to read it.")
    traceback.print_exception(error)
    words = f"{name}: internal error ({error!r:.200}); the details are in the terminal."
    return message("error", words)


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table; cells that are no text are set as numbers."""
    cells = "".join(f"<th>{escape(each)}</th>" for each in head)
    body = "".join("<tr>" + "".join(map(_cell, row)) + "</tr>" for row in rows)
    return f"<table><tr>{cells}</tr>{body}</table>"


def findings_html(findings: Sequence[Finding]) -> str:
    """Return findings, the gravest first."""
    if not findings:
        return message("note", "No findings: the records are ready to be fitted.")
    return "".join(
        message(
            f.severity,
            f"{'' if f.where.startswith(f.test) else f'[{f.test}] '}{f.sentence()} ({f.id})",
        )
        for f in ranked(findings)
    )


def calibration_html(result: FitResult) -> str:
    """Return the heart of `fit.json`: parameters with intervals, errors, comparison."""
    parts = [f"<p>{escape(each)}</p>" for each in verdict_lines(result)[1:]]
    certified = favoured(result)  # stands first
    for name in sorted(result.models, key=lambda each: each != certified):
        model = result.models[name]
        parameters = [
            (name, entry.value, _range(entry.interval_95), printed_unit(entry.unit),
             f"{entry.identifiability or ''}: {entry.why or ''}")
            for name, entry in model.parameters.items()
        ]  # fmt: skip
        residuals = [(row.test, row.role, row.rmse_K, row.max_K, f"{100 * row.coverage_95:.0f} %")
                     for row in model.residuals]  # fmt: skip
        parts += [
            f"<h3>{escape(model.title.capitalize())}</h3>",
            table(("parameter", "value", "95 % interval", "unit", "identifiable from these tests"),
                  parameters),
            table(("test", "role", "RMSE [K]", "maximum error [K]", "coverage of the 95 % band"),
                  residuals),
            f"<p class='faded'>{escape(model.posterior.verdict)}</p>",
            f"<p class='faded'>{escape(model.about_missing())}</p>",
        ]  # fmt: skip
    parts.append(f"<p>{escape(result.verdict.sentence)}</p>")
    if result.comparison is not None:
        parts += [f"<p>{escape(sentence)}</p>" for sentence in result.comparison.words]
    return "".join(parts)


def discovery_html(result: DiscoveryResult) -> str:
    """Return the heart of `discovery.json`: what was found, where, every candidate."""
    parts = []
    for effect in result.effects:
        rows = [(name, p.value, _range(p.interval_95), printed_unit(p.unit))
                for name, p in effect.parameters.items()]  # fmt: skip
        parts.append(f"<p><b>{escape(effect.id)}</b></p>")
        parts.append(table(("parameter", "value", "95 % interval", "unit"), rows))
        if alike := ", ".join(effect.equivalents):
            parts.append(message("warning", f"Not distinguishable from {alike} with these tests."))
    gaps = [
        (label, gap.rmse_before_K, gap.rmse_after_K, gap.noise_floor_K)
        for label, gap in (("calibration", result.calibration), ("held out", result.holdout))
        if gap is not None
    ]
    parts.append(table(("tests", "RMSE before [K]", "after [K]", "noise [K]"), gaps))
    if result.where:
        head = ("test", "from [min]", "to [min]", "node", "missing", "95 % interval")
        spans = [(span.test, span.from_s / 60, span.to_s / 60, span.node,
                  f"{span.missing[0]:+.3g} {span.missing[1]}", _range(span.interval_95))
                 for span in result.where]  # fmt: skip
        parts += ["<h3>Where model and measurement disagree</h3>", table(head, spans)]
    return "".join(parts)


def shutdown_html(result: ShutdownResult) -> str:
    """Return the winding at switch-off: the answer, what is left, by hand, where from it is."""
    first, *rest = answer_lines(result)
    return "".join([
        f"<h3>{escape(first)}</h3>" if result.is_determinable else message("error", first),
        *(f"<p>{escape(line)}</p>" for line in rest),
        "<h3>By hand from the same readings</h3>",
        table(("method", "winding [°C]", "difference [K]", "source"), hand_cells(result)),
        "<h3>Where the uncertainty comes from (GUM)</h3>",
        table(BUDGET, budget_cells(result)),
        f"<p>{escape(budget_sum(result))}</p>",
        *(f"<p class='faded'>{escape(note)}</p>" for note in result.notes),
    ])  # fmt: skip


def _range(interval: Sequence[float]) -> str:
    return f"{rounded(interval[0], 4)} … {rounded(interval[1], 4)}"


def _cell(value: Any) -> str:
    if isinstance(value, float | int) and not isinstance(value, bool):
        return f'<td class="number">{rounded(value, 4)}</td>'
    return f"<td>{escape(str(value))}</td>"
