"""Validation reports: the bench beside a virtual model, or beside the real prototype."""

from collections import Counter
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Literal

from heatrun.record.motor import Motor
from heatrun.record.record import Record

from .analysis.validation import (
    PERCENT,
    RULE,
    VERDICTS,
    FigureComparison,
    SignalComparison,
    Validation,
    validate,
)
from .plot import overlay, wording
from .report import Column, Drawing, Line, Report, Row, Table, unit
from .simulated import Reference, before, fitted_by, same_file, simulated_as

DIFFERENCE_COLUMNS = (
    Column("bias"), Column("RMSE"), Column("largest"), Column("at", "min"),
    Column("correlation", "1"), Column("tolerance"), Column("inside", "%"),
    Column("in the band", "%"), Column("verdict", ""),
)  # fmt: skip
FIGURE_COLUMNS = (
    Column("test"), Column("reference"), Column("difference", "%"), Column("tolerance"),
    Column("verdict", ""),
)  # fmt: skip

DEFINITIONS = (
    ("Difference", "Test minus reference on the common axis; means are weighted by time."),
    ("Offset", "What is added to the reference's clock to give the test's."),
    ("Inside", "Share of the compared time in which the difference is within the tolerance."),
    ("In the band", "Share of the compared time in which the test lies in the reference's 95 % "
                    "band, where it has one."),
    ("Tolerance", RULE),
    ("Agreement overall", "Every signal and figure that is evidence agrees; else the ones that do "
                          "not are named."),
)  # fmt: skip


def validation_report(
    kind: Literal["virtual", "real"],
    motor: Motor,
    record: Record,
    reference: Reference,
    *,
    tolerances: Mapping[str, float] | None = None,
    offset_s: float | None = None,
) -> Report:
    """Return the comparison of a test on the bench with the record of another prototype.

    As `heatrun_reports.analysis.validation.validate`; the kind of prototype names the report.
    """
    found = validate(record, reference, motor, tolerances=tolerances, offset_s=offset_s)
    used = Counter(signal.verdict for signal in found.signals)
    verdicts = tuple((v.capitalize(), words) for v, words in VERDICTS.items() if used[v])
    return Report(
        kind=kind,
        test=record.name,
        motor=motor.name,
        summary=before(_first(kind, record, reference), _summary(found)),
        rows=_rows(found, reference),
        tables=_tables(found),
        drawings=tuple(
            Drawing(
                f"Above, {wording(signal.channel)} of both prototypes; below, test minus reference "
                "with the tolerance shaded.",
                partial(overlay, found.pair, signal, found.bands),
            )
            for signal in _evidence_first(found)
            if signal.verdict != "not comparable"
        ),
        findings=(*record.findings, *reference.record.findings, *found.findings),
        definitions=(*DEFINITIONS, *verdicts),
        channels=tuple(signal.channel for signal in found.signals),
        sources=(*record.sources, *reference.record.sources),
        result=found,
    )


def _first(kind: Literal["virtual", "real"], record: Record, reference: Reference) -> list[str]:
    """What makes the comparison weaker than it looks."""
    sentences = [simulated_as("the test", record), same_file(record, reference.record)]
    if kind == "real":
        sentences.append(simulated_as("the reference", reference.record))
    if reference.run:
        sentences.append(fitted_by(Path(reference.run), record))
    return sentences


def _summary(found: Validation) -> str:
    judged, figures = found.judged, found.judged_figures
    if not judged and not figures:
        return "No signal in common is evidence: nothing is validated."
    agreeing = [wording(s.channel) for s in judged if s.verdict == "agrees"]
    agreeing += [lower(f.label) for f in figures if f.verdict == "agrees"]
    others = [f"{wording(s.channel)} ({s.verdict})" for s in judged if s.verdict != "agrees"]
    others += [disagreement(f) for f in figures if f.verdict != "agrees"]
    if not others:
        return f"Agrees in every judged signal and figure: {', '.join(agreeing)}."
    return (
        f"{len(agreeing)} of {len(judged) + len(figures)} judged signals and figures agree; not "
        f"{', '.join(others)}."
    )


