"""Equilibrium on each stretch of constant load, and courses that were stopped before it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from run_near_truth import TRUTH, run_near_truth

from heatrun.readers.read import read_record
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun_reports import build_report
from heatrun_reports.analysis.drive import stretches
from heatrun_reports.analysis.equilibrium import SteadyRise, equilibria, steady_rise

MOTOR = Motor("reference", phase_resistance_ohm=0.0062)
BENCH = Path(__file__).parents[3] / "shared" / "bench" / "paderborn_profile24_heatrun_2p5s.csv.gz"


def two_loads(*, first_min: float = 73.0, second_min: float = 70.0, tau_min: float = 6.0) -> Record:
    """A rise of 100 K at 60 N m that settles, then at none to 37 K; a sample every 2 s."""
    rng = np.random.default_rng(3)
    time_s = np.arange(0.0, 60.0 * (first_min + second_min), 2.0)
    end_s, tau_s = 60.0 * first_min, 60.0 * tau_min
    is_first = time_s < end_s
    top = 100.0 * (1.0 - np.exp(-end_s / tau_s))
    after = 37.0 + (top - 37.0) * np.exp(-(time_s - end_s) / tau_s)
    rise = np.where(is_first, 100.0 * (1.0 - np.exp(-time_s / tau_s)), after)
    return Record(
        "two_loads",
        {
            "time_s": time_s,
            "torque_Nm": np.where(is_first, 60.0, 0.0) + 0.2 * rng.normal(size=time_s.size),
            "speed_rpm": 5500.0 + rng.normal(size=time_s.size),
            "winding_degC": 20.0 + rise + 0.05 * rng.normal(size=time_s.size),
            "ambient_degC": np.full(time_s.size, 20.0),
        },
    )


def test_a_load_step_after_equilibrium_takes_nothing_back():
    record = two_loads()
    first, second = equilibria(record, MOTOR, "winding_degC")
    # after 40 min of 6 min the winding is within 100 exp(-40/6) = 0.13 K of its end
    held = (record.time_s > 2400.0) & (record.time_s < 4380.0)
    assert np.ptp(record["winding_degC"][held]) < 0.6  # with noise of 0.05 K, four times over
    assert first.is_reached is True
    # each stretch ends within two minutes of the step
    assert first.stretch.to_s == pytest.approx(4380.0, abs=120.0)
    assert second.stretch.from_s == pytest.approx(4380.0, abs=120.0)
    assert second.is_reached is True
    # 1000 exp(-t/6 min) K/h are 2 K/h after 37 min, and the line is laid over a third before
    assert first.first_reached_s is not None
    assert 2200.0 < first.first_reached_s < 4000.0
    report = build_report("thermal", MOTOR, record)
    assert "not reached" not in report.summary
    (row,) = [row for row in report.rows if row.name == "winding_equilibrium"]
    assert row.value == "reached"


def test_a_slow_part_is_not_reached_on_the_stretch_that_is_too_short_for_it():
    first, second = equilibria(two_loads(tau_min=40.0), MOTOR, "winding_degC")
    # 150 K/h exp(-73/40) are 24 K/h at the end
    assert first.is_reached is False
    assert second.is_reached is False


@pytest.mark.skipif(not BENCH.exists(), reason="the measured bench records are not here")
def test_a_measured_heat_run_is_reached_before_its_load_step():
    motor = Motor("PMSM", sink="coolant")
    first, *_ = equilibria(read_record(BENCH, motor), motor, "winding_degC")
    assert first.is_reached is True
    # held within 0.2 K from minute 40 on; the torque goes at 4392 s
    assert first.stretch.to_s == pytest.approx(4392.0, abs=120.0)
    assert max(map(abs, first.gradients_K_per_h)) < 0.5


def test_pulses_within_a_minute_are_one_load_and_a_drive_is_none():
    time_s = np.arange(0.0, 5400.0)
    pulses = np.where(time_s % 30.0 < 10.0, 80.0, 10.0)
    (whole,) = stretches(Record("pulses", {"time_s": time_s, "torque_Nm": pulses}), 1800.0)
    assert whole.length_s == pytest.approx(5399.0, abs=60.0)
    steps = np.repeat(np.random.default_rng(1).uniform(-50.0, 50.0, 45), 120)
    assert stretches(Record("drive", {"time_s": time_s, "torque_Nm": steps}), 1800.0) == ()


def test_a_change_of_speed_or_flow_or_a_gap_ends_a_stretch():
    time_s = np.arange(0.0, 7200.0)
    late = time_s >= 3600.0
    torque = np.full(time_s.size, 20.0)
    for channel in ("speed_rpm", "coolant_flow_L_per_min", "fan"):
        channels = {"time_s": time_s, "torque_Nm": torque, channel: np.where(late, 0.5, 1.0)}
        assert len(stretches(Record("changed", channels), 1800.0)) == 2
    away = (time_s < 3000.0) | (time_s > 4200.0)
    gap = Record("gap", {"time_s": time_s[away], "torque_Nm": torque[away]})
    assert [round(s.to_s) for s in stretches(gap, 1800.0)] == [3000, 7199]


def test_a_course_stopped_early_is_continued_to_its_steady_state():
    time_s = np.arange(0.0, 4500.0, 5.0)  # 75 min of a time constant of 50 min
    rng = np.random.default_rng(8)
    rise = 90.0 * (1.0 - np.exp(-time_s / 3000.0)) + 0.1 * rng.normal(size=time_s.size)
    found = steady_rise(time_s, rise)
    assert isinstance(found, SteadyRise)
    low, high = found.rise_95_K
    assert low < 90.0 < high
    assert high - low < 6.0  # 20 K are still to come: a fifth of them is left open at most
    assert found.tau_s == pytest.approx(3000.0, rel=0.05)
    later = np.array([6000.0, 9000.0, 60000.0])
    below, middle, above = found.course(later)
    truth = 90.0 * (1.0 - np.exp(-later / 3000.0))
    assert np.all((below < truth) & (truth < above))
    assert middle[-1] == pytest.approx(found.rise_K, abs=0.05)


def test_the_band_of_a_continued_course_holds_what_it_says():
    inside, told = 0, 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        length_s = 60.0 * rng.uniform(40.0, 120.0)
        time_s = np.arange(0.0, length_s, 10.0)
        tau_s = length_s * rng.uniform(0.3, 1.0)
        slow = 60.0 * (1.0 - np.exp(-time_s / tau_s))
        rise = slow + 8.0 * (1.0 - np.exp(-time_s / 100.0)) + 0.2 * rng.normal(size=time_s.size)
        found = steady_rise(time_s, rise)
        if isinstance(found, SteadyRise):
            told += 1
            inside += found.rise_95_K[0] <= 68.0 <= found.rise_95_K[1]
    assert told >= 50
    # 95 % of 60 less two standard deviations (1.7) of such a count
    assert inside / told > 0.88


def test_a_straight_course_is_continued_to_nothing():
    time_s = np.arange(0.0, 2400.0, 10.0)
    rise = 0.01 * time_s + 0.2 * np.random.default_rng(9).normal(size=time_s.size)
    assert "no bend" in str(steady_rise(time_s, rise))


def test_the_report_marks_what_is_extrapolated():
    time_s = np.arange(0.0, 4500.0, 5.0)
    rng = np.random.default_rng(8)
    winding = 20.0 + 90.0 * (1.0 - np.exp(-time_s / 3000.0)) + 0.1 * rng.normal(size=time_s.size)
    channels = {"time_s": time_s, "winding_degC": winding, "torque_Nm": np.full(time_s.size, 30.0)}
    channels["ambient_degC"] = np.full(time_s.size, 20.0)
    report = build_report("thermal", MOTOR, Record("stopped", channels))
    (row,) = [row for row in report.rows if row.name == "winding_steady_degC"]
    assert "extrapolated" in row.label
    assert row.value == pytest.approx(110.0, abs=3.0)
    assert "95 %" in row.note
    assert any(name == "Extrapolated" for name, _ in report.definitions)
    (drawing,) = [each for each in report.drawings if each.name == "temperatures"]
    assert "extrapolated" in drawing.caption
    axis, _ = drawing.draw().axes
    labels = axis.get_legend_handles_labels()[1]
    assert any("extrapolated" in label for label in labels)


def test_nothing_is_continued_where_the_load_is_not_known_to_be_held():
    record = two_loads(tau_min=40.0)
    bare = {name: record[name] for name in ("time_s", "winding_degC", "ambient_degC")}
    (found,) = equilibria(Record("bare", bare), MOTOR, "winding_degC")
    assert found.is_reached is False
    assert "held" in str(found.steady)


def test_the_network_of_a_run_continues_a_heat_run_to_its_rest(tmp_path, bench, generator):
    run = run_near_truth(tmp_path / "run", MOTOR, bench(generator.duty(600.0), seed=20))
    report = build_report(
        "thermal", MOTOR, bench(generator.constant_load(2700.0), seed=22, name="stopped"), run=run
    )
    machine = generator.reference_motor()
    current, speed = float(machine.current(0.55)), 0.7 * machine.rated_speed_rpm
    other = float(machine.other_loss(current, speed))
    # Tw = T0 + Req_sr (Pjs + Pol) + Req_w Pjs with Pjs = k (234.5 + Tw), solved for Tw
    k = float(machine.copper_loss_per_kelvin(current))
    own = (TRUTH["Req_sr"] + TRUTH["Req_w"]) * k
    rows = {row.name: row for row in report.rows}
    sink = float(np.mean(report.result.simulated.prediction.test.inputs.ambient[-30:]))
    winding = (sink + TRUTH["Req_sr"] * other + own * 234.5) / (1.0 - own)
    assert rows["winding_network_steady_degC"].value == pytest.approx(winding, abs=1.0)
    stator = winding - TRUTH["Req_w"] * k * (234.5 + winding)
    assert rows["stator_network_steady_degC"].value == pytest.approx(stator, abs=1.0)
    assert "extrapolated" in rows["winding_network_steady_degC"].label
    # one exponential of 30 min comes to the same within what it leaves open
    low, high = report.result.settled[-1].steady.rise_95_K
    assert low - 1.0 < winding - sink < high + 1.0
