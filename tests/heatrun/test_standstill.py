"""At standstill the losses are the copper loss: what that shows of the instruments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heatrun.checks import check_record, current_scale_unchecked
from heatrun.record.derive import BY_CONSTANTS
from heatrun.record.motor import Motor, ParameterOverride
from heatrun.record.record import ColumnReading, Record

MOTOR = Motor("reference", phase_resistance_ohm=0.02)
STANDS_S = 900.0


def locked(minutes: float = 15.0, *, current_gain: float = 1.0, power_gain: float = 1.0) -> Record:
    """A winding that warms from 20 to 50 degC under 60 A at standstill, then turns under 80 A."""
    rng = np.random.default_rng(4)
    time_s = np.arange(0.0, 2400.0)
    stands = time_s < 60.0 * minutes
    winding = 20.0 + 30.0 * (1.0 - np.exp(-time_s / 600.0))
    current = np.where(stands, 60.0, 80.0)
    # copper at 25 degC with B = 234.5: 3 * 0.02 * (234.5 + T)/259.5 * I^2
    copper = 3.0 * 0.02 * (234.5 + winding) / 259.5 * current**2
    return Record(
        "locked",
        {
            "time_s": time_s,
            "phase_current_A": current_gain * current + 0.1 * rng.standard_normal(time_s.size),
            "losses_W": power_gain * (copper + np.where(stands, 0.0, 150.0)),
            "ambient_degC": np.full(time_s.size, 20.0),
            "winding_degC": winding,
            "speed_rpm": np.where(stands, 0.0, 3000.0) + 0.2 * rng.standard_normal(time_s.size),
        },
    )


def seen(record: Record, motor: Motor = MOTOR):
    return [f for f in check_record(record, motor) if f.id == "standstill_losses"]


def test_a_standstill_that_agrees_says_how_well_it_checks_the_scales():
    (finding,) = seen(locked())
    assert finding.severity == "note"
    assert finding.values["ratio"] == pytest.approx(1.0, abs=0.002)
    # by hand: power 1 %, twice 0.5 % of current, Rs0 1 %; sensor hypot(1 K, 5 % of 16 K) at 36 degC
    # 1.28/271 = 0.47 %; offset of the power meter 0.05 % of 540 W in 227 W = 0.12 %
    assert finding.values["ratio_sd"] == pytest.approx(0.0180, rel=0.03)
    assert finding.values["current_A"] == pytest.approx(60.0, rel=1e-3)
    assert "allow 3.6 % (95 %)" in finding.message


@pytest.mark.parametrize("gain", [0.97, 1.03])
def test_a_current_off_by_three_percent_is_seen_twice_as_large(gain):
    (finding,) = seen(locked(current_gain=gain))
    assert finding.severity == "warning"
    assert finding.values["ratio"] == pytest.approx(1.0 / gain**2, abs=0.002)
    assert f"reading 3.0 % too {'low' if gain < 1 else 'high'}" in finding.remedy


@pytest.mark.parametrize(("power_gain", "said"), [(1e3, "1000 times it"), (1e-3, "1/1000 of it"),
                                                  (0.0, "0 % of it")])  # fmt: skip
def test_a_wrong_unit_is_said_as_a_factor_and_not_in_thousands_of_per_cent(power_gain, said):
    for finding in seen(locked(power_gain=power_gain)):
        assert said in finding.message
        assert finding.remedy.startswith("Check the units of ")
        assert "too high" not in finding.remedy
        assert "Leads" not in finding.remedy


@pytest.mark.parametrize(("power_gain", "severity"), [(1.5, "note"), (0.8, "warning")])
def test_a_rotor_said_to_be_locked_may_take_its_part_under_alternating_current(
    power_gain, severity
):
    record = locked(power_gain=power_gain)
    (finding,) = seen(replace(record, notes=(f"speed_rpm = 0 {BY_CONSTANTS}",)))
    assert finding.severity == severity
    assert ("alternating current" in finding.remedy) == (severity == "note")


def test_a_current_off_by_one_percent_is_within_the_instruments():
    assert [f.severity for f in seen(locked(current_gain=0.99))] == ["note"]


def test_a_resistance_known_better_or_worse_moves_the_limit():
    known = replace(MOTOR, parameters={"Rs0": ParameterOverride(relative_sd=0.002)})
    guessed = replace(MOTOR, parameters={"Rs0": ParameterOverride(relative_sd=0.2)})
    record = locked(power_gain=1.034)
    assert [f.severity for f in seen(record, known)] == ["warning"]
    assert [f.severity for f in seen(record)] == ["note"]
    assert [f.severity for f in seen(locked(power_gain=1.2), guessed)] == ["note"]


@pytest.mark.parametrize(
    ("record", "motor"),
    [
        (locked(minutes=2.0), MOTOR),
        (locked(), replace(MOTOR, losses="map")),
        (locked(), replace(MOTOR, phase_resistance_ohm=None)),
        (Record("no speed", {k: v for k, v in locked().channels.items() if k != "speed_rpm"}),
         MOTOR),
    ],
    ids=["two minutes", "losses from a map", "no resistance", "no speed"],
)  # fmt: skip
def test_what_no_copper_loss_can_be_held_against_is_left_alone(record, motor):
    assert seen(record, motor) == []


def test_losses_behind_an_inverter_hold_its_own_too():
    record = locked()
    read = {**record.channels, "dc_power_W": record["losses_W"] * 1.1,
            "torque_Nm": np.zeros(2400)}  # fmt: skip
    mapping = tuple(
        ColumnReading(name, name, "", "derived" if name == "losses_W" else "stated", "", "a.csv")
        for name in read
    )
    assert seen(Record("inverter", read, mapping=mapping)) == []


def with_voltages(volts_per_volt: float) -> Record:
    """Voltages of the same winding: u = R(T) i in d, the amplitude is sqrt(2) times 60 A."""
    record = locked()
    resistance = 0.02 * (234.5 + record["winding_degC"]) / 259.5
    i_d = np.where(record.time_s < STANDS_S, 60.0 * np.sqrt(2.0), 0.0)
    nothing = np.zeros(i_d.size)
    axes = {"u_d_V": volts_per_volt * resistance * i_d, "u_q_V": nothing, "i_d_A": i_d,
            "i_q_A": nothing}  # fmt: skip
    return replace(record, channels={**record.channels, **axes})


def test_voltage_over_current_is_checked_too_also_for_losses_from_a_map():
    both = seen(with_voltages(1.05))
    assert [f.severity for f in both] == ["note", "warning"]
    assert both[1].values["ratio"] == pytest.approx(1.05, abs=1e-6)
    assert "1 % per 1 %" in both[1].remedy
    (alone,) = seen(with_voltages(1.0), replace(MOTOR, losses="map"))
    assert alone.severity == "note"


def test_a_calibration_without_a_standstill_says_once_what_it_cannot_see():
    short = locked(minutes=2.0)
    (finding,) = current_scale_unchecked(MOTOR, [short, short])
    assert (finding.id, finding.severity) == ("current_scale_unchecked", "note")
    assert "2 %" in finding.message
    assert "standstill" in finding.remedy
    assert current_scale_unchecked(MOTOR, [short, locked()]) == ()
    assert current_scale_unchecked(MOTOR, [short, locked(current_gain=0.9)]) == ()
    assert current_scale_unchecked(replace(MOTOR, phase_resistance_ohm=None), [short]) == ()
