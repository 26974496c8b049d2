"""Thermal Behaviour Analysis: temperatures, losses, equilibrium, the network of a run.

The rows and the figures of the equilibrium stand here too: a verdict on each stretch of constant
load, and what was not waited for.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from heatrun.checks import check_record
from heatrun.errors import InputError
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import has, samples, sink_channel
from heatrun.reports.printed import COVERAGE_FACTOR, format_interval, format_value, places_of
from heatrun.runs.equilibrium import (
    EXTRAPOLATION,
    Equilibrium,
    SteadyRise,
    Stretch,
    criterion_words,
    equilibria,
)
from heatrun.runs.run import open_run

from .analysis.drive import LossSplit, integrate, measured, split_losses
from .analysis.validation import instrument_class
from .document import number
from .general import places_of_readings, recorded, signal_table
from .plot import band, finish, line, stacked, with_gaps, wording
from .report import (
    CARDS,
    NOT_OF_THE_MACHINE,
    Column,
    Drawing,
    Line,
    Report,
    Row,
    Table,
    flow_words,
    unnamed,
)
from .simulated import before, fitted_by

if TYPE_CHECKING:
    from heatrun.posterior.predict import Prediction
    from heatrun.runs.machine import SteadyNetwork


PLACES_K = 2
"""Of differences between readings and network [K]: as the certificate prints them."""

DEFINITIONS = (
    (
        "Simulated winding",
        "Median over draws of the run's parameters, each driven by the currents, losses and sink "
        "of this test and started from its first readings. The inner band holds 95 % of the draws, "
        "the outer one 95 % with the noise of a block mean.",
    ),
    ("Tsr", "Temperature of stator and rotor as one lump of the network; simulated, not measured."),
)


NETWORK_AT_REST = (
    "Where the network of the run comes to rest if current, speed, sink and the losses outside the "
    "copper stay as in the last third of the last stretch of constant load, and the copper loss "
    "follows its temperature; limits of the draws of the parameters. It is extrapolated."
)


@dataclass(frozen=True)
class ThermalBehaviour:
    """What a test says of the machine's temperatures."""

    settled: tuple[Equilibrium, ...]  # For each part of the machine, each stretch of constant load.
    simulated: Prediction | None  # The test as the run predicts it, or None.
    # Where the network of the run comes to rest under the load of the last stretch, if the winding
    # did not get there; else None.
    steady: SteadyNetwork | None


def thermal_report(motor: Motor, record: Record, run: Path | None = None) -> Report:
    """Return the Thermal Behaviour Analysis of a record, beside the network of a run if given.

    Raises:
        InputError: If no temperature was measured, or a run was given and cannot be simulated.
    """
    shown = tuple(c for c in record.channels if c.endswith("_degC") and has(record, c))
    parts = [c for c in shown if c not in NOT_OF_THE_MACHINE]
    if not parts:
        raise InputError(
            "Expected a temperature of the machine, such as winding_degC; the channels are "
            f"{', '.join(record.channels)}.",
            where=record.name,
            remedy='Map it in the motor file: [columns] winding_degC = "T_winding [degC]".',
        )
    findings = list(check_record(record, motor))
    split, sink = None, sink_channel(motor)
    try:
        split = split_losses(record, motor)
    except InputError as error:
        findings.append(
            Finding("no_loss_split", "warning", error.problem, error.where, error.remedy,
                    record.name)
        )  # fmt: skip
    simulated = None if run is None else open_run(run).predict(record, motor=motor)
    settled = tuple(each for c in parts for each in equilibria(record, motor, c))
    found = ThermalBehaviour(settled, simulated, _steady(simulated, settled))
    rows = _winding_rows(record, sink)
    rows += [] if split is None else _loss_rows(record, motor, split)
    rows += equilibrium_rows(settled)
    continued = [e for e in last_of_each(settled) if isinstance(e.steady, SteadyRise)]
    caption = "All measured temperatures, and the rises over the sink."
    definitions = [("Thermal equilibrium", criterion_words(motor.equilibrium))]
    if found.steady is not None:
        definitions.append(("At rest, network", NETWORK_AT_REST))
    if continued:
        caption += " Broken lines are extrapolated, with 95 % bands: nothing was measured there."
        definitions.append(("Extrapolated", EXTRAPOLATION))
    drawings = [Drawing(caption, lambda: temperatures(record, shown, sink, continued))]
    if simulated is None or run is None:
        findings.append(
            Finding(
                "no_run",
                "note",
                "No run was given, so nothing simulated stands beside the measurement.",
                record.name,
                "Calibrate, and pass the run folder by --run.",
                record.name,
            )
        )
    else:
        findings += _other_motor(motor, record, run)
        rows += _run_rows(simulated)
        drawings += [
            Drawing("Measured against simulated winding, with Tsr, and the difference.",
                    lambda: against(simulated)),
            Drawing("Heat flows of the network with their 95 % bands.",
                    lambda: flows(simulated)),
        ]  # fmt: skip
        definitions += [*DEFINITIONS, _flows_defined(simulated)]
    if split is not None:
        definitions.append(("Split of the losses", split.formula))
        drawings.append(
            Drawing("Losses, split by the measured winding temperature.",
                    lambda: losses(record, split))
        )  # fmt: skip
    rows += [] if found.steady is None else network_rows(found.steady)
    is_calibratable = all(finding.severity != "error" for finding in findings)
    definitions.append(("Calibration", _calibration(motor, record, run, is_calibratable)))
    others = tuple(c for c in CARDS["thermal"].channels if c in recorded(record) and c not in shown)
    tables = [
        signal_table(record, shown, "Temperatures", rises_of=parts, sink=sink),
        gradients(settled),
    ]
    if others:
        tables.append(signal_table(record, others, "Load"))
    return Report(
        kind="thermal",
        test=record.name,
        motor=motor.name,
        summary=before([] if run is None else [fitted_by(run, record)], _summary(record, found)),
        rows=tuple(rows),
        tables=tuple(tables),
        drawings=tuple(drawings),
        findings=tuple(findings),
        definitions=tuple(definitions),
        channels=(*shown, *others),
        sources=record.sources,
        result=found,
    )


