"""Figures of the thermal report carry the digits that their uncertainty leaves."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun_reports.document import document_content
from heatrun_reports.thermal import thermal_report

MOTOR = Motor("m", phase_resistance_ohm=0.02)


@pytest.fixture(scope="module")
def printed():
    """Label, value, unit and note of the rows of a step of 80 A, read to 0.1 °C, one time constant
    of half an hour, stopped after 90 min; the rows of its tables too."""
    time_s = np.arange(0.0, 5400.0, 10.0)
    rise = 60.0 * (1.0 - np.exp(-time_s / 1800.0))
    noise = 0.2 * np.random.default_rng(3).standard_normal(time_s.size)
    record = Record(
        "step",
        {
            "time_s": time_s,
            "winding_degC": np.round(20.0 + rise + noise, 1),
            "ambient_degC": np.full(time_s.size, 20.0),
            "phase_current_A": np.full(time_s.size, 80.0),
            "losses_W": np.full(time_s.size, 612.3),
        },
    )
    report = thermal_report(MOTOR, record)
    content = document_content(report, {})
    tables = {t["title"]: {line[0]: line[1:] for line in t["lines"]} for t in content["tables"]}
    return {row[0]: row[1:] for row in content["rows"]}, tables, report


def test_losses_end_where_the_class_of_their_instruments_does(printed):
    rows, _, report = printed
    # 3 (80 A)^2 0.02 ohm (234.5 + 61)/(234.5 + 25) = 437.3 W, 61 degC on average; a current of
    # class 0.5 enters squared, so U = 2 * 2 * 0.005 * 437 = 8.7 W: one decimal
    value, _, note = rows["P_Js, loss of the winding, mean"]
    assert len(value.partition(".")[2]) == 1
    assert float(value) == pytest.approx(437.3, abs=0.5)
    assert note.startswith("± 8.7 W")
    # power of class 1: 2 * 0.01 * 612.3 = 12 W and 8.7 W together are 15 W
    assert "." not in rows["P_ol, other losses, mean"][0]
    assert rows["P_ol, other losses, mean"][2].startswith("± 15 W")
    (joule,) = [r for r in report.rows if r.name == "joule_mean_W"]
    assert joule.value != round(joule.value, 1)  # the JSON keeps every digit


def test_a_temperature_that_was_extrapolated_has_the_decimals_of_its_limits(printed):
    rows, _, _ = printed
    value, unit, note = rows["Winding at rest, extrapolated"]
    assert unit == "°C"
    assert len(value.partition(".")[2]) == 1
    assert note.startswith("95 %: ")
    low = note.removeprefix("95 %: ").split(" ")[0]
    assert len(low.partition(".")[2]) == 1


def test_readings_keep_the_decimals_of_the_logger(printed):
    rows, tables, _ = printed
    winding = tables["Temperatures"]["winding [°C]"]
    # start, end, lowest, highest to the step of 0.1 °C, the mean one further
    assert all(len(winding[k].partition(".")[2]) == 1 for k in (0, 1, 2, 4))
    assert len(winding[3].partition(".")[2]) == 2
    assert rows["Winding, highest"][0] == winding[4]


def test_a_gradient_has_the_digits_of_its_standard_error(printed):
    _, tables, _ = printed
    _, _, gradient, error, *_ = tables["Gradients of the rise over the sink"]["winding [K/h]"]
    assert len(error.replace(".", "").lstrip("0")) == 2
    assert len(gradient.partition(".")[2]) == len(error.partition(".")[2])
