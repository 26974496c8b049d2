"""Thermal Behaviour Analysis: temperatures, losses, equilibrium, the network of a run.

The rows and the figures of the equilibrium stand here too: a verdict on each stretch of constant
load, and what was not waited for.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import samples
from heatrun.reports.printed import COVERAGE_FACTOR, format_interval, format_value, places_of
from heatrun.runs.equilibrium import EXTRAPOLATION, Equilibrium, SteadyRise, criterion_words

from .analysis.drive import LossSplit, has, integrate
from .analysis.equilibrium import ThermalBehaviour, thermal_behaviour
from .analysis.validation import instrument_class
from .document import number
from .general import places_of_readings, recorded, rise_lines, signal_table
from .plot import CYCLE, finish, line, samples_or_nan, stacked, unit, wording
from .report import (
    NOT_OF_THE_MACHINE,
    TEST_TYPES,
    Column,
    Drawing,
    Line,
    Report,
    Row,
    Table,
    flow_words,
    unnamed,
)
from .simulated import Simulated, before, fitted_by

if TYPE_CHECKING:
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


def thermal_report(motor: Motor, record: Record, run: Path | None = None) -> Report:
    """Return the Thermal Behaviour Analysis of a record.

    Args:
        motor: The machine.
        record: With a temperature of the machine.
        run: Folder of a calibration whose network is set beside the measurement; None for none.

    Raises:
        InputError: If no temperature was measured, or a run was given and cannot be simulated.
    """
    found = thermal_behaviour(record, motor, run)
    split, simulated = found.losses, found.simulated
    sink = f"{motor.sink}_degC"
    rows = [
        *_winding_rows(record, sink),
        *([] if split is None else _loss_rows(record, motor, split)),
    ]
    rows += equilibrium_rows(found.settled)
    rows += [] if simulated is None else _run_rows(simulated)
    rows += network_rows(found.steady)
    continued = [e for e in last_of_each(found.settled) if isinstance(e.steady, SteadyRise)]
    caption = "All measured temperatures, and the rises over the sink."
    if continued:
        caption += " Broken lines are extrapolated, with 95 % bands: nothing was measured there."
    drawings = [
        Drawing("temperatures", caption,
                lambda: temperatures(record, found.temperatures, sink, continued))
    ]  # fmt: skip
    if simulated is not None:
        named = flow_words(simulated.prediction.model.form)
        labels = {link: f"{symbol}, {words}" for link, (symbol, words) in named.items()
                  if (symbol, words) != unnamed(link)}  # fmt: skip
        drawings += [
            Drawing("against", "Measured against simulated winding, with Tsr, and the difference.",
                    lambda: against(simulated)),
            Drawing("flows", "Heat flows of the network with their 95 % bands.",
                    lambda: flows(simulated, labels)),
        ]  # fmt: skip
    definitions = [("Thermal equilibrium", criterion_words(motor.equilibrium))]
    definitions += DEFINITIONS if simulated is not None else ()
    if simulated is not None:
        definitions.append(_flows_defined(simulated))
    if continued:
        definitions.insert(1, ("Extrapolated", EXTRAPOLATION))
    if found.steady is not None:
        definitions.insert(1, ("At rest, network", NETWORK_AT_REST))
    if split is not None:
        definitions.append(("Split of the losses", split.formula))
        drawings.append(
            Drawing("losses", "Losses, split by the measured winding temperature.",
                    lambda: losses(record, split))
        )  # fmt: skip
    definitions.append(_calibration(motor, record, found, run))
    others = tuple(
        c for c in TEST_TYPES["thermal"].channels
        if c in recorded(record) and c not in found.temperatures
    )  # fmt: skip
    of_machine = [c for c in found.temperatures if c not in NOT_OF_THE_MACHINE]
    measured = signal_table(record, found.temperatures, "Temperatures")
    rises = rise_lines(record, of_machine, sink)
    tables = [replace(measured, lines=(*measured.lines, *rises)), gradients(found.settled)]
    if others:
        tables.append(signal_table(record, others, "Load"))
    return Report(
        kind="thermal",
        title=TEST_TYPES["thermal"].title,
        test=record.name,
        motor=motor.name,
        summary=before([] if run is None else [fitted_by(run, record)], _summary(record, found)),
        rows=tuple(rows),
        tables=tuple(tables),
        drawings=tuple(drawings),
        findings=(*found.findings, *_no_run(record, run)),
        definitions=tuple(definitions),
        channels=(*found.temperatures, *others),
        sources=record.sources,
        result=found,
    )


def _winding_rows(record: Record, sink: str) -> list[Row]:
    _, values = samples(record, "winding_degC")
    if values.size == 0:
        return []
    places = places_of_readings(values)
    rows = [
        Row("winding_highest_degC", "Winding, highest", float(np.max(values)), "°C", places=places),
        Row("winding_end_degC", "Winding at the end", float(values[-1]), "°C", places=places),
    ]
    _, winding, below = samples(record, "winding_degC", sink)
    if winding.size == 0:
        return rows
    rise, name = winding - below, wording(sink)
    return [
        rows[0],
        Row("winding_highest_rise_K", f"Winding over {name}, highest rise", float(np.max(rise)),
            "K", places=1),
        rows[1],
        Row("winding_end_rise_K", f"Winding over {name}, rise at the end", float(rise[-1]), "K",
            places=1),
    ]  # fmt: skip


def _loss_rows(record: Record, motor: Motor, split: LossSplit) -> list[Row]:
    joule, other = (_mean(record, values) for values in (split.joule_W, split.other_W))
    if joule is None or other is None:
        U_joule = U_other = None
    else:
        # the current enters squared; the losses are P_Js and P_ol together, but for a map
        U_joule = 2.0 * COVERAGE_FACTOR * instrument_class("current_gain", motor) * joule
        is_map = motor.losses == "map"
        U_power = (
            COVERAGE_FACTOR
            * instrument_class("power_gain", motor)
            * abs(other if is_map else joule + other)
        )
        U_other = U_power if is_map else float(np.hypot(U_joule, U_power))
    return [
        _loss_row("joule_mean_W", "P_Js, loss of the winding, mean", joule, U_joule),
        _loss_row("other_mean_W", "P_ol, other losses, mean", other, U_other),
    ]


def _loss_row(name: str, label: str, mean: float | None, U: float | None) -> Row:
    if mean is None or U is None or not U > 0.0:
        return Row(name, label, mean, "W")
    note = f"± {format_value(mean, U)[1]} W (k = 2) by the classes of the instruments"
    return Row(name, label, mean, "W", note, places_of(U))


def _mean(record: Record, values: np.ndarray) -> float | None:
    made = Record(record.name, {"time_s": record.time_s, "loss": values})
    whole = integrate(*samples(made, "loss"))
    return whole.net / whole.covered_s if whole.covered_s > 0.0 else None


def _run_rows(simulated: Simulated) -> list[Row]:
    found = simulated.prediction
    seen = (
        "the run was calibrated on this file"
        if simulated.is_seen
        else "not seen by the calibration"
    )
    rows = [
        Row("rmse_K", "Winding, RMSE measured to simulated", found.rmse_K, "K",
            f"{simulated.title}, {seen}", PLACES_K),
        Row("largest_K", "Winding, largest difference", found.largest_K, "K", places=PLACES_K),
        Row("coverage_percent", "Block means inside the 95 % band",
            100.0 * found.coverage_95(), "%", places=0),
    ]  # fmt: skip
    for node, course in found.nodes.items():
        if node == simulated.measured_node:
            continue
        label = "Tsr" if node == "stator" else node.replace("_", " ")
        low, high = (float(side[-1]) for side in found.nodes_95[node])
        rows.append(
            Row(f"{node}_end_degC", f"{label} at the end", float(course[-1]), "°C",
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


def _flows_defined(simulated: Simulated) -> tuple[str, str]:
    form = simulated.prediction.model.form
    sink = f"the {form.sink}, the sink that T0 stands for" if form.second_sink else "the sink"
    return "P_ws, P_se", f"Heat flow from winding to stator, and from stator to {sink}; simulated."


def _summary(record: Record, found: ThermalBehaviour) -> str:
    words = f"{record.duration_s / 60.0:.1f} min; {equilibrium_sentence(found.settled)}"
    if found.simulated is not None:
        said = found.simulated.prediction
        words += (
            f"; the run's network is {said.rmse_K:.2f} K (RMSE) from the measured winding, "
            f"{100 * said.coverage_95():.0f} % of it inside the 95 % band"
        )
    return words + "."


def _calibration(
    motor: Motor, record: Record, found: ThermalBehaviour, run: Path | None
) -> tuple[str, str]:
    """Which command turns this test into parameters, or takes them up."""
    file = shlex.quote(motor.path or "MOTOR.toml")
    files = "+".join(source.path for source in record.sources) or "TEST"
    test = shlex.quote(f"{files}@{record.stretch}" if record.stretch else files)
    if run is not None:
        sheet = f"heatrun sheet {shlex.quote(str(run))}"
        return "Calibration", f"Parameters and their uncertainty: {sheet}"
    if not found.allows_calibration:
        return "Calibration", f"The findings forbid one; details: heatrun check {file} {test}"
    return "Calibration", f"Parameters from this test: heatrun calibrate {file} {test}"


def _no_run(record: Record, run: Path | None) -> tuple[Finding, ...]:
    if run is not None:
        return ()
    return (
        Finding(
            "no_run",
            "note",
            "No run was given, so nothing simulated stands beside the measurement.",
            record.name,
            "Calibrate, and pass the run folder by --run.",
            record.name,
        ),
    )


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
        notes = [_when(last), last.reason, _first(last)]
        notes += [f"before, {_when(e)}: {VERDICT[e.is_reached]}" for e in earlier]
        rows.append(
            Row(f"{name.replace(' ', '_')}_equilibrium", f"Equilibrium of the {name}",
                VERDICT[last.is_reached], "", "; ".join(note for note in notes if note))
        )  # fmt: skip
        if isinstance(last.steady, SteadyRise):
            rows.append(_steady_row(last, last.steady))
    return rows


def network_rows(found: SteadyNetwork | None) -> list[Row]:
    """Return the steady state of the run's network under the load of the last stretch."""
    if found is None:
        return []
    rows = []
    for node, value in found.median_degC.items():
        low, high = found.limits_degC[node]
        label = "Tsr" if node == "stator" else node.replace("_", " ")
        rows.append(
            Row(f"{node}_network_steady_degC", f"{_upper(label)} at rest, network, extrapolated",
                value, "°C", f"95 %: {low:.1f} … {high:.1f} °C; load and sink as from "
                f"{found.from_s / 60.0:.0f} to {found.to_s / 60.0:.0f} min; no measurement", 1)
        )  # fmt: skip
    return rows


