"""What the sheet says, as text in tables: the same words go to PDF, XLSX and JSON."""

import re
from collections.abc import Sequence
from typing import Any

from ..io.quantities import clean, quantity
from ..io.texts import LANGUAGES, Texts, table
from ..io.whole_files import command_without_folders, without_folders
from ..readers.mapping import KNOWN_BY, assumption, grouped
from ..record.motor import Certificate
from ..record.record import Finding
from ..results import FitResult
from ..results.model import AT_REST, LOADED, DerivedFigure, DescribedTest, FittedModel
from ..results.values import Interval, combined, known
from ..runs.verdict import concerns, favoured
from .certificate import (
    ParameterLine,
    certificate_content,
    figure_lines,
    page_figures,
    places_of_current,
    stated_lines,
)
from .printed import format_interval, format_value, num_stated, ranked, signed, told


def sheet_content(
    result: FitResult, certificate: Certificate | None = None, say: Texts | None = None
) -> dict[str, Any]:
    """Return titles, tables and sentences of the sheet as plain text.

    What is on the pages is about the network that is certified alone; `verdict`, `comparison`,
    `columns` and `findings` are for the files beside them.

    Args:
        result: What stands in `fit.json`.
        certificate: What the laboratory states; None for nothing.
        say: The texts in the language of the sheet; None for that which the certificate states.
    """
    motor = result.motor
    certificate = certificate or Certificate()
    say = say or Texts(certificate.language or LANGUAGES[0])
    model = result.models[favoured(result)]
    own = ranked([each for each in result.findings if concerns(each, result)])
    graver = [each for each in own if each.severity != "note"]
    columns = [(clean(names), rows, _assumed(rows)) for names, rows in grouped(result.tests)]
    return {
        "title": clean(motor.name),
        "language": say.language,
        "certificate": certificate_content(result, certificate, say),
        "verdict": clean(result.verdict.sentence),
        "meta": [
            ["heatrun", result.heatrun_version],
            [say("made_by_command"), clean(command_without_folders(result.command))],
            [say("made_by_seed"), str(result.seed)],
        ],
        "definitions": _definitions(result, model, say),
        "tests": [_test(test, say) for test in result.tests],
        "columns": [
            {"tests": names, "rows": rows, "assumed": assumption(channels) if channels else ""}
            for names, rows, channels in columns
        ],
        "residuals": _residuals(model, say),
        "bodies": _bodies(model, say),
        "replica": _replica(model, say),
        "derived": _derived(model, say),
        # that of effects stands in the workbook
        "budget": _budget([*stated_lines(model, say), *figure_lines(model, say)], say),
        "graver": [[say(each.severity), _sentence(each, result, say)] for each in graver],
        "after_findings": _after_findings(graver, len(own) - len(graver), say),
        "comparison": [clean(w) for w in (result.comparison.words if result.comparison else ())],
        "findings": [[each.severity, _sentence(each, result, say)] for each in own],
        "limits": [
            say("scale_of_losses"),
            *filter(None, [say.again(model.about_missing())]),
            *(
                say("assumed_units", channels=", ".join(channels))
                for channels in dict.fromkeys(tuple(each) for *_, each in columns if each)
            ),
            say("elsewhere"),
        ],
        "files": [
            [clean(test.name), known(test.start) or "–", test.sha256 or say("in_memory")]
            for test in result.tests
        ],
        "labels": {key: say(key) for key in LABELS},
    }


LABELS = (
    "annex", "parameter", "findings", "tests", "test", "role", "length", "current_A",
    "speed_rpm", "winding_degC", "sink_degC", "date", "sha256", "residuals", "derived", "figure",
    "value", "interval", "condition_or_refusal", "measured_body", "node", "rmse_K", "max_K",
    "mean_K", "in_band", "definitions", "remarks", "instruments", "instruments_listed",
    "instrument_quantity", "instrument", "instrument_class", "instrument_calibration",
    "instrument_valid", "signature", "page", "of", "more_reasons", "more_parameters",
    "value_or_interval", "budget", "budget_rule",
)  # fmt: skip
"""Texts that the template of the pages sets by itself."""


