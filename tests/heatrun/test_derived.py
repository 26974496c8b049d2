"""Channels that follow from measured ones, and columns that say the same thing."""

import numpy as np
import pandas as pd
import pytest
from heat_runs import decided

from heatrun.checks import check_record
from heatrun.io.quantities import printed_unit, quantity, rounded
from heatrun.motor.file import parse_motor
from heatrun.readers.joined import read_test
from heatrun.readers.read import read_record
from heatrun.record.channels import CHANNEL
from heatrun.record.derive import DERIVATIONS, derive
from heatrun.record.motor import Motor

SHAFT = {"torque_Nm": np.array([0.0, 10.0]), "speed_rpm": np.array([1000.0, 3000.0])}
SHAFT_W = np.array([0.0, 1000.0 * np.pi])  # 10 Nm at 50 revolutions per second
DQ = {
    "u_d_V": np.array([1.0, -20.0]),
    "u_q_V": np.array([2.0, 60.0]),
    "i_d_A": np.array([0.0, -30.0]),
    "i_q_A": np.array([0.0, 40.0]),
}


def test_phase_current_is_the_rms_of_the_amplitude():
    channels, notes = derive({"i_d_A": np.array([-30.0]), "i_q_A": np.array([40.0])})
    assert channels["phase_current_A"] == pytest.approx(50.0 / np.sqrt(2.0), rel=1e-15)
    assert len(notes) == 1


def test_current_and_power_of_a_three_phase_system_agree():
    # u and i of one phase, in phase with each other, amplitudes 100 V and 50 A
    angle = np.linspace(0.0, 2.0 * np.pi, 600, endpoint=False)
    shifted = angle - np.array([[0.0], [2.0], [4.0]]) * np.pi / 3.0  # (phase, angle)
    power = np.sum(100.0 * np.cos(shifted) * 50.0 * np.cos(shifted), axis=0).mean()
    rms = np.sqrt(np.mean((50.0 * np.cos(angle)) ** 2))
    channels, _ = derive(
        {"u_d_V": np.zeros(1), "u_q_V": np.array([100.0]), "i_d_A": np.zeros(1)}
        | {"i_q_A": np.array([50.0]), "torque_Nm": np.zeros(1), "speed_rpm": np.zeros(1)}
    )
    # Sums of 600 terms: 1e-12 is far above their rounding and far below any wrong factor.
    assert channels["losses_W"][0] == pytest.approx(power, rel=1e-12)
    assert channels["phase_current_A"][0] == pytest.approx(rms, rel=1e-12)


def test_losses_from_the_efficiency_of_an_analyser_that_writes_none_at_rest():
    power = {"electrical_power_W": np.array([2.0, 1000.0])}
    channels, notes = derive(power | {"efficiency": np.array([np.nan, 0.9])})
    np.testing.assert_allclose(channels["losses_W"], [2.0, 100.0], rtol=1e-12)
    assert "electrical_power_W·(1 - efficiency)" in notes[0]
    measured, _ = derive(power | SHAFT | {"efficiency": np.array([0.9, 0.9])})
    np.testing.assert_allclose(measured["losses_W"], power["electrical_power_W"] - SHAFT_W)


@pytest.mark.parametrize("phases", [3, 6])
def test_losses_from_d_and_q(phases):
    channels, notes = derive(DQ | SHAFT, phases=phases)
    expected = phases / 2.0 * np.array([0.0, 3000.0]) - SHAFT_W
    np.testing.assert_allclose(channels["losses_W"], expected, rtol=1e-14)
    assert any("losses_W is derived" in note for note in notes)


@pytest.mark.parametrize(
    "source",
    [
        {"dc_power_W": np.array([60.0, 3600.0])},
        {"dc_voltage_V": np.array([60.0, 360.0]), "dc_current_A": np.array([1.0, 10.0])},
    ],
)
def test_losses_from_the_dc_link_hold_the_inverters(source):
    channels, notes = derive(source | SHAFT)
    np.testing.assert_allclose(channels["losses_W"], [60.0, 3600.0 - SHAFT_W[1]], rtol=1e-14)
    assert any("inverter" in note for note in notes)


