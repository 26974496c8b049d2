"""Laws of effects are scaled alike in all tests of a machine, also in those that are predicted."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from heatrun import load_motor
from heatrun.calibration import load_tests, with_scales_of
from heatrun.record.motor import Motor, Scales
from heatrun.record.record import Record
from heatrun.record.reduction import reduce, with_scales
from heatrun.runs.write import motor_text
from heatrun.simulation import simulate_values

VALUES = {"Ceq_w": 300.0, "Ceq_sr": 3300.0, "Req_w": 0.1, "Req_sr": 0.085,
          "stray_load_loss.k": 90.0}  # fmt: skip


def loaded(name, amperes, rpm, flow=6.0):
    """A test of half an hour under one load, then switched off."""
    time = np.arange(0.0, 2700.0)
    on = 1.0 * (time < 1800.0)
    rise = np.where(on > 0.0, 1.0 - np.exp(-time / 300.0), np.exp(-(time - 1800.0) / 300.0))
    noise = np.random.default_rng(1).normal(0.0, 0.05, time.size)
    return Record(name, {
        "time_s": time, "phase_current_A": amperes * on, "speed_rpm": rpm * on,
        "losses_W": 3.0 * amperes**2 * on, "ambient_degC": np.full_like(time, 20.0),
        "winding_degC": 20.0 + 0.3 * amperes**2 * rise + noise,
        "coolant_flow_L_per_min": np.full_like(time, flow),
    })  # fmt: skip


@pytest.fixture
def motor():
    return Motor("servo", phase_resistance_ohm=0.4, effects=("stray_load_loss",))


def test_the_scales_are_the_largest_of_the_fitted_tests_or_rated(motor):
    records = [loaded("a", 13.0, 1500.0, 6.0), loaded("b", 8.0, 2000.0, 9.0)]
    assert with_scales(motor, records).scales == Scales(2000.0, 13.0, 9.0)
    rated = replace(motor, rated_current_A=10.0, rated_speed_rpm=1800.0)
    assert with_scales(rated, records).scales == Scales(1800.0, 10.0, 9.0)
    known = replace(rated, scales=Scales(1000.0, 5.0, 4.0))
    assert with_scales(known, records).scales == known.scales


def test_the_same_load_has_the_same_stray_loss_in_every_test(motor):
    strong, weak = loaded("strong", 13.0, 2000.0), loaded("weak", 6.5, 1000.0)
    motor = with_scales(motor, [strong])
    drives = [reduce(record, motor).inputs.drive() for record in (strong, weak)]
    ratios = [(np.max(d.current_ratio_squared), np.max(np.abs(d.speed))) for d in drives]
    np.testing.assert_allclose(ratios, [(1.0, 1.0), (0.25, 0.5)])
    # a quarter of the current's square at half the speed: 90 W become 8 W in the winding
    with_stray, without = (
        simulate_values(motor, VALUES | {"stray_load_loss.k": watts}, weak, "second")
        for watts in (90.0, 0.0)
    )
    loaded_end = with_stray["time_s"].searchsorted(1790.0)
    more = (with_stray["winding_degC"] - without["winding_degC"])[loaded_end]
    assert more == pytest.approx(90.0 * 0.25 * 0.5**1.5 * 0.1, rel=0.05)


def test_a_finer_reduction_has_the_same_scales(motor):
    spiky = loaded("spiky", 10.0, 1500.0)
    spiky["phase_current_A"][100] = 14.0  # a step of 2 s and one of 1 s see other largest means
    motor = with_scales(motor, [spiky])
    coarse, fine = (reduce(spiky, motor, step_s=step) for step in (4.0, 1.0))
    assert float(coarse.means["rated_current"]) == float(fine.means["rated_current"]) == 14.0


def test_held_out_tests_and_the_run_take_those_of_the_fitted_ones(motor, tmp_path):
    files = [tmp_path / f"{name}.csv" for name in ("fitted", "weak", "predicted")]
    for file, amperes in zip(files, (12.0, 9.0, 15.0), strict=True):
        pd.DataFrame(loaded(file.stem, amperes, 1500.0).channels).to_csv(file, index=False)
    tests = load_tests(motor, files[:2], files[2:])
    assert [float(test.blocks.means["rated_current"]) for test in tests] == [12.0] * 3
    path = tmp_path / "motor.toml"
    path.write_bytes(motor_text(with_scales_of(tests, motor)))
    assert load_motor(path).scales == Scales(1500.0, 12.0, 6.0)
