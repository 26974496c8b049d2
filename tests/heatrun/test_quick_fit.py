"""The quick fit of the checks: time constants, what it leaves open, what it predicts."""

from __future__ import annotations

import numpy as np
import pytest
from heat_runs import MOTOR, changed, heat_run
from scipy.signal import lfilter

from heatrun.checks.quick_fit import quick_fit

C_w, C_sr, R_w, R_sr = 666.75, 15060.1, 0.14485, 0.11625
STATES = np.array(
    [[-1.0 / (C_w * R_w), 1.0 / (C_w * R_w)],
     [1.0 / (C_sr * R_w), -(1.0 / R_w + 1.0 / R_sr) / C_sr]]
)  # fmt: skip
FAST, SLOW = np.sort(-1.0 / np.linalg.eigvals(STATES))


@pytest.mark.parametrize("seed", range(3))
def test_an_hour_tells_both_time_constants_and_the_winding(seed):
    found = quick_fit(heat_run(seed, step_s=1.0), MOTOR)
    assert found is not None
    assert found.taus_s[0] == pytest.approx(FAST, rel=0.05)
    assert abs(np.log(found.tau_s / SLOW)) < 3.0 * max(found.log_sd, 0.01)
    # a joule in the winding, before any of it has left; one in the body, which shows later
    at_once = found.response_K_per_J.sum(axis=1)
    assert at_once[0] == pytest.approx(1.0 / C_w, rel=0.1)
    assert at_once[1] == pytest.approx(0.0, abs=0.01 / C_w)


def test_a_short_test_leaves_the_slow_time_constant_open():
    sds = [quick_fit(heat_run(1, minutes, step_s=1.0), MOTOR) for minutes in (12.0, 30.0, 60.0)]
    first, second, last = (found.log_sd for found in sds if found is not None)
    assert first > 0.4 > 0.1 > second > last


def test_a_sensor_that_lags_does_not_move_the_slow_time_constant():
    record = heat_run(2, step_s=1.0, rounding=0.1)
    lag = np.exp(-1.0 / 25.0)
    rise = lfilter([1.0 - lag], [1.0, -lag], record["winding_degC"] - record["winding_degC"][0])
    late = changed(record, winding_degC=record["winding_degC"][0] + np.asarray(rise))
    found = quick_fit(late, MOTOR)
    assert found is not None
    assert found.tau_s == pytest.approx(SLOW, rel=0.05)


def test_what_is_left_out_is_predicted_within_its_doubt():
    record = heat_run(3, step_s=1.0, rounding=0.1)
    hidden = (record.time_s > 1500.0) & (record.time_s < 2100.0)
    wrong = changed(record, winding_degC=np.where(hidden, 50.0, record["winding_degC"]))
    found = quick_fit(wrong, MOTOR, left_out_s=[(1500.0, 2100.0)])
    assert found is not None
    true = np.interp(found.time_s, record.time_s, record["winding_degC"])
    inside = (found.time_s > 1500.0) & (found.time_s < 2100.0)
    off = np.abs(found.fitted_degC - true)[inside]
    doubt = 3.0 * np.hypot(found.rms_K, np.max(found.sd_K[inside]))
    # the resistance in there is that of the readings beside it, some kelvins off
    assert np.max(off) < doubt + 0.05 * np.ptp(true[inside])


def test_a_course_of_no_network_is_not_fitted():
    record = heat_run(4, step_s=1.0)
    noise = np.random.default_rng(0).uniform(20.0, 90.0, record.time_s.size)
    assert quick_fit(changed(record, winding_degC=noise), MOTOR) is None
    assert quick_fit(changed(record, winding_degC=np.full(noise.size, 40.0)), MOTOR) is None