def _other_motor(motor: Motor, record: Record, run: Path) -> list[Finding]:
    name = open_run(run).result.motor.name
    if name == motor.name:
        return []
    return [
        Finding(
            "run_of_other_motor",
            "warning",
            f"The run was calibrated for {name!r}, the motor file is of {motor.name!r}.",
            str(run),
            "Pass a run of this motor, unless only the name has changed.",
            record.name,
        )
    ]


def _steady(simulated: Prediction | None, settled: Sequence[Equilibrium]) -> SteadyNetwork | None:
    """The network at rest, where the winding was stopped before it on a load that was held."""
    of_winding = [each for each in settled if each.channel == "winding_degC"]
    if simulated is None or not of_winding:
        return None
    last = of_winding[-1]
    if last.is_reached is True or not last.is_held or last.stretch is None:
        return None
    from heatrun.runs.machine import steady_of_network

    return steady_of_network(simulated, last.stretch)


def _winding_rows(record: Record, sink: str) -> list[Row]:
    _, values = samples(record, "winding_degC")
    if values.size == 0:
        return []
    _, winding, below = samples(record, "winding_degC", sink)
    places, rise, name = places_of_readings(values), winding - below, f"over {wording(sink)}"
    rows = [
        Row("winding_highest_degC", "Winding, highest", float(np.max(values)), "°C", places=places),
        Row("winding_end_degC", "Winding at the end", float(values[-1]), "°C", places=places),
    ]
    if rise.size:
        rows.insert(1, Row("winding_highest_rise_K", f"Winding {name}, highest rise",
                           float(np.max(rise)), "K", places=1))  # fmt: skip
        rows.append(Row("winding_end_rise_K", f"Winding {name}, rise at the end",
                        float(rise[-1]), "K", places=1))  # fmt: skip
    return rows


def _loss_rows(record: Record, motor: Motor, split: LossSplit) -> list[Row]:
    joule, other = (_mean(record, values) for values in (split.joule_W, split.other_W))
    U_joule = U_other = 0.0
    if joule is not None and other is not None:
        # the current enters squared; the losses are P_Js and P_ol together, but for a map
        U_joule = 2.0 * COVERAGE_FACTOR * instrument_class("current_gain", motor) * joule
        is_map = motor.losses == "map"
        power = abs(other if is_map else joule + other)
        U_power = COVERAGE_FACTOR * instrument_class("power_gain", motor) * power
        U_other = U_power if is_map else float(np.hypot(U_joule, U_power))
    return [
        _loss_row("joule_mean_W", "P_Js, loss of the winding, mean", joule, U_joule),
        _loss_row("other_mean_W", "P_ol, other losses, mean", other, U_other),
    ]