def _assumed(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the channels whose unit nothing said."""
    return [row[0] for row in rows if row[3] == KNOWN_BY["assumed"]]


def _sentence(finding: Finding, result: FitResult, say: Texts) -> str:
    paths = [result.motor.path, *(test.path for test in result.tests)]
    return clean(without_folders(told(finding, say)[0], paths))


def _after_findings(graver: Sequence[Finding], num_notes: int, say: Texts) -> str:
    """Return what stands below the findings."""
    parts = ["" if graver or num_notes else say("none")]
    parts.append(say("notes_elsewhere", num=num_notes) if num_notes else "")
    is_whole = all(told(each, say)[1] for each in graver)
    parts.append("" if is_whole else say("findings_in_english"))
    return " ".join(part for part in parts if part)


def _definitions(result: FitResult, model: FittedModel, say: Texts) -> list[list[str]]:
    """Return the symbols and what they stand for."""
    sink = f"{result.motor.sink}_degC"
    is_stated = num_stated(result.tests, sink) == len(result.tests)
    rows = [["Tw", say("Tw")]]
    if "stator" in model.nodes:
        rows.append(["Tsr", say("Tsr")])
    rows += [
        ["Pjs", say("Pjs")],
        ["Pol", say(f"Pol_{result.motor.losses}")],
        ["T0", say("T0_stated" if is_stated else "T0", sink=result.motor.sink)],
    ]
    second = known(model.sinks)
    return rows + ([[f"T {second[1]}", say("second_sink", name=second[1])]] if second else [])


def _test(test: DescribedTest, say: Texts) -> list[str]:
    def span(values: Interval | None, digits: int = 0) -> str:
        if values is None:
            return "–"
        return say.number(f"{values[0]:.{digits}f} … {values[1]:.{digits}f}")

    return [
        clean(test.name),
        say(test.role),
        say.number(f"{test.duration_s / 60:.1f}"),
        span(test.current_A, places_of_current(test.current_A)),
        span(test.speed_rpm),
        span(test.winding_degC, 1),
        span(test.sink_degC, 1),
        known(test.start) or "–",
        test.sha256[:16] if test.sha256 else say("in_memory"),
    ]


def _residuals(model: FittedModel, say: Texts) -> dict[str, Any]:
    """Return head and rows of the table of residuals, with those of the replica where it is."""
    replica = known(model.replica)
    keys = ["test", "role", "rmse_K", "mae_K", "max_K", "end_K", "in_band"]
    rows = []
    for row in model.residuals:
        numbers = [f"{row.rmse_K:.2f}", f"{row.mae_K:.2f}", f"{row.max_K:.2f}",
                   signed(row.end_K, 2), f"{100 * row.coverage_95:.0f} %"]  # fmt: skip
        if replica:
            error = replica.rmse_K.get(row.test)
            numbers.append("–" if error is None else f"{error:.2f}")
        rows.append([clean(row.test), say(row.role), *map(say.number, numbers)])
    return {"head": [say(key) for key in keys + ["replica_K"] * bool(replica)], "rows": rows}


def _bodies(model: FittedModel, say: Texts) -> list[list[str]]:
    rows = []
    for row in known(model.bodies) or ():
        numbers = (f"{row.rmse_K:.2f}", signed(row.mean_K, 2), f"{row.max_K:.2f}",
                   f"{100 * row.coverage_95:.0f} %")  # fmt: skip
        body, node = (name.replace("_", " ") for name in (row.body, row.node))
        how = say("fitted_as" if row.fitted else "against", node=node)
        body = say.again(clean(body.removesuffix(" degC")))
        rows.append([body, clean(row.test), how, *map(say.number, numbers)])
    return rows


def _replica(model: FittedModel, say: Texts) -> str:
    """Return the sentence on the plain network that is nearest; empty where there is none."""
    replica = known(model.replica)
    if replica is None:
        return ""
    return say("replica", numbers=replica.numbers(), K=f"{replica.from_model_K:.2f}")


MOST_SOURCES = 4
"""Sources that the sheet names."""


def _budget(lines: Sequence[ParameterLine], say: Texts) -> dict[str, Any]:
    """Return head and rows of parameters: standard uncertainty to first order and by draws, and
    what each source has of the variance; those of no great share to any parameter together.
    """
    largest: dict[str, float] = {}
    lines = [line for line in lines if line.budget and "." not in line.name]
    for row in (row for line in lines for row in line.budget):
        largest[row.source] = max(row.share, largest.get(row.source, 0.0))
    named = sorted(largest, key=lambda source: -largest[source])[:MOST_SOURCES]
    head = [say(key) for key in ("parameter", "budget_u", "budget_draws")]
    head += [*map(say.again, named), say("budget_others", num=len(largest) - len(named))]
    rows = []
    for line in lines:
        both = (format_value(u, line.sd)[0] for u in (combined(line.budget), line.sd))
        shares = {row.source: row.share for row in line.budget}
        parts = [shares.pop(source, 0.0) for source in named]
        rows.append([
            clean(line.name), *(say.number(quantity(u, line.unit)) for u in both),
            *(f"{100.0 * share:.0f} %" for share in (*parts, sum(shares.values()))),
        ])  # fmt: skip
    return {"head": head, "rows": rows}


ASKED = re.compile(
    r"(?P<what>time_to_limit|starts|pause)_(?P<load>.+?)(_s)?|(?P<duty>S.+)_current_A"
)
"""Names of figures that `--rating` asks for."""


def _named(figure: str, say: Texts) -> str:
    """Return a derived figure in words; one that the table lacks, such as of a node, by its key."""
    key = f"figure_{figure}"
    if key not in table() and (found := ASKED.fullmatch(figure)):
        what, load = found["what"] or "current", found["load"] or found["duty"]
        asked, _, start = load.rpartition("_")
        if start in ("cold", "hot"):
            load = say(f"asked_{start}", load=asked)
        return say(f"figure_{what}", load=load.replace("_", " "))
    return say(key) if key in table() else figure


def _derived(model: FittedModel, say: Texts) -> list[list[str]]:
    """Return name, value, condition and interval of each figure that page 1 has not; those that
    have no value for one reason in one row. Time constants beside its two are in the workbook.
    """
    rows: list[list[str]] = []
    above = page_figures(model)
    for key, entry in model.derived.items():
        if key in above or key.endswith((LOADED, AT_REST)) or key.startswith("tau_"):
            continue
        name, said = _named(key, say), _stated(entry, say)
        if known(entry.refused) and rows and rows[-1][1:] == said:
            rows[-1][0] += f"; {name}"
        else:
            rows.append([name, *said])
    return rows


def _stated(entry: DerivedFigure, say: Texts) -> list[str]:
    """Return value, condition and interval of a figure, or why it has none."""
    if refusal := known(entry.refused):
        return [say("refused"), say.again(refusal), ""]
    sd, unit = known(entry.sd), known(entry.unit) or ""
    value, _ = format_value(known(entry.value), sd)
    ends = format_interval(known(entry.interval_95), sd).replace("not determined", "∞")
    return [quantity(say.again(value), unit), say.again(known(entry.condition) or ""),
            " … ".join(say.again(end) for end in ends.split(" … "))]  # fmt: skip
