"""Thermal Behaviour Analysis: temperatures, losses, equilibrium, the network of a run."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np

from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import samples
from heatrun.reports.printed import COVERAGE_FACTOR, format_interval, format_value, places_of
from heatrun.runs.equilibrium import EXTRAPOLATION, SteadyRise, criterion_words

from .analysis.drive import LossSplit, integrate
from .analysis.equilibrium import ThermalBehaviour, thermal_behaviour
from .analysis.validation import instrument_class
from .bench_test_types import NOT_OF_THE_MACHINE, TEST_TYPES, flow_words, unnamed
from .document import number
from .equilibrium_rows import (
    equilibrium_rows,
    equilibrium_sentence,
    gradients,
    last_of_each,
    network_rows,
)
from .figures import thermal as figures
from .figures.plot import wording
from .independence import before, fitted_by
from .operating_ranges import places_of_readings, recorded, rise_lines, signal_table
from .report import Drawing, Report, Row
from .simulated import Simulated

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
                lambda: figures.temperatures(record, found.temperatures, sink, continued))
    ]  # fmt: skip
    if simulated is not None:
        named = flow_words(simulated.prediction.model.form)
        labels = {link: f"{symbol}, {words}" for link, (symbol, words) in named.items()
                  if (symbol, words) != unnamed(link)}  # fmt: skip
        drawings += [
            Drawing("against", "Measured against simulated winding, with Tsr, and the difference.",
                    lambda: figures.against(simulated)),
            Drawing("flows", "Heat flows of the network with their 95 % bands.",
                    lambda: figures.flows(simulated, labels)),
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
                    lambda: figures.losses(record, split))
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