def _loss_row(name: str, label: str, mean: float | None, U: float) -> Row:
    if not U > 0.0:
        return Row(name, label, mean, "W")
    note = f"± {format_value(mean, U)[1]} W (k = 2) by the classes of the instruments"
    return Row(name, label, mean, "W", note, places_of(U))


def _mean(record: Record, values: np.ndarray) -> float | None:
    whole = integrate(*measured(record, values))
    return whole.net / whole.covered_s if whole.covered_s > 0.0 else None


def _run_rows(found: Prediction) -> list[Row]:
    effects = ", ".join(kind.card.id for kind in found.model.effects)
    title = f"{found.model.title} with {effects}" if effects else found.model.title
    seen = "not seen by the calibration"
    seen = seen if found.is_held_out else "the run was calibrated on this file"
    rows = [
        Row("rmse_K", "Winding, RMSE measured to simulated", found.rmse_K, "K",
            f"{title}, {seen}", PLACES_K),
        Row("largest_K", "Winding, largest difference", found.largest_K, "K", places=PLACES_K),
        Row("coverage_percent", "Block means inside the 95 % band",
            100.0 * found.coverage_95(), "%", places=0),
    ]  # fmt: skip
    for node, course in found.nodes.items():
        if node == found.model.form.measured_node:
            continue
        low, high = (float(side[-1]) for side in found.nodes_95[node])
        rows.append(
            Row(f"{node}_end_degC", f"{_node(node)} at the end", float(course[-1]), "°C",
                f"95 %: {low:.1f} … {high:.1f} °C", 1)
        )  # fmt: skip
    named = flow_words(found.model.form)
    for link, flow in found.flows.items():
        symbol, words = named.get(link, unnamed(link))
        low, high = (float(side[-1]) for side in found.flows_95[link])
        half = 0.5 * (high - low)
        places = places_of(half) if half > 0.0 else None
        ends = format_interval((low, high), half)
        rows.append(
            Row(f"{symbol}_end_W", f"{symbol}, {words}, at the end", float(flow[-1]), "W",
                f"95 %: {ends} W; mean {number(float(np.mean(flow)), places)} W", places)
        )  # fmt: skip
    return rows


def _node(name: str) -> str:
    return "Tsr" if name == "stator" else name.replace("_", " ")


def _flows_defined(simulated: Prediction) -> tuple[str, str]:
    form = simulated.model.form
    sink = f"the {form.sink}, the sink that T0 stands for" if form.second_sink else "the sink"
    return "P_ws, P_se", f"Heat flow from winding to stator, and from stator to {sink}; simulated."


def _summary(record: Record, found: ThermalBehaviour) -> str:
    words = f"{record.duration_s / 60.0:.1f} min; {_equilibrium_sentence(found.settled)}"
    if found.simulated is not None:
        said = found.simulated
        words += (
            f"; the run's network is {said.rmse_K:.2f} K (RMSE) from the measured winding, "
            f"{100 * said.coverage_95():.0f} % of it inside the 95 % band"
        )
    return words + "."


def _calibration(motor: Motor, record: Record, run: Path | None, is_allowed: bool) -> str:
    """Which command turns this test into parameters, or takes them up."""
    file = shlex.quote(motor.path or "MOTOR.toml")
    files = "+".join(source.path for source in record.sources) or "TEST"
    test = shlex.quote(f"{files}@{record.stretch}" if record.stretch else files)
    if run is not None:
        return f"Parameters and their uncertainty: heatrun sheet {shlex.quote(str(run))}"
    if not is_allowed:
        return f"The findings forbid one; details: heatrun check {file} {test}"
    return f"Parameters from this test: heatrun calibrate {file} {test}"


VERDICT = {True: "reached", False: "not reached", None: "undecided"}


def last_of_each(settled: Sequence[Equilibrium]) -> tuple[Equilibrium, ...]:
    """Return the verdict on the last stretch of each part."""
    return tuple({each.channel: each for each in settled}.values())


