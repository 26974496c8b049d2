"""Where a test starts that was not fitted: by the model of sensor and clock, not by a ruler."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heatrun.record.reduction import reduce
from heatrun.simulation import predict_values

DELAY_S = 6.8
LAG_S = 15.0


@pytest.fixture(scope="module")
def exact(bench, generator):
    """A load step from a soaked machine, logged from its first second, without noise."""
    quiet = {"drift_sd_K": 0.0, "white_sd_K": 0.01, "resolution_K": 0.0, "ambient_sd_K": 0.0,
             "ambient_resolution_K": 0.0, "power_noise": 0.0, "power_floor_W": 0.0,
             "current_sd_A": 0.0}  # fmt: skip
    record = bench(generator.constant_load(1860.0, torque=0.9), seed=31, **quiet)
    kept = record.time_s >= 60.0
    channels = {name: values[kept] for name, values in record.channels.items()}
    return replace(record, channels={**channels, "time_s": channels["time_s"] - 60.0})


def late(record):
    """The record with its temperature written 6.8 s late."""
    winding = np.interp(record.time_s - DELAY_S, record.time_s, record["winding_degC"])
    return replace(record, channels={**record.channels, "winding_degC": winding})


def lagging(record):
    """The record with a thermometer that follows with a time constant of 15 s."""
    winding = record["winding_degC"].copy()
    for i in range(1, winding.size):
        share = 1.0 - np.exp(-(record.time_s[i] - record.time_s[i - 1]) / LAG_S)
        between = 0.5 * (record["winding_degC"][i] + record["winding_degC"][i - 1])
        winding[i] = winding[i - 1] + share * (between - winding[i - 1])
    return replace(record, channels={**record.channels, "winding_degC": winding})


@pytest.mark.parametrize(
    ("spoilt", "effect", "value"),
    [
        (late, "time_shift", {"time_shift.d": DELAY_S}),
        (lagging, "sensor_lag", {"sensor_lag.tau": LAG_S}),
    ],
)
def test_a_late_reading_does_not_move_the_start(spoilt, effect, value, exact, motor, truth):
    record = spoilt(exact)
    known = replace(motor, effects=(effect,))
    found = predict_values(known, {**truth, "Rs0": 0.0062, **value}, record, "second")
    true_start = float(exact["winding_degC"][0])
    # samples joined by straight lines put the step half a second off, and the reading with it
    slope = (exact["winding_degC"][20] - true_start) / 20.0
    half_a_sample = 0.5 * slope
    # a ruler through the first readings of a late sensor is more than twice as far off
    assert abs(reduce(record, motor).start_degC - true_start) > 2.0 * half_a_sample
    assert float(found.values["Tw_start"][0]) == pytest.approx(true_start, abs=half_a_sample)
    assert float(found.values["Tsr_start"][0]) == pytest.approx(true_start, abs=half_a_sample)
    assert found.rmse_K < half_a_sample


def test_a_test_without_a_winding_starts_soaked_at_the_sink(exact, motor, truth):
    bare = {n: v for n, v in exact.channels.items() if n != "winding_degC"}
    found = predict_values(motor, {**truth, "Rs0": 0.0062}, replace(exact, channels=bare), "second")
    sink = float(exact["ambient_degC"][0])
    assert float(found.values["Tw_start"][0]) == pytest.approx(sink, abs=0.05)
    assert np.isnan(found.rmse_K)


def test_readings_after_the_first_blocks_are_not_read(exact, motor, truth):
    values = {**truth, "Rs0": 0.0062}
    winding = exact["winding_degC"].copy()
    winding[exact.time_s > 60.0] += 5.0
    moved = replace(exact, channels={**exact.channels, "winding_degC": winding})
    one, two = (predict_values(motor, values, record, "second") for record in (exact, moved))
    assert np.array_equal(one.median, two.median)


def test_a_measured_stator_starts_where_its_sensor_says(exact, motor, truth):
    """Winding and stator 1.5 K above the sink: not soaked to the end, and both are measured."""
    channels = {**exact.channels, "ambient_degC": exact["ambient_degC"] - 1.5}
    stator = np.full_like(exact["winding_degC"], exact["winding_degC"][0])
    warm = replace(exact, channels={**channels, "stator_degC": stator})
    found = predict_values(motor, {**truth, "Rs0": 0.0062}, warm, "second")
    assert float(found.values["Tsr_start"][0]) == pytest.approx(stator[0], abs=0.2)
