"""What a record that suffered several faults is told: their causes, and none of what they cause."""

from __future__ import annotations

import numpy as np
import pytest
from heat_runs import CLEAN, MOTOR, as_columns, changed, decided, every, fell_off, heat_run

from heatrun.checks import check_record
from heatrun.checks.unexplained import unexplained_movement
from heatrun.record.record import Record

SLOW = every(CLEAN, 20)  # 2 s


def errors(record: Record) -> list[str]:
    return [one.id for one in check_record(record, MOTOR) if one.severity == "error"]


def test_three_faults_are_three_findings():
    record = fell_off(SLOW, 1500.0)
    time_s = record.time_s.copy()
    time_s[1400:] -= 2000.0
    shaft_W = 0.6 * record["losses_W"]
    power = (record["losses_W"] + shaft_W) / 1e3
    struck = changed(
        record, time_s=time_s, electrical_power_W=power, mechanical_power_W=shaft_W,
        losses_W=power - shaft_W,
    )  # fmt: skip
    columns = as_columns(struck)
    kept = tuple(one for one in columns.mapping if one.channel != "losses_W")
    found = [
        one for one in check_record(
            Record("run", struck.channels, mapping=kept), MOTOR
        ) if one.severity != "note"
    ]  # fmt: skip
    assert [one.id for one in found] == ["time_backwards", "unit_suspected", "sensor_detached"]


def test_a_sensor_that_is_put_back_is_left_out_between():
    record = fell_off(SLOW, 1500.0)
    winding = np.where(record.time_s < 2200.0, record["winding_degC"], SLOW["winding_degC"])
    (finding,) = [
        one for one in check_record(changed(record, winding_degC=winding), MOTOR)
        if one.severity == "error"
    ]  # fmt: skip
    assert finding.id == "sensor_detached"
    assert "mask = [[1" in finding.remedy
    assert finding.values["until_s"] == pytest.approx(2200.0, abs=5.0)


def test_a_sensor_that_fails_early_teaches_nothing_false():
    """Nine tenths of the record show air that no load warms."""
    moved = unexplained_movement(fell_off(SLOW, 400.0), MOTOR)
    assert moved is not None
    assert moved.from_s == pytest.approx(400.0, abs=4.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_load_that_steps_explains_what_the_winding_does(seed):
    clean = heat_run(100 + seed, 60.0, step_s=2.0, rounding=(0.0, 0.1, 1.0, 1.0)[seed], noise=0.05)
    assert unexplained_movement(clean, MOTOR) is None


def test_a_steady_load_tells_its_rise():
    steady = np.full(SLOW.time_s.size, 82.0)
    steady[::7] += 0.1
    record = changed(
        SLOW, winding_degC=steady, ambient_degC=0.0 * steady + 22.0, losses_W=0.0 * steady + 300.0,
        phase_current_A=0.0 * steady + 90.0,
    )  # fmt: skip
    (finding,) = [one for one in check_record(record, MOTOR) if one.id == "no_heating"]
    assert "60.0 K at 300 W, 0.2 K/W" in finding.message


def test_amplitudes_are_told_once():
    peaks = decided(changed(SLOW, phase_current_A=np.sqrt(2.0) * SLOW["phase_current_A"]))
    told = [one for one in check_record(peaks, MOTOR) if one.severity != "note"]
    assert [one.id for one in told] == ["losses_below_copper"]
    assert "[A_peak]" in told[0].remedy


def test_input_power_for_losses_is_not_told_of_the_clock_too():
    """A small motor in a strong wind: its losses make 5 W/K and 90 s, the input power 40 W/K."""
    time_s = np.arange(0.0, 2400.0, 2.0)
    winding = 22.0 + 70.0 * -np.expm1(-time_s / 90.0)
    torque = np.full(time_s.size, 3.2)
    losses = np.full(time_s.size, 350.0)
    shaft = torque * 8000.0 * np.pi / 30.0
    record = as_columns(Record(
        "run",
        {"time_s": time_s, "winding_degC": np.round(winding, 1), "losses_W": losses + shaft,
         "ambient_degC": np.full(time_s.size, 22.0), "torque_Nm": torque,
         "speed_rpm": np.full(time_s.size, 8000.0)},
    ))  # fmt: skip
    told = {one.id for one in check_record(record, MOTOR)}
    assert "losses_of_shaft" in told
    assert "unit_suspected" not in told


def test_a_sensor_below_its_housing_through_short_pulses_is_told_from_where_it_fell():
    """Pulses of 40 s: no one of them is long enough by itself."""
    time_s = np.arange(0.0, 3600.0)
    loaded = time_s % 80.0 < 40.0
    losses = np.where(loaded, 400.0, 0.0)
    housing = 24.0 + 40.0 * -np.expm1(-time_s / 800.0)
    swing = np.where(loaded, time_s % 80.0, 80.0 - time_s % 80.0) * 0.6
    winding = housing + 4.0 + swing
    off = time_s > 2000.0
    fallen = 24.0 + (winding[2000] - 24.0) * np.exp(-(time_s[off] - 2000.0) / 25.0)
    winding[off] = fallen
    record = Record(
        "run",
        {"time_s": time_s, "winding_degC": np.round(winding, 1), "losses_W": losses,
         "housing_degC": np.round(housing, 1), "ambient_degC": np.full(time_s.size, 24.0),
         "phase_current_A": np.where(loaded, 120.0, 0.0)},
    )  # fmt: skip
    told = [one for one in check_record(record, MOTOR) if one.id == "sensor_detached"]
    (finding,) = told
    assert finding.values["from_s"] == pytest.approx(2000.0, abs=60.0)
    assert "use = [[0.000, " in finding.remedy


def test_a_shift_below_the_housing_is_told_as_the_shift_alone():
    housing = SLOW["winding_degC"] - 5.0
    shifted = np.where(SLOW.time_s < 1500.0, SLOW["winding_degC"], SLOW["winding_degC"] - 14.0)
    record = changed(SLOW, winding_degC=shifted, housing_degC=housing)
    assert errors(record) == ["temperature_jump"]