def equilibrium_rows(settled: Sequence[Equilibrium]) -> list[Row]:
    """Return the rows of the main table: each part on its last stretch, and its steady state."""
    rows = []
    for last in last_of_each(settled):
        earlier = [e for e in settled if e.channel == last.channel and e is not last]
        name = wording(last.channel)
        notes = [_when(last), last.reason]
        if last.first_reached_s is not None:
            notes.append(f"first met at {last.first_reached_s / 60.0:.0f} min")
        notes += [f"before, {_when(e)}: {VERDICT[e.is_reached]}" for e in earlier]
        rows.append(
            Row(f"{name.replace(' ', '_')}_equilibrium", f"Equilibrium of the {name}",
                VERDICT[last.is_reached], "", "; ".join(note for note in notes if note))
        )  # fmt: skip
        if isinstance(last.steady, SteadyRise):
            rows.append(_steady_row(last, last.steady))
    return rows


def network_rows(found: SteadyNetwork) -> list[Row]:
    """Return the steady state of the run's network under the load of the last stretch."""
    rows = []
    for node, value in found.median_degC.items():
        low, high = found.limits_degC[node]
        label = _upper(_node(node))
        rows.append(
            Row(f"{node}_network_steady_degC", f"{label} at rest, network, extrapolated",
                value, "°C", f"95 %: {low:.1f} … {high:.1f} °C; load and sink as from "
                f"{found.from_s / 60.0:.0f} to {found.to_s / 60.0:.0f} min; no measurement", 1)
        )  # fmt: skip
    return rows


GRADIENT_COLUMNS = (
    Column("from", "min"), Column("to", "min"),
    Column("last but one interval"), Column("standard error"),
    Column("last interval"), Column("standard error"),
    Column("equilibrium", ""),
)  # fmt: skip


def gradients(settled: Sequence[Equilibrium]) -> Table:
    """Return the gradients of each part on each stretch."""
    lines = []
    for each in settled:
        stretch = each.stretch
        span = (None, None) if stretch is None else (stretch.from_s / 60.0, stretch.to_s / 60.0)
        pairs = list(zip(each.gradients_K_per_h, each.errors_K_per_h, strict=True))
        missing = (None,) * (4 - 2 * len(pairs))
        figures = missing + tuple(v for pair in pairs for v in pair)
        not_continued = f"not continued: {each.steady}" if isinstance(each.steady, str) else ""
        note = "; ".join(part for part in (each.reason, not_continued) if part)
        cells = (*span, *figures, VERDICT[each.is_reached])
        of_pairs = [places_of(error) if error > 0.0 else None for _, error in pairs]
        places = missing + tuple(d for d in of_pairs for _ in range(2))
        lines.append(Line(wording(each.channel), "K/h", cells, note, (1, 1, *places, None)))
    return Table("Gradients of the rise over the sink", GRADIENT_COLUMNS, tuple(lines))


def _equilibrium_sentence(settled: Sequence[Equilibrium]) -> str:
    """Return the verdict in words: on the whole record, or on each stretch of constant load."""
    spans: dict[Stretch | None, list[Equilibrium]] = {}
    for each in settled:
        spans.setdefault(each.stretch, []).append(each)
    if len(spans) < 2:
        return f"thermal equilibrium {_state(settled)}"
    parts = [f"{_when(of_span[0])} {_state(of_span)}" for of_span in spans.values()]
    return f"thermal equilibrium by stretch of constant load: {'; '.join(parts)}"


def _state(settled: Sequence[Equilibrium]) -> str:
    states = {each.is_reached for each in settled}
    if states == {True}:
        return "is reached in every measured part"
    if False in states:
        moving = dict.fromkeys(wording(e.channel) for e in settled if e.is_reached is False)
        return f"is not reached ({', '.join(moving)})"
    return "is undecided"


def _steady_row(found: Equilibrium, steady: SteadyRise) -> Row:
    low, high = (found.sink_degC + side for side in steady.rise_95_K)
    name = wording(found.channel)
    note = (
        f"95 %: {low:.1f} … {high:.1f} °C; a rise of {steady.rise_K:.1f} K over a sink of "
        f"{found.sink_degC:.1f} °C; one exponential with a time constant of "
        f"{steady.tau_s / 60.0:.0f} min; no measurement"
    )
    key, label = name.replace(" ", "_"), f"{_upper(name)} in equilibrium, extrapolated"
    return Row(f"{key}_steady_degC", label, found.sink_degC + steady.rise_K, "°C", note, 1)