def gradients(settled: Sequence[Equilibrium]) -> Table:
    """Return the gradients of each part on each stretch."""
    columns = (
        Column("from", "min"),
        Column("to", "min"),
        Column("last but one interval"),
        Column("standard error"),
        Column("last interval"),
        Column("standard error"),
        Column("equilibrium", ""),
    )
    lines = []
    for each in settled:
        stretch = each.stretch
        span = (None, None) if stretch is None else (stretch.from_s / 60.0, stretch.to_s / 60.0)
        pairs = list(zip(each.gradients_K_per_h, each.errors_K_per_h, strict=True))
        figures = (None,) * (4 - 2 * len(pairs)) + tuple(v for pair in pairs for v in pair)
        not_continued = f"not continued: {each.steady}" if isinstance(each.steady, str) else ""
        note = "; ".join(part for part in (each.reason, not_continued) if part)
        cells = (*span, *figures, VERDICT[each.is_reached])
        of_pairs = [places_of(error) if error > 0.0 else None for _, error in pairs]
        places = (None,) * (4 - 2 * len(pairs)) + tuple(d for d in of_pairs for _ in range(2))
        lines.append(Line(wording(each.channel), "K/h", cells, note, (1, 1, *places, None)))
    return Table("Gradients of the rise over the sink", columns, tuple(lines))