def test_losses_from_a_power_analyser():
    power = {"electrical_power_W": np.array([500.0, 4000.0])}
    channels, _ = derive(power | {"mechanical_power_W": np.array([100.0, 3000.0])} | SHAFT)
    assert channels["losses_W"].tolist() == [400.0, 1000.0]
    channels, _ = derive(power | SHAFT)
    np.testing.assert_allclose(channels["losses_W"], [500.0, 4000.0 - SHAFT_W[1]], rtol=1e-14)


def test_the_source_nearest_to_the_machine_wins():
    channels, notes = derive(DQ | SHAFT | {"dc_power_W": np.array([1e6, 1e6])})
    assert channels["losses_W"].max() < 1e5
    assert not any("inverter" in note for note in notes)


def test_a_measured_channel_is_never_replaced():
    measured = {"losses_W": np.array([1.0, 2.0]), "phase_current_A": np.array([3.0, 4.0])}
    channels, notes = derive(DQ | SHAFT | measured)
    assert channels["losses_W"].tolist() == [1.0, 2.0]
    assert channels["phase_current_A"].tolist() == [3.0, 4.0]
    assert notes == ()


def test_no_balance_is_made_where_losses_come_from_a_map():
    channels, _ = derive(DQ | SHAFT, losses="map")
    assert "losses_W" not in channels
    assert "phase_current_A" in channels


def test_a_missing_sample_stays_missing():
    torque = np.array([np.nan, 10.0])
    channels, _ = derive(DQ | SHAFT | {"torque_Nm": torque})
    assert np.isnan(channels["losses_W"]).tolist() == [True, False]


def test_derivations_speak_of_channels_that_exist():
    for way in DERIVATIONS:
        assert {way.channel, *way.needs} <= set(CHANNEL)