def disagreement(figure: FigureComparison) -> str:
    """Return a figure that does not agree, with its difference, in words."""
    if figure.difference_percent is None:
        return f"{lower(figure.label)} ({figure.verdict})"
    return f"{lower(figure.label)} ({figure.verdict} by {figure.difference_percent:+.1f} %)"


def lower(label: str) -> str:
    """Return a label as it stands inside a sentence."""
    return label[0].lower() + label[1:]


def _rows(found: Validation, reference: Reference) -> tuple[Row, ...]:
    pair, offset = found.pair, found.pair.offset
    return (
        Row("reference", "Reference", pair.reference, "", reference.run),
        Row("offset_s", "Offset of the reference's clock", offset.offset_s, "s",
            f"{offset.method}; standard uncertainty {offset.sd_s:.2g} s"
            if offset.sd_s > 0.0 else offset.method),
        Row("common_s", "Time in common", float(pair.time_s[-1] - pair.time_s[0]), "s",
            f"from {pair.time_s[0]:.1f} s on the test's clock; {pair.method}"),
        Row("num_judged", "Signals judged", float(len(found.judged)), ""),
        Row("num_agree", "Signals that agree",
            float(sum(s.verdict == "agrees" for s in found.judged)), ""),
        Row("num_figures_judged", "Figures judged", float(len(found.judged_figures)), "",
            lower(named(found.figures)).replace(" and ", ", ")),
        Row("num_figures_agree", "Figures that agree",
            float(sum(f.verdict == "agrees" for f in found.judged_figures)), ""),
    )  # fmt: skip


def named(figures: Iterable[FigureComparison]) -> str:
    """Return what figures are of: of a vehicle also distance and consumption."""
    is_of_vehicle = any(not one.name.startswith("energy") for one in figures)
    return "Energy, distance and consumption" if is_of_vehicle else "Energy"


def _tables(found: Validation) -> tuple[Table, ...]:
    signals = Table(
        "Signal by signal",
        DIFFERENCE_COLUMNS,
        tuple(_line(signal) for signal in _evidence_first(found)),
    )
    figures = Table(
        f"{named(found.figures)} over the time in common",
        FIGURE_COLUMNS,
        tuple(_figure_line(figure) for figure in found.figures),
        f"Tolerances: {PERCENT} of the reference's figure, unless given.",
    )
    return tuple(table for table in (signals, figures) if table.lines)


def _figure_line(figure: FigureComparison) -> Line:
    is_given = is_judged(figure) and figure.tolerance.decided_by == "given"
    note = figure.note or ("tolerance given" if is_given else "")
    return Line(figure.label, figure.unit, figure_cells(figure), note)


def _evidence_first(found: Validation) -> list[SignalComparison]:
    return sorted(found.signals, key=lambda signal: signal not in found.judged)


def _line(signal: SignalComparison) -> Line:
    if signal.verdict == "not comparable":
        return Line(wording(signal.channel), unit(signal.channel), (None,) * 8 + (signal.verdict,))
    band = signal.share_in_band
    cells = (
        signal.bias,
        signal.rmse,
        signal.largest,
        signal.largest_at_s / 60.0,
        signal.correlation,
        signal.tolerance.value,
        100.0 * signal.share_inside,
        None if band is None else 100.0 * band,
        signal.verdict,
    )
    note = f"tolerance {signal.tolerance.basis}"
    return Line(wording(signal.channel), unit(signal.channel, is_difference=True), cells, note)


def is_judged(figure: FigureComparison) -> bool:
    """Return whether the figure has a verdict on agreement."""
    return figure.verdict in ("agrees", "differs")


def figure_cells(figure: FigureComparison) -> tuple[float | str | None, ...]:
    """Return the test's value, the reference's, their difference [%], tolerance and verdict.

    A tolerance that judged nothing is left out.
    """
    return (
        figure.test,
        figure.reference,
        figure.difference_percent,
        figure.tolerance.value if is_judged(figure) else None,
        figure.verdict,
    )