def equilibrium_sentence(settled: Sequence[Equilibrium]) -> str:
    """Return the verdict in words: on the whole record, or on each stretch of constant load."""
    spans = dict.fromkeys(each.stretch for each in settled)
    if len(spans) < 2:
        return f"thermal equilibrium {_state(settled)}"
    parts = []
    for span in spans:
        of_span = [each for each in settled if each.stretch == span]
        parts.append(f"{_when(of_span[0])} {_state(of_span)}")
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
    return Row(
        f"{name.replace(' ', '_')}_steady_degC",
        f"{_upper(name)} in equilibrium, extrapolated",
        found.sink_degC + steady.rise_K,
        "°C",
        f"95 %: {low:.1f} … {high:.1f} °C; a rise of {steady.rise_K:.1f} K over a sink of "
        f"{found.sink_degC:.1f} °C; one exponential with a time constant of "
        f"{steady.tau_s / 60.0:.0f} min; no measurement",
        1,
    )


def _when(found: Equilibrium) -> str:
    if found.stretch is None:
        return ""
    return f"{found.stretch.from_s / 60.0:.0f} to {found.stretch.to_s / 60.0:.0f} min"


def _first(found: Equilibrium) -> str:
    if found.first_reached_s is None:
        return ""
    return f"first met at {found.first_reached_s / 60.0:.0f} min"


def _upper(label: str) -> str:
    return label[0].upper() + label[1:]


CONTINUED = 3.0
"""A course is drawn on for so many of its time constants [1], at most twice as long as the test."""