def test_the_motor_decides_on_a_record(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(
        "time_s,u_d_V,u_q_V,i_d_A,i_q_A,torque_Nm,speed_rpm\n0,1,2,0,0,0,0\n1,-20,60,-30,40,0,0\n"
    )
    assert read_record(path)["losses_W"].tolist() == [0.0, 4500.0]
    assert read_record(path, Motor("M", phases=6))["losses_W"].tolist() == [0.0, 9000.0]
    record = read_record(path, Motor("M", losses="map"))
    assert "losses_W" not in record
    assert any("phase_current_A is derived" in note for note in record.notes)


POWER = {"electrical_power_W": np.array([80.0, 95.0])}
LINK = {"dc_voltage_V": np.array([24.0, 25.0]), "dc_current_A": np.array([2.0, 4.0])}


@pytest.mark.parametrize(
    ("columns", "constants", "expected"),
    [
        (POWER, {"mechanical_power_W": 0.0}, [80.0, 95.0]),
        (POWER, {"torque_Nm": 0.0, "speed_rpm": 0.0}, [80.0, 95.0]),
        (POWER, {"speed_rpm": 0.0}, [80.0, 95.0]),  # a shaft that stands, whatever it holds
        (POWER, {"torque_Nm": 0.0}, [80.0, 95.0]),
        (POWER, {"torque_Nm": 0.02, "speed_rpm": 1500.0 / np.pi}, [79.0, 94.0]),
        (POWER | {"speed_rpm": np.zeros(2)}, {}, [80.0, 95.0]),
        (POWER | {"speed_rpm": np.array([0.0, 3.0])}, {}, None),
        (POWER, {"speed_rpm": 900.0}, None),
        (LINK, {"speed_rpm": 0.0}, [48.0, 100.0]),
        ({"dc_power_W": LINK["dc_voltage_V"]}, {"mechanical_power_W": 4.0}, [20.0, 21.0]),
        (LINK | {"dc_current_A": np.array([2.0, np.nan])}, {"speed_rpm": 0.0}, [48.0, np.nan]),
        ({"dc_current_A": LINK["dc_current_A"]}, {"dc_voltage_V": 6.0, "torque_Nm": 0.0},
         [12.0, 24.0]),
        ({"winding_voltage_V": np.array([3.0, 4.0]), "phase_current_A": np.array([5.0, 6.0])},
         {"speed_rpm": 0.0}, [15.0, 24.0]),
        (DQ, {"mechanical_power_W": 0.0}, [0.0, 4500.0]),
        ({}, {"electrical_power_W": 30.0, "speed_rpm": 0.0, "time_s": 0.0}, None),
        # what is measured goes before what is stated
        (POWER | SHAFT, {"losses_W": 1.0}, [80.0, 95.0 - SHAFT_W[1]]),
        (POWER | SHAFT, {"mechanical_power_W": 0.0}, [80.0, 95.0 - SHAFT_W[1]]),
        (POWER, {"losses_W": 7.0, "speed_rpm": 0.0}, [7.0, 7.0]),
    ],
)  # fmt: skip
def test_what_follows_from_columns_follows_from_constants(columns, constants, expected):
    channels, _ = derive(columns, constants=constants)
    if expected is None:
        assert channels.get("losses_W", np.empty(0)).size == 0
    else:
        np.testing.assert_allclose(channels["losses_W"], expected, rtol=1e-14)


def test_a_q_current_with_none_stated_along_d_is_the_phase_current():
    channels, _ = derive({"i_q_A": DQ["i_q_A"]}, constants={"i_d_A": 0.0})
    np.testing.assert_allclose(channels["phase_current_A"], DQ["i_q_A"] / np.sqrt(2.0), rtol=1e-14)


HEAD = '[motor]\nname = "M"\n[winding]\nphase_resistance_ohm = 0.01\n'
TIME_S = np.arange(0.0, 3600.0, 10.0)
RISE_K = 60.0 * (1.0 - np.exp(-TIME_S / 900.0))
RMS_A = 100.0 * np.where(TIME_S % 1200 < 900, 1.0, 0.6)
SPEED_RPM = np.full(TIME_S.size, 3000.0)
POWER_AT_SHAFT_W = np.where(TIME_S % 1200 < 900, 5000.0, 2500.0)
LOSSES_W = 300.0 * (1.0 + 0.0039 * RISE_K) * (RMS_A / 100.0) ** 2 + 150.0
TORQUE_NM = POWER_AT_SHAFT_W / (SPEED_RPM * 2.0 * np.pi / 60.0)
PLAIN = {
    "time_s": TIME_S,
    "phase_current_A": RMS_A,
    "losses_W": LOSSES_W,
    "ambient_degC": 20.0 + 0.01 * np.sin(TIME_S),
    "winding_degC": 20.0 + RISE_K,
    "speed_rpm": SPEED_RPM,
}
IN_DQ = {"i_d_A": -0.6 * 2**0.5 * RMS_A, "i_q_A": 0.8 * 2**0.5 * RMS_A}
POWERS = {"torque_Nm": TORQUE_NM, "electrical_power_W": POWER_AT_SHAFT_W + LOSSES_W}


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
    "dc_current_A": (POWER_AT_SHAFT_W + LOSSES_W) / 0.95 / 400.0,
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


@pytest.mark.parametrize(("unit", "in_rpm"), [("rad/s", 30.0 / np.pi), ("rev/s", 60.0)])
@pytest.mark.parametrize(
    "others",
    [{"mechanical_power_W": POWER_AT_SHAFT_W}, {"electrical_power_W": POWER_AT_SHAFT_W + LOSSES_W}],
)
def test_the_speed_in_another_unit_beside_torque_and_power(tmp_path, unit, in_rpm, others):
    columns = {**PLAIN, "torque_Nm": TORQUE_NM, **others}
    columns["speed"] = columns.pop("speed_rpm") / in_rpm
    (finding,) = found(tmp_path, columns)
    told = f"They agree if the speed was in {unit} (read as rpm, assumed, no unit given)."
    assert told in finding.message


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


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (4711.0, 3, "4710"), (10481.3, 4, "10480"), (0.01593, 4, "0.01593"), (2.4e-7, 3, "2.4e-07"),
        (0.0, 3, "0"), (-15260.0, 2, "-15000"), (3.2e9, 3, "3.2e+09"), (float("nan"), 3, "nan"),
        (float("inf"), 3, "inf"),
    ],
)  # fmt: skip
def test_numbers_have_no_exponent_where_they_are_readable(value, digits, text):
    assert rounded(value, digits) == text


def test_a_pure_number_has_no_unit():
    assert quantity("0.62", "1") == "0.62"
    assert quantity("0.0062", "ohm") == "0.0062 Ω"
    assert [printed_unit(unit) for unit in ("degC", "K/W", "J/K")] == ["°C", "K/W", "J/K"]