def _when(found: Equilibrium) -> str:
    if found.stretch is None:
        return ""
    return f"{found.stretch.from_s / 60.0:.0f} to {found.stretch.to_s / 60.0:.0f} min"


def _upper(label: str) -> str:
    return label[0].upper() + label[1:]


CONTINUED = 3.0
"""A course is drawn on for so many of its time constants [1], at most twice as long as the test."""


def temperatures(
    record: Record, channels: Sequence[str], sink: str, continued: Sequence[Equilibrium] = ()
) -> Figure:
    """Return all temperatures of a test over time, what some would have come to, and below the
    rises over a sink where it was measured.
    """
    rises = [
        (place, channel)
        for place, channel in enumerate(channels)
        if channel not in NOT_OF_THE_MACHINE and has(record, channel, sink)
    ]
    above, under = "temperature [°C]", f"rise over\n{wording(sink)} [K]"
    figure, (axis, *below) = stacked(*([(above, 2.0), (under, 1.05)] if rises else [(above, 2.3)]))
    for place, channel in rises:
        rise = measured(record, record[channel] - record[sink])
        line(below[0], *with_gaps(*rise), wording(channel), place)
    for place, channel in enumerate(channels):
        line(axis, *with_gaps(*samples(record, channel)), wording(channel), place)
    for each in continued:
        _continue(axis, each, channels.index(each.channel), record)
    finish([axis, *below])
    return figure


def _continue(axis: Axes, found: Equilibrium, place: int, record: Record) -> None:
    steady = found.steady
    assert isinstance(steady, SteadyRise)
    span_s = min(CONTINUED * steady.tau_s, 2.0 * record.duration_s)
    time_s = np.linspace(steady.end_s, steady.end_s + span_s, 100)
    low, middle, high = (found.sink_degC + side for side in steady.course(time_s))
    band(axis, time_s, (low, high), number=place)
    label = f"{wording(found.channel)}, extrapolated (95 %)"
    line(axis, time_s, middle, label, place, lw=1.0, ls="--")


def losses(record: Record, split: LossSplit) -> Figure:
    """Return P_Js and P_ol over time."""
    figure, (axis,) = stacked(("losses [W]", 1.5))
    for place, (label, values) in enumerate(
        (("P_Js, winding", split.joule_W), ("P_ol, others", split.other_W))
    ):
        line(axis, *with_gaps(*measured(record, values)), label, place)
    axis.axhline(0.0, color="0.6", lw=0.6)
    finish([axis])
    return figure


def against(found: Prediction) -> Figure:
    """Return measured against simulated winding with bands, and the residuals."""
    figure, (top, bottom) = stacked(("temperature [°C]", 2.15), ("measured −\nsimulated [K]", 0.9))
    time_s = found.time_s
    band(top, time_s, found.total["95"], "95 % with noise", alpha=0.15)
    band(top, time_s, found.parameters["95"], "95 % of the parameters", alpha=0.35)
    line(top, time_s, found.median, "simulated winding", lw=1.1)
    top.plot(time_s / 60.0, found.test.measured, ".", color="#222222", ms=2.2,
             label="measured winding (block means)")  # fmt: skip
    others = [node for node in found.nodes if node != found.model.form.measured_node]
    for place, node in enumerate(others, start=2):
        label = f"{'stator Tsr' if node == 'stator' else _node(node)}, simulated (95 %)"
        band(top, time_s, found.nodes_95[node], number=place, alpha=0.25)
        line(top, time_s, found.nodes[node], label, place, lw=1.1)
    bottom.axhline(0.0, color="0.6", lw=0.6)
    line(bottom, time_s, found.residual, number=1)
    finish([top, bottom])
    return figure


def flows(found: Prediction) -> Figure:
    """Return the heat flows of the network over time with their bands."""
    figure, (axis,) = stacked(("heat flow [W]", 1.5))
    named = flow_words(found.model.form)
    for place, (link, flow) in enumerate(found.flows.items()):
        symbol, words = named.get(link, unnamed(link))
        label = symbol if (symbol, words) == unnamed(link) else f"{symbol}, {words}"
        band(axis, found.time_s, found.flows_95[link], number=place, alpha=0.25)
        line(axis, found.time_s, flow, label, place, lw=1.0)
    if np.any([np.min(flow) < 0.0 for flow in found.flows.values()]):
        axis.axhline(0.0, color="0.6", lw=0.6)
    finish([axis])
    return figure
