"""Channels that follow from measured ones."""

from __future__ import annotations

import numpy as np
import pytest

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
