"""What the report on several prototypes says in words and tables."""

from __future__ import annotations

from heatrun.bench.checks.samples import median_step, samples

from ..analysis.compare_figures import FigureComparison
from ..analysis.compare_signals import SignalComparison, place
from ..analysis.general_information import FIGURES
from ..figure_cells import figure_cells
from ..figures.plot import unit, wording
from ..report import Column, Line, Row, Table
from .confront import Compared, Confrontation
from .prototype import Prototype
from .summary import counts

DECIDED = {"uncertainty": "instruments"}
"""What decided a tolerance, where the word of the column is another one."""

AT_A_GLANCE = 6
"""Pairs whose verdicts fit beside each other across a page."""

PAIR_COLUMNS = (
    Column("clock offset", "s"),
    Column("bias"),
    Column("RMSE"),
    Column("largest"),
    Column("correlation", "1"),
    Column("tolerance"),
    Column("decided by", ""),
    Column("inside", "%"),
    Column("verdict", ""),
)
CLOCK_COLUMNS = (
    Column("clock offset", "s"),
    Column("standard uncertainty", "s"),
    Column("agree", ""),
)
FIGURE_COLUMNS = (
    Column("later"),
    Column("earlier"),
    Column("difference", "%"),
    Column("tolerance"),
    Column("verdict", ""),
)
NETWORK_COLUMNS = (
    Column("driven by", ""),
    Column("bias"),
    Column("RMSE"),
    Column("largest"),
    Column("tolerance"),
    Column("in the band", "%"),
    Column("verdict", ""),
)


def signals_of(found: Confrontation) -> tuple[str, ...]:
    """Return the channels that any pair compares: what is evidence first, temperatures of it."""
    signals = [s for pair in found.pairs for s in pair.validation.signals]
    shared = {s.channel for s in signals if s.verdict != "not comparable"}
    judged = {s.channel for s in signals if s.verdict not in ("input", "not comparable")}
    return tuple(sorted(shared, key=lambda name: (name not in judged, place(name))))


def rows(found: Confrontation) -> tuple[Row, ...]:
    """Return the main table: who stands where on which clock, and how many signals agree."""
    from_s, to_s = found.window_s
    main = [
        Row("base", "Clock kept", found.base.role, "", found.base.record.name),
        Row("common_s", "Time common to all", to_s - from_s, "s",
            f"from {from_s:.1f} s on the clock of {found.base.role}"),
    ]  # fmt: skip
    for pair in found.pairs:
        agree, judged = counts(pair)
        main.append(
            Row(f"agree_{_name(pair)}", f"Agreement of {pair.name}", f"{agree} of {judged}", "",
                "judged signals and figures")
        )  # fmt: skip
    return tuple(main)


def tables(found: Confrontation) -> tuple[Table, ...]:
    """Return all further tables."""
    glance = [_at_a_glance(found)] if len(found.pairs) <= AT_A_GLANCE else []
    made = [_records(found), _clocks(found), *glance, *_signals(found)]
    made += [_information(found), *_figures(found)]
    if found.networks:
        made.append(_networks(found))
    return tuple(made)


def _name(pair: Compared) -> str:
    return f"{pair.later.role} minus {pair.earlier.role}".replace(" ", "_")


def _records(found: Confrontation) -> Table:
    columns = tuple(Column(p.role) for p in found.prototypes)
    axes = [samples(p.record)[0] for p in found.prototypes]
    from_s = [found.shift_s[p.role] + float(a[0]) for p, a in zip(found.prototypes, axes,
                                                                strict=True)]  # fmt: skip
    lines = (
        Line("record", "", tuple(p.record.name for p in found.prototypes)),
        Line("came about", "", tuple(_origin(p) for p in found.prototypes)),
        Line("begins, on the clock kept", "s", tuple(map(_milliseconds, from_s))),
        Line("lasts", "min", tuple(float(a[-1] - a[0]) / 60.0 for a in axes)),
        Line("sampling period", "s", tuple(median_step(a) for a in axes)),
        Line("samples", "1", tuple(float(a.size) for a in axes)),
    )  # fmt: skip
    return Table("Prototypes", columns, lines)


def _milliseconds(seconds: float) -> float:
    """An offset to the millisecond, which no search finds: the rest would be printed as 4e-04."""
    return round(seconds, 3) + 0.0


