"""The longer test that is imagined for the advice goes on with the last load."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.posterior.identifiability import extended
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce


def blocks(load_until_s: float, load_A: float = 100.0):
    time_s = np.arange(0.0, 3600.0, 2.0)
    is_on = (time_s > 300.0) & (time_s < load_until_s)
    level = np.where(time_s < 1200.0, 0.6 * load_A, load_A)
    current = np.where(is_on, level, 0.0)
    channels = {
        "time_s": time_s,
        "phase_current_A": current,
        "losses_W": 0.04 * current**2,
        "ambient_degC": np.full(time_s.size, 20.0),
        "winding_degC": 20.0 + 0.01 * time_s,
    }
    return reduce(Record("t", channels), Motor("M"))


@pytest.mark.parametrize(
    ("load_until_s", "current_A"),
    [(4000.0, 100.0), (2400.0, 100.0), (1100.0, 60.0)],
    ids=["loaded to the end", "a cool-down behind it", "the first level only"],
)
def test_the_last_load_goes_on_though_a_cool_down_came_behind_it(load_until_s, current_A):
    longer = extended(blocks(load_until_s), 7200.0)
    added = slice(-100, None)
    np.testing.assert_allclose(longer.inputs.current_squared[added], current_A**2, rtol=0.01)
    np.testing.assert_allclose(longer.inputs.losses[added], 0.04 * current_A**2, rtol=0.01)
    assert longer.duration_s == pytest.approx(7200.0, abs=40.0)
    assert longer.measured.size == longer.weight.shape[0] == longer.count.size


def test_a_test_that_only_cools_goes_on_cooling():
    longer = extended(blocks(0.0), 7200.0)
    assert np.all(np.asarray(longer.inputs.losses) == 0.0)
