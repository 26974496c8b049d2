"""Verdicts on two prototypes: tolerances by the rise and by what the instruments leave open."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heatrun.errors import UsageError
from heatrun.motor.file import load_motor
from heatrun.record.motor import Motor, ParameterOverride
from heatrun.record.record import Record
from heatrun_reports import Reference, build_report, read_reference
from heatrun_reports.analysis.general_information import parse_tolerances
from heatrun_reports.analysis.validation import Validation, validate

PROTOTYPES = Path(__file__).parents[2] / "data" / "synthetic" / "prototypes"
CAR = Motor("car", phase_resistance_ohm=0.0062)
CLOCK = np.arange(0.0, 1201.0)
"""20 minutes, a sample a second."""


def drive(
    name: str, *, rise_K: float = 17.0, bias_K: float = 0.0, power_gain: float = 1.0, seed: int = 1
) -> Record:
    """2 kW and 36 km/h for 20 minutes, a winding that warms in a straight line from 20 °C."""
    rng = np.random.default_rng(seed)
    power = np.where((CLOCK > 60.0) & (CLOCK < 1140.0), 2000.0, 0.0)
    return Record(
        name,
        {
            "time_s": CLOCK,
            "dc_power_W": power_gain * power,
            "vehicle_speed_km_per_h": np.where(power > 0.0, 36.0, 0.0),
            "ambient_degC": 20.0 + 0.001 * rng.normal(size=CLOCK.size),
            "winding_degC": 20.0 + bias_K + rise_K * CLOCK / 1200.0
            + 0.001 * rng.normal(size=CLOCK.size),
        },
    )  # fmt: skip


def confronted(test: Record, other: Record, motor: Motor = CAR, **tolerances: float) -> Validation:
    return validate(test, Reference(other), motor, tolerances=tolerances, offset_s=0.0)


def of(found: Validation, channel: str):
    return next(s for s in found.signals if s.channel == channel)


def figure(found: Validation, name: str):
    return next(f for f in found.figures if f.name == name)


def test_three_kelvin_on_a_rise_of_17_and_8_percent_of_energy_do_not_agree():
    motor = load_motor(PROTOTYPES / "motor.toml")
    other = read_reference(PROTOTYPES / "Road_2024_03_05_001.csv.gz", motor)
    test = read_reference(PROTOTYPES / "Test_2024_03_05_001.csv.gz", motor).record
    report = build_report("real", motor, test, reference=other)
    assert of(report.result, "winding_degC").verdict == "biased"
    assert figure(report.result, "energy_kWh").verdict == "differs"
    assert figure(report.result, "consumption_Wh_per_km").verdict == "differs"
    assert figure(report.result, "distance_km").verdict == "agrees"
    assert not report.summary.startswith("Agrees")
    assert "winding (biased)" in report.summary
    assert "energy (differs by +7.7 %)" in report.summary


def test_a_large_rise_is_judged_by_its_share():
    found = of(confronted(drive("a", rise_K=100.0), drive("b", rise_K=100.0)), "winding_degC")
    # 5 % of the rise that is exceeded for a twentieth of the time: 0.05 * 0.95 * 100 K
    assert found.tolerance.value == pytest.approx(4.75, abs=0.01)
    assert found.tolerance.decided_by == "rise"
    assert "95.0 K" in found.tolerance.basis


def test_a_small_rise_is_judged_by_the_uncertainty_of_both_sensors():
    found = of(confronted(drive("a"), drive("b")), "winding_degC")
    # offset 0.5 K and 0.5 % of 0.95 * 17 K of rise for each of two sensors, k = 2
    u = np.sqrt(2.0) * np.hypot(0.5, 0.005 * 0.95 * 17.0)
    assert found.tolerance.value == pytest.approx(2.0 * u, abs=0.01)
    assert found.tolerance.decided_by == "uncertainty"


def test_the_sensor_class_of_the_motor_file_and_the_step_of_the_readings_count():
    better = Motor("car", parameters={"sensor_offset": ParameterOverride(sd=0.1)})
    coarse = drive("coarse")
    rounded = Record(
        "coarse", {**coarse.channels, "winding_degC": np.round(coarse["winding_degC"])}
    )
    found = of(confronted(drive("a"), rounded, better), "winding_degC")
    # 0.1 K and 0.5 % of the rise twice, and 1/12 of a squared step of 1 K: k = 2
    u = np.sqrt(2.0 * (0.1**2 + (0.005 * 0.95 * 17.0) ** 2) + 1.0 / 12.0)
    # or 5 % of 16.15 K: 0.81 K
    assert 2.0 * u < 0.05 * 0.95 * 17.0
    assert found.tolerance.decided_by == "rise"
    assert found.tolerance.uncertainty == pytest.approx(2.0 * u, abs=0.01)


@pytest.mark.parametrize(
    ("bias_K", "verdict"), [(1.0, "agrees"), (-3.0, "biased"), (3.0, "biased")]
)
def test_a_bias_is_judged_on_a_rise_of_17_kelvin(bias_K, verdict):
    found = confronted(drive("a", bias_K=bias_K), drive("b", seed=2))
    assert of(found, "winding_degC").verdict == verdict


def test_the_band_of_a_simulation_takes_the_place_of_its_sensor():
    other = drive("simulated")
    course = other["winding_degC"]
    reference = Reference(
        other, bands={"winding_degC": (course - 1.96, course + 1.96)}, starts_at_s=0.0
    )
    found = validate(drive("test"), reference, CAR, offset_s=0.0)
    # a band of 1 K standard deviation, and the test's own sensor
    u = np.sqrt(1.0**2 + 0.5**2 + (0.005 * 0.95 * 17.0) ** 2)
    assert of(found, "winding_degC").tolerance.value == pytest.approx(2.0 * u, abs=0.01)


def test_a_tolerance_that_was_given_decides():
    found = confronted(drive("a", bias_K=3.0), drive("b", seed=2), winding_degC=3.5)
    assert of(found, "winding_degC").verdict == "agrees"
    assert of(found, "winding_degC").tolerance.decided_by == "given"


@pytest.mark.parametrize(("gain", "verdict"), [(1.04, "agrees"), (1.077, "differs")])
def test_energy_and_consumption_are_judged_by_their_share(gain, verdict):
    found = confronted(drive("a", power_gain=gain), drive("b"))
    energy, consumption = figure(found, "energy_kWh"), figure(found, "consumption_Wh_per_km")
    # 2 kW over 1080 s with ramps of a second at either end: 0.6 kWh; 36 km/h over 1080 s
    assert energy.reference == pytest.approx(0.6, rel=2e-3)
    assert energy.difference_percent == pytest.approx(100.0 * (gain - 1.0), abs=1e-6)
    assert consumption.reference == pytest.approx(2000.0 / 36.0)
    assert energy.verdict == consumption.verdict == verdict
    assert figure(found, "distance_km").test == pytest.approx(10.8, rel=2e-3)


def test_an_absolute_tolerance_of_energy_can_be_given():
    found = confronted(drive("a", power_gain=1.04), drive("b"), energy_kWh=0.01)
    assert figure(found, "energy_kWh").verdict == "differs"  # 0.024 kWh apart
    assert parse_tolerances(["energy_kWh=0.01"]) == {"energy_kWh": 0.01}
    with pytest.raises(UsageError, match="energy_kWh"):
        parse_tolerances(["energy=0.01"])


def test_figures_are_taken_over_the_time_in_common():
    other = drive("other")
    early = CLOCK < 900.0
    short = Record("short", {name: values[early] for name, values in other.channels.items()})
    found = confronted(drive("whole"), short)
    # 60 to 899 s at 2 kW on both sides
    assert figure(found, "energy_kWh").test == pytest.approx(839.0 / 1800.0, rel=2e-3)
    assert figure(found, "energy_kWh").difference_percent == pytest.approx(0.0, abs=1e-9)


def test_power_at_the_dc_link_is_not_set_against_power_at_the_terminals():
    other = drive("terminals")
    channels = {**other.channels, "electrical_power_W": other["dc_power_W"]}
    del channels["dc_power_W"]
    found = confronted(drive("link"), Record("terminals", channels))
    energy = figure(found, "energy_kWh")
    assert energy.verdict == "not comparable"
    assert "terminals" in energy.note


def test_the_report_says_the_rule_the_tolerance_and_what_decided_it():
    report = build_report(
        "real", CAR, drive("a", bias_K=3.0), reference=Reference(drive("b")), offset_s=0.0
    )
    (table, figures) = report.tables
    (winding,) = [line for line in table.lines if line.name == "winding"]
    assert "combined uncertainty" in winding.note
    assert "5 % of the rise of 16.1 K" in winding.note  # 0.95 * 17 K is 16.15 K
    assert any(name == "Tolerance" and "k = 2" in text for name, text in report.definitions)
    assert [line.name for line in figures.lines][:3] == [
        "Energy", "Energy without regeneration", "Distance",
    ]  # fmt: skip
    assert "5 % of the reference" in figures.note