def _origin(prototype: Prototype) -> str:
    if prototype.reference.is_of_heatrun:
        return "simulated by heatrun"
    return "model, by its role" if prototype.is_simulated else "measured"


def _clocks(found: Confrontation) -> Table:
    lines = []
    for pair in found.pairs:
        offset = pair.validation.pair.offset
        agree, judged = counts(pair)
        sd_s = offset.sd_s if offset.sd_s > 0.0 else None
        cells = (_milliseconds(offset.offset_s), sd_s, f"{agree} of {judged}")
        lines.append(Line(pair.name, "", cells, offset.method))
    return Table("Clocks of the pairs", CLOCK_COLUMNS, tuple(lines))


def _at_a_glance(found: Confrontation) -> Table:
    columns = tuple(Column(pair.name, "") for pair in found.pairs)
    lines = []
    for channel in signals_of(found):
        verdicts = [_of(pair, channel) for pair in found.pairs]
        cells = tuple(None if v is None else v.verdict for v in verdicts)
        lines.append(Line(wording(channel), "", cells))
    names = [f.name for pair in found.pairs for f in pair.validation.judged_figures]
    for name in dict.fromkeys(names):
        figures = [_figure_of(pair, name) for pair in found.pairs]
        label = next(f.label for f in figures if f is not None)
        cells = tuple(None if f is None else f.verdict for f in figures)
        lines.append(Line(label, "", cells))
    return Table("Verdicts at a glance", columns, tuple(lines))


def _signals(found: Confrontation) -> list[Table]:
    lines = []
    for channel in signals_of(found):
        for pair in found.pairs:
            signal = _of(pair, channel)
            if signal is not None and signal.verdict != "not comparable":
                lines.append(_line(pair, signal))
    return [Table("Signal by signal, pair by pair", PAIR_COLUMNS, tuple(lines))]


def _line(pair: Compared, signal: SignalComparison) -> Line:
    decided = signal.tolerance.decided_by
    cells = (
        _milliseconds(pair.validation.pair.offset.offset_s),
        signal.bias,
        signal.rmse,
        signal.largest,
        signal.correlation,
        signal.tolerance.value,
        DECIDED.get(decided, decided),
        100.0 * signal.share_inside,
        signal.verdict,
    )
    name = f"{wording(signal.channel)}, {pair.name}"
    return Line(name, unit(signal.channel, is_difference=True), cells)


def _information(found: Confrontation) -> Table:
    columns = tuple(Column(p.role) for p in found.prototypes)
    lines = []
    for name, label, symbol in FIGURES:
        values, reasons = [], []
        for prototype in found.prototypes:
            info = found.information[prototype.role]
            values.append(None if info is None else getattr(info, name))
            if info is not None and name in info.undefined:
                reasons.append(f"{prototype.role}: {info.undefined[name]}")
        lines.append(Line(label, symbol, tuple(values), "; ".join(reasons)))
    return Table("General Information over the time in common", columns, tuple(lines))


def _figures(found: Confrontation) -> list[Table]:
    lines = [
        Line(f"{one.label}, {pair.name}", one.unit, figure_cells(one), one.note)
        for pair in found.pairs
        for one in pair.validation.figures
    ]
    if not lines:
        return []
    return [Table("Energy, distance and consumption, pair by pair", FIGURE_COLUMNS, tuple(lines))]


def _networks(found: Confrontation) -> Table:
    lines = []
    for one in found.networks:
        for signal in one.temperatures:
            band = signal.share_in_band
            cells = (
                one.driven_by,
                signal.bias,
                signal.rmse,
                signal.largest,
                signal.tolerance.value,
                None if band is None else 100.0 * band,
                signal.verdict,
            )
            name = f"{wording(signal.channel)}, {one.prototype.role}"
            lines.append(Line(name, "K", cells))
    return Table("The network of the run on each prototype", NETWORK_COLUMNS, tuple(lines))


def _of(pair: Compared, channel: str) -> SignalComparison | None:
    return next((s for s in pair.validation.signals if s.channel == channel), None)


def _figure_of(pair: Compared, name: str) -> FigureComparison | None:
    return next((f for f in pair.validation.judged_figures if f.name == name), None)