def temperatures(
    record: Record, behaviour_channels: tuple[str, ...], sink: str,
    continued: Sequence[Equilibrium] = (),
) -> Figure:  # fmt: skip
    """Return all temperatures of a test over time, what some would have come to, and below the
    rises over a sink where it was measured.
    """
    rises = [
        (place, channel)
        for place, channel in enumerate(behaviour_channels)
        if channel not in NOT_OF_THE_MACHINE and has(record, channel, sink)
    ]
    figure, (axis, *below) = stacked([2.0, 1.05] if rises else [2.3])
    for place, channel in rises:
        made = Record(record.name, {"time_s": record.time_s, "K": record[channel] - record[sink]})
        line(below[0], *samples_or_nan(made, "K"), wording(channel), place)
        below[0].set_ylabel(f"rise over\n{wording(sink)} [K]", fontsize=8)
    for place, channel in enumerate(behaviour_channels):
        line(axis, *samples_or_nan(record, channel), wording(channel), place)
    for each in continued:
        if isinstance(each.steady, SteadyRise):
            _continue(axis, each, each.steady, behaviour_channels.index(each.channel), record)
    axis.set_ylabel(f"temperature [{unit('winding_degC')}]", fontsize=8)
    finish([axis, *below])
    return figure


def _continue(
    axis: Axes, found: Equilibrium, steady: SteadyRise, place: int, record: Record
) -> None:
    colour = CYCLE[place % len(CYCLE)]
    span_s = min(CONTINUED * steady.tau_s, 2.0 * record.duration_s)
    time_s = np.linspace(steady.end_s, steady.end_s + span_s, 100)
    low, middle, high = (found.sink_degC + side for side in steady.course(time_s))
    axis.fill_between(time_s / 60.0, low, high, color=colour, alpha=0.2, lw=0)
    axis.plot(time_s / 60.0, middle, color=colour, lw=1.0, ls="--",
              label=f"{wording(found.channel)}, extrapolated (95 %)")  # fmt: skip


def losses(record: Record, split: LossSplit) -> Figure:
    """Return P_Js and P_ol over time."""
    figure, (axis,) = stacked([1.5])
    for place, (label, values) in enumerate(
        (("P_Js, winding", split.joule_W), ("P_ol, others", split.other_W))
    ):
        made = Record(record.name, {"time_s": record.time_s, "loss": values})
        line(axis, *samples_or_nan(made, "loss"), label, place)
    axis.axhline(0.0, color="0.6", lw=0.6)
    axis.set_ylabel("losses [W]", fontsize=8)
    finish([axis])
    return figure


def against(simulated: Simulated) -> Figure:
    """Return measured against simulated winding with bands, and the residuals."""
    figure, (top, bottom) = stacked([2.15, 0.9])
    found = simulated.prediction
    minutes = found.time_s / 60.0
    top.fill_between(minutes, *found.total["95"], color=CYCLE[0], alpha=0.15, lw=0,
                     label="95 % with noise")  # fmt: skip
    top.fill_between(minutes, *found.parameters["95"], color=CYCLE[0], alpha=0.35, lw=0,
                     label="95 % of the parameters")  # fmt: skip
    top.plot(minutes, found.median, color=CYCLE[0], lw=1.1, label="simulated winding")
    top.plot(minutes, found.test.measured, ".", color="#222222", ms=2.2,
             label="measured winding (block means)")  # fmt: skip
    others = [node for node in found.nodes if node != simulated.measured_node]
    for place, node in enumerate(others, start=2):
        colour = CYCLE[place % len(CYCLE)]
        label = "stator Tsr" if node == "stator" else node.replace("_", " ")
        top.fill_between(minutes, *found.nodes_95[node], color=colour, alpha=0.25, lw=0)
        top.plot(minutes, found.nodes[node], color=colour, lw=1.1,
                 label=f"{label}, simulated (95 %)")  # fmt: skip
    top.set_ylabel("temperature [°C]", fontsize=8)
    bottom.axhline(0.0, color="0.6", lw=0.6)
    bottom.plot(minutes, found.residual, color=CYCLE[1], lw=0.9)
    bottom.set_ylabel("measured −\nsimulated [K]", fontsize=8)
    finish([top, bottom])
    return figure


def flows(simulated: Simulated, labels: dict[tuple[str, str], str]) -> Figure:
    """Return the heat flows of the network over time with their bands."""
    figure, (axis,) = stacked([1.5])
    found = simulated.prediction
    minutes = found.time_s / 60.0
    for place, (link, flow) in enumerate(found.flows.items()):
        colour = CYCLE[place % len(CYCLE)]
        axis.fill_between(minutes, *found.flows_95[link], color=colour, alpha=0.25, lw=0)
        axis.plot(minutes, flow, color=colour, lw=1.0, label=labels.get(link, " to ".join(link)))
    axis.set_ylabel("heat flow [W]", fontsize=8)
    if np.any([np.min(flow) < 0.0 for flow in found.flows.values()]):
        axis.axhline(0.0, color="0.6", lw=0.6)
    finish([axis])
    return figure
