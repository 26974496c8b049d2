"""Columns that say the same thing, and losses that no machine has."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from heat_runs import decided

from heatrun.checks import check_record
from heatrun.motor.file import parse_motor
from heatrun.readers.joined import read_test

HEAD = '[motor]\nname = "M"\n[winding]\nphase_resistance_ohm = 0.01\n'
TIME_S = np.arange(0.0, 3600.0, 2.0)
RISE_K = 60.0 * (1.0 - np.exp(-TIME_S / 900.0))
RMS_A = 100.0 * np.where(TIME_S % 1200 < 900, 1.0, 0.6)
SPEED_RPM = np.full(TIME_S.size, 3000.0)
SHAFT_W = np.where(TIME_S % 1200 < 900, 5000.0, 2500.0)
LOSSES_W = 300.0 * (1.0 + 0.0039 * RISE_K) * (RMS_A / 100.0) ** 2 + 150.0
TORQUE_NM = SHAFT_W / (SPEED_RPM * 2.0 * np.pi / 60.0)
PLAIN = {
    "time_s": TIME_S,
    "phase_current_A": RMS_A,
    "losses_W": LOSSES_W,
    "ambient_degC": 20.0 + 0.01 * np.sin(TIME_S),
    "winding_degC": 20.0 + RISE_K,
    "speed_rpm": SPEED_RPM,
}
IN_DQ = {"i_d_A": -0.6 * 2**0.5 * RMS_A, "i_q_A": 0.8 * 2**0.5 * RMS_A}
POWERS = {"torque_Nm": TORQUE_NM, "electrical_power_W": SHAFT_W + LOSSES_W}


def found(tmp_path, columns, name="columns_disagree", more=""):
    path = tmp_path / "t.csv"
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.6g")
    motor = parse_motor((HEAD + more).encode(), "motor.toml")
    record = read_test(path, motor)
    if name == "columns_disagree":  # else a doubt about units is told in its place
        record = decided(record)
    return [one for one in check_record(record, motor) if one.id == name]


@pytest.mark.parametrize("extra", [{}, IN_DQ, POWERS, IN_DQ | POWERS])
def test_columns_that_agree_are_no_finding(tmp_path, extra):
    assert not found(tmp_path, PLAIN | extra)


@pytest.mark.parametrize(
    ("name", "factor", "severity", "said"),
    [
        ("phase_current_A", 2**0.5, "error", "an amplitude that is read as rms"),
        ("phase_current_A", (2 / 3) ** 0.5, "error", "power-invariant"),
        ("phase_current_A", 1.08, "warning", "1.08 times"),
        ("phase_current_A", 1.03, None, ""),
        ("losses_W", 1e-3, "error", "losses_W is in kW under a unit of W"),
        ("losses_W", 2.0, "error", "2 times"),
        ("losses_W", 1.05, None, ""),
    ],
)
def test_what_the_columns_contradict(tmp_path, name, factor, severity, said):
    columns = PLAIN | IN_DQ | POWERS
    findings = found(tmp_path, columns | {name: factor * columns[name]})
    assert [one.severity for one in findings] == ([severity] if severity else [])
    if severity:
        assert said in findings[0].message
        assert findings[0].values["ratio"] == pytest.approx(factor, rel=1e-3)


DC = {
    "torque_Nm": TORQUE_NM,
    "dc_voltage_V": np.full(TIME_S.size, 400.0),
    # an inverter with 95 % of efficiency stands between the DC link and the motor
    "dc_current_A": (SHAFT_W + LOSSES_W) / 0.95 / 400.0,
}


@pytest.mark.parametrize(
    ("factor", "severity", "said"),
    [
        # of the 750 W between DC link and shaft the inverter takes some 300 W: any part may be its
        (1.0, None, ""),
        (0.5, None, ""),
        (4.0, "error", "at most dc_voltage_V·dc_current_A - torque·omega"),
        (1e3, "error", ""),
        (1e-3, "error", "losses_W is in kW under a unit of W"),
    ],
)
def test_losses_are_no_more_than_what_is_between_dc_link_and_shaft(
    tmp_path, factor, severity, said
):
    columns = PLAIN | DC | {"losses_W": factor * LOSSES_W}
    findings = found(tmp_path, columns)
    assert [one.severity for one in findings] == ([severity] if severity else [])
    if severity:
        assert said in findings[0].message


def test_losses_in_watt_under_a_header_of_kilowatt(tmp_path):
    columns = {k: v for k, v in (PLAIN | POWERS).items() if k != "losses_W"}
    (finding,) = found(tmp_path, columns | {"losses [kW]": LOSSES_W}, more=(
        '[columns]\nlosses_W = "losses [kW]"\n'))  # fmt: skip
    assert finding.severity == "error"
    assert "in W under a unit of kW" in finding.message


def test_speed_in_radians_beside_the_mechanical_power(tmp_path):
    columns = PLAIN | {"torque_Nm": TORQUE_NM, "mechanical_power_W": SHAFT_W}
    columns["speed_rpm"] = SPEED_RPM * 2.0 * np.pi / 60.0
    (finding,) = found(tmp_path, columns)
    assert "the speed is in rad/s, read as rpm" in finding.message


def test_losses_may_differ_by_what_an_error_of_the_shaft_makes_of_them(tmp_path):
    # 2 % of 5000 W are 20 % of the 500 W of losses
    columns = PLAIN | POWERS | {"torque_Nm": 1.015 * TORQUE_NM}
    assert not found(tmp_path, columns)


def test_the_doubt_is_settled_by_leaving_a_column_out(tmp_path):
    columns = PLAIN | IN_DQ | {"phase_current_A": 2**0.5 * RMS_A}
    assert found(tmp_path, columns)
    for line in ('phase_current_A = "none"', 'i_d_A = "none"\ni_q_A = "none"'):
        assert not found(tmp_path, columns, more=f"[columns]\n{line}\n")


def test_losses_of_a_map_are_no_balance(tmp_path):
    columns = PLAIN | POWERS | {"losses_W": 0.3 * LOSSES_W}
    assert found(tmp_path, columns)
    path = tmp_path / "t.csv"
    motor = parse_motor(HEAD.replace('"M"', '"M"\nlosses = "map"').encode(), "motor.toml")
    ids = [one.id for one in check_record(read_test(path, motor), motor)]
    assert "columns_disagree" not in ids


@pytest.mark.parametrize(
    ("header", "values", "line", "severity", "said"),
    [
        ("losses_W", 4e3 * LOSSES_W, "", "error", "[mW]"),
        ("Pd [kW]", LOSSES_W * 4, 'losses_W = "Pd"', "error", "[W]"),
        # the line of `heatrun init` repeats the heading; the one that is offered decides
        ("Pd [kW]", LOSSES_W * 4, 'losses_W = "Pd [kW]"', "error", '"Pd [kW] [kW]"'),
        ("Pd [kW]", LOSSES_W * 4, 'losses_W = "Pd [kW] [kW]"', "warning", "[W]"),
        ("Pd [kW]", LOSSES_W, 'losses_W = "Pd [kW] [W]"', None, ""),
        ("losses_W", 1e-7 * LOSSES_W, "", "error", "[kW]"),
        ("losses_W", LOSSES_W, "", None, ""),
        # a machine of 1 MW with 15 % of overload
        ("losses_W", LOSSES_W * 1.15e6 / LOSSES_W.max(), "", None, ""),
    ],
)
def test_losses_that_no_machine_has(tmp_path, header, values, line, severity, said):
    columns = {k: v for k, v in PLAIN.items() if k != "losses_W"} | {header: values}
    more = f"[columns]\n{line}\n" if line else ""
    findings = found(tmp_path, columns, "losses_absurd", more)
    if severity and not findings:  # the doubt about the unit is told in its place
        findings = found(tmp_path, columns, "unit_suspected", more)
    assert [one.severity for one in findings] == ([severity] if severity else [])
    if severity:
        assert said in findings[0].remedy
