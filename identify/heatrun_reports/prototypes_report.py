"""The report on several prototypes: virtual, semi-real, real and repeats, as PDF, CSV and JSON.

Its first lines say which pairs agree; its figures show each signal of all over each other.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import combinations, cycle
from pathlib import Path

from matplotlib.figure import Figure

from heatrun.record.motor import Motor
from heatrun.record.samples import has, median_step, samples
from heatrun.reports.figures import plain
from heatrun.reports.printed import signed

from .analysis.drive import with_powers
from .analysis.general_information import figures_of
from .analysis.validation import RULE, VERDICTS, SignalComparison, place
from .plot import CYCLE, band, finish, line, stacked, with_differences, with_gaps, wording
from .prototypes import (
    Compared,
    Confrontation,
    OnNetwork,
    Prototype,
    confront,
    is_virtual,
    judge_network,
)
from .report import Column, Drawing, Line, Report, Row, Table, unit
from .simulated import before, fitted_by, same_file, simulated_as
from .validation_report import disagreement, figure_cells, lower, named

DECIDED = {"uncertainty": "instruments", "given": "--tolerance"}
"""What decided a tolerance, where the word of the column is another one."""

AT_A_GLANCE = 6
"""Pairs whose verdicts fit beside each other across a page."""

PAIR_COLUMNS = (
    Column("clock offset", "s"), Column("bias"), Column("RMSE"), Column("largest"),
    Column("correlation", "1"), Column("tolerance"), Column("decided by", ""),
    Column("inside", "%"), Column("verdict", ""),
)  # fmt: skip
CLOCK_COLUMNS = (
    Column("clock offset", "s"), Column("standard uncertainty", "s"), Column("agree", "")
)  # fmt: skip
FIGURE_COLUMNS = (
    Column("later"), Column("earlier"), Column("difference", "%"), Column("tolerance"),
    Column("verdict", ""),
)  # fmt: skip
NETWORK_COLUMNS = (
    Column("driven by", ""), Column("bias"), Column("RMSE"), Column("largest"),
    Column("tolerance"), Column("in the band", "%"), Column("verdict", ""),
)  # fmt: skip


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
    lines = [_line(*each) for channel in signals_of(found) for each in _compared(found, channel)]
    signals = Table("Signal by signal, pair by pair", PAIR_COLUMNS, tuple(lines))
    made = [_records(found), _clocks(found), *glance, signals, _information(found)]
    made += [each for each in (_figures(found), _networks(found)) if each.lines]
    return tuple(made)


def _name(pair: Compared) -> str:
    return f"{pair.later.role} minus {pair.earlier.role}".replace(" ", "_")


def _records(found: Confrontation) -> Table:
    columns = tuple(Column(p.role) for p in found.prototypes)
    axes = [samples(p.record)[0] for p in found.prototypes]
    shifts_s = [found.shift_s[p.role] for p in found.prototypes]
    from_s = [shift + float(axis[0]) for shift, axis in zip(shifts_s, axes, strict=True)]
    lines = (
        Line("record", "", tuple(p.record.name for p in found.prototypes)),
        Line("came about", "", tuple(_origin(p) for p in found.prototypes)),
        Line("begins on the clock kept", "s", tuple(map(_milliseconds, from_s))),
        Line("lasts", "min", tuple(float(a[-1] - a[0]) / 60.0 for a in axes)),
        Line("sampling period", "s", tuple(median_step(a) for a in axes)),
        Line("samples", "1", tuple(a.size for a in axes)),
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
    signals = [{s.channel: s.verdict for s in pair.validation.signals} for pair in found.pairs]
    figures = [{f.label: f.verdict for f in p.validation.judged_figures} for p in found.pairs]
    rows = [(wording(channel), channel, signals) for channel in signals_of(found)]
    rows += [(label, label, figures) for label in dict.fromkeys(key for f in figures for key in f)]
    lines = (Line(name, "", tuple(each.get(key) for each in of)) for name, key, of in rows)
    return Table("Verdicts at a glance", columns, tuple(lines))


def _compared(found: Confrontation, channel: str) -> list[tuple[Compared, SignalComparison]]:
    """Return the pairs that compare a signal, with what came of it."""
    return [
        (pair, signal)
        for pair in found.pairs
        for signal in pair.validation.signals
        if signal.channel == channel and signal.verdict != "not comparable"
    ]


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
    for name, label, symbol, *_ in figures_of(filter(None, found.information.values())):
        values, reasons = [], []
        for prototype in found.prototypes:
            info = found.information[prototype.role]
            values.append(None if info is None else getattr(info, name))
            if info is not None and name in info.undefined:
                reasons.append(f"{prototype.role}: {info.undefined[name]}")
        lines.append(Line(label, symbol, tuple(values), "; ".join(reasons)))
    return Table("General Information over the time in common", columns, tuple(lines))


def _figures(found: Confrontation) -> Table:
    lines = [
        Line(f"{one.label}, {pair.name}", one.unit, figure_cells(one), one.note)
        for pair in found.pairs
        for one in pair.validation.figures
    ]
    all_figures = (one for pair in found.pairs for one in pair.validation.figures)
    title = f"{named(all_figures)}, pair by pair"
    return Table(title, FIGURE_COLUMNS, tuple(lines))


def _networks(found: Confrontation) -> Table:
    lines = []
    for one in found.networks:
        for signal in one.validation.judged:
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


DEFINITIONS = (
    ("Difference", "The later prototype less the earlier one, as the pair is named; means are "
                   "weighted by time."),
    ("Clocks", "Two clocks are aligned by the signals that both records have; the offset is added "
               "to the earlier one. Compared is the time common to all."),
    ("Tolerance", RULE),
    ("Decided by", "rise, magnitude: the share of it; instruments: the combined uncertainty, which "
                   "is the larger limit; --tolerance: as given there."),
    *((verdict.capitalize(), text) for verdict, text in VERDICTS.items()),
)  # fmt: skip

NETWORK = (
    "Network",
    "The network of the run, driven by currents, losses and sink of the record itself, or else of "
    "the one named; its band is in the tolerance.",
)


def prototypes_report(
    motor: Motor,
    prototypes: tuple[Prototype, ...],
    *,
    run: Path | None = None,
    tolerances: Mapping[str, float] | None = None,
) -> Report:
    """Return the comparison of any number of prototypes, and of the network of a run with each.

    Tolerances are by channel or figure, in its unit (K for temperatures).

    Raises:
        InputError: If they cannot be aligned, or the run cannot be read.
    """
    found = confront(prototypes, motor, tolerances)
    if run is not None:
        networks, findings = judge_network(run, prototypes, found.shift_s, motor, tolerances)
        found = replace(found, networks=networks, findings=(*found.findings, *findings))
    roles = [prototype.role for prototype in prototypes]
    return Report(
        kind="prototypes",
        test=", ".join(roles),
        motor=motor.name,
        summary=before(_first(found, run), summary(found)),
        rows=rows(found),
        tables=tables(found),
        drawings=_drawings(found, motor),
        findings=_findings(found),
        definitions=(*DEFINITIONS, *((NETWORK,) if found.networks else ())),
        channels=signals_of(found),
        sources=tuple(source for p in prototypes for source in p.record.sources),
        result=found,
    )


def _first(found: Confrontation, run: Path | None) -> list[str]:
    """What makes the comparison weaker than it looks."""
    sentences = []
    for prototype in found.prototypes:
        if not is_virtual(prototype.role):
            sentences.append(simulated_as(prototype.role, prototype.record))
        if prototype.reference.is_seen:
            sentences.append(fitted_by(Path(prototype.reference.run), found.base.record))
    for first, second in combinations(found.prototypes, 2):
        sentences.append(same_file(first.record, second.record))
    if run is not None:
        sentences += [fitted_by(run, one.prototype.record) for one in found.networks if one.is_seen]
    return sentences


def _drawings(found: Confrontation, motor: Motor) -> tuple[Drawing, ...]:
    drawings = [
        Drawing(
            f"Above, {wording(channel)} of all prototypes on the clock of {found.base.role}; "
            "below, the differences of the pairs, with their tolerances as broken lines.",
            partial(overlay, found, motor, channel),
        )
        for channel in signals_of(found)
    ]
    if found.networks:
        drawings.append(
            Drawing(
                "Measured winding of each prototype with the prediction of the run's network and "
                "its 95 % band; below, measured less predicted.",
                partial(networks, found),
            )
        )
    return tuple(drawings)


def _findings(found: Confrontation):
    of_records = [finding for p in found.prototypes for finding in p.record.findings]
    of_pairs = [finding for pair in found.pairs for finding in pair.validation.findings]
    unused = [f for f in of_pairs if f.id == "tolerance_not_used"]
    # a tolerance may be meant for one pair alone
    never = unused[:1] if len(unused) == len(found.pairs) else []
    rest = [f for f in of_pairs if f.id not in ("tolerance_not_used", "not_compared")]
    return (*of_records, *found.findings, *rest, *never)


IN_FULL, NAMED = 3, 8
"""So many pairs that do not agree are told in full on the first lines, so many by what does not;
of more there is room for the counts, and the tables tell all."""


def summary(found: Confrontation) -> str:
    """Return what came out in sentences: which pairs agree, and where the others do not."""
    agreeing = [p.name for p in found.pairs if counts(p)[1] and counts(p)[0] == counts(p)[1]]
    others = [pair for pair in found.pairs if pair.name not in agreeing]
    sentences = [f"Agree in all that is judged: {', '.join(agreeing)}."] if agreeing else []
    sentences += [_pair_sentence(pair, len(others)) for pair in others]
    sentences += [_network_sentence(one) for one in found.networks]
    return " ".join(sentences)


def _pair_sentence(pair: Compared, num_told: int) -> str:
    agree, judged = counts(pair)
    if not judged:
        return f"{pair.name}: nothing in common is evidence."
    signals = [s for s in pair.validation.judged if s.verdict != "agrees"]
    figures = [f for f in pair.validation.judged_figures if f.verdict != "agrees"]
    if num_told <= IN_FULL:
        words = [f"{wording(s.channel)} ({_deviation(s)})" for s in signals]
        words += [disagreement(f) for f in figures]
    else:
        words = [wording(s.channel) for s in signals] + [lower(f.label) for f in figures]
    head = f"{pair.name}: {agree} of {judged} agree"
    return f"{head}; not {', '.join(words)}." if num_told <= NAMED else f"{head}."


def _deviation(signal: SignalComparison) -> str:
    if signal.verdict != "biased":
        return signal.verdict
    symbol = unit(signal.channel, is_difference=True)
    return f"biased by {signal.bias:+.2g} {symbol}"


def _network_sentence(one: OnNetwork) -> str:
    parts = [
        f"{wording(s.channel)} {s.verdict} (bias {signed(s.bias, 1)} K, RMSE {s.rmse:.1f} K)"
        for s in one.validation.judged
    ]
    return f"Network of the run on {one.prototype.role}: {'; '.join(parts)}."


def counts(pair: Compared) -> tuple[int, int]:
    """Return how many signals and figures of a pair agree, and how many are judged."""
    judged = [*pair.validation.judged, *pair.validation.judged_figures]
    return sum(one.verdict == "agrees" for one in judged), len(judged)


PAIR_COLOURS = (6, 3, 4, 7, 5)
"""Colours of the differences, apart from those of the prototypes."""


def overlay(found: Confrontation, motor: Motor, channel: str) -> Figure:
    """Return one signal of all prototypes on one clock, and the differences of the pairs."""
    figure, (top, bottom) = with_differences(channel, 1.25, 0.75)
    for number, prototype in enumerate(found.prototypes):
        record = found.in_window(prototype.role, with_powers(prototype.record, motor))
        if not has(record, channel):
            continue
        sides = prototype.reference.bands.get(channel)
        if sides is not None:
            ends = dict(zip(("low", "high"), sides, strict=True))
            limits = replace(prototype.record, channels={"time_s": prototype.record.time_s, **ends})
            limits = found.in_window(prototype.role, limits)
            label = f"95 % band of {plain(prototype.role)}"
            band(top, limits.time_s, (limits["low"], limits["high"]), label, number)
        line(top, *with_gaps(*samples(record, channel)), plain(prototype.role), number)
    colours = dict(zip((pair.name for pair in found.pairs), cycle(PAIR_COLOURS), strict=False))
    for pair, signal in _compared(found, channel):
        common, colour = pair.validation.pair, colours[pair.name]
        clock = common.time_s + found.shift_s[pair.later.role]
        difference = common.ours[channel] - common.theirs[channel]
        line(bottom, clock, difference, plain(pair.name), colour, lw=0.8)
        for limit in (-signal.tolerance.value, signal.tolerance.value):
            bottom.axhline(limit, color=CYCLE[colour], lw=0.7, ls="--")
    finish([top, bottom])
    return figure


def networks(found: Confrontation) -> Figure:
    """Return each measured winding with the prediction of the network, and the difference."""
    figure, (top, bottom) = stacked(("winding [°C]", 1.9), ("measured −\npredicted [K]", 0.95))
    channel = "winding_degC"
    roles = [prototype.role for prototype in found.prototypes]
    bottom.axhline(0.0, color="0.6", lw=0.6)
    for one in found.networks:
        number = roles.index(one.prototype.role)
        common = one.validation.pair
        clock = common.time_s + found.shift_s[one.prototype.role]
        name, label = plain(one.prototype.role), f"network driven by {plain(one.driven_by)} (95 %)"
        band(top, clock, one.validation.bands[channel], number=number)
        line(top, clock, common.ours[channel], f"{name}, measured", number)
        line(top, clock, common.theirs[channel], label, number, ls="--")
        line(bottom, clock, common.ours[channel] - common.theirs[channel], name, number)
    finish([top, bottom])
    return figure
