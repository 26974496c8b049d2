"""A held-out test that begins warm: cut out of its record, or run up to with readings masked."""

from __future__ import annotations

import numpy as np
from run_near_truth import run_near_truth

from heatrun.record.motor import Motor
from heatrun.record.stretch import Stretch, cut, mask
from heatrun.runs.run import open_run

MOTOR = Motor("reference", phase_resistance_ohm=0.0062)
BEGIN_S = 1800.0


def test_a_record_that_is_run_through_has_a_narrower_band_than_one_that_is_cut(
    tmp_path, bench, generator
):
    run = open_run(run_near_truth(tmp_path / "run", MOTOR, bench(generator.duty(600.0), seed=20)))
    whole = bench(generator.duty(3600.0), seed=21, name="warm")
    found = {}
    for how, record in (
        ("cut", cut(whole, Stretch(BEGIN_S), "test")),
        ("mask", mask(whole, [(60.0, BEGIN_S)], "test")),
    ):
        prediction = run.predict(record, motor=MOTOR)
        later = (prediction.time_s > BEGIN_S + 60.0) & prediction.test.is_observed
        low, high = prediction.total["95"]
        inside = (prediction.test.measured >= low) & (prediction.test.measured <= high)
        found[how] = (np.mean(inside[later]), np.mean((high - low)[later]), later.sum())
    assert found["mask"][2] == found["cut"][2]
    assert found["mask"][1] < 0.6 * found["cut"][1]
    assert found["mask"][0] > 0.85  # 95 % of 87 blocks, some of them alike
    assert found["cut"][0] > 0.85
