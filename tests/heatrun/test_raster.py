"""Means around the instants of a raster: no delay, energy conserved, gaps not bridged."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.record.raster import means_around, raster, require_increasing

FAST = np.arange(1001) * 0.1
AT = np.arange(101) * 1.0


def test_a_ramp_keeps_its_place():
    # The sample nearest to the left, or a mean over the interval that follows, would move it.
    inner = means_around(FAST + 0.03, 5.0 * (FAST + 0.03), AT)[1:-1]
    np.testing.assert_allclose(inner, 5.0 * AT[1:-1], atol=1e-9)


def test_energy_is_conserved():
    power = np.where((FAST > 20.25) & (FAST < 61.4), 800.0, 30.0)
    means = means_around(FAST, power, AT)
    weights = np.concatenate([[0.5], np.ones(AT.size - 2), [0.5]])
    # The half intervals at both ends hold the record's first and last half second.
    assert weights @ means == pytest.approx(np.trapezoid(power, FAST), rel=1e-12)


def test_the_square_of_a_current_is_averaged():
    current = np.where(np.arange(FAST.size) % 2 == 0, 100.0, 0.0)
    rms = means_around(FAST, current, AT, is_rms=True)
    np.testing.assert_allclose(rms, np.sqrt(5000.0), rtol=1e-12)
    np.testing.assert_allclose(means_around(FAST, current, AT), 50.0, rtol=1e-12)


def test_gaps_and_missing_samples_are_not_bridged():
    is_there = (FAST < 30.2) | (FAST > 45.1)
    values = np.full(FAST.size, 7.0)
    by_gap = means_around(FAST[is_there], values[is_there], AT)
    by_nan = means_around(FAST, np.where(is_there, values, np.nan), AT)
    assert np.array_equal(by_gap, by_nan, equal_nan=True)
    # 30 s has samples over 0.6 s of its interval, 31 s none, 45 s over 0.3 s
    assert np.flatnonzero(np.isnan(by_gap)).tolist() == list(range(31, 46))
    np.testing.assert_allclose(by_gap[~np.isnan(by_gap)], 7.0, rtol=1e-12)
    assert np.isnan(means_around(FAST[:1], values[:1], AT)).all()


def test_a_raster_spans_the_times():
    assert raster(FAST, 30.0).tolist() == [0.0, 30.0, 60.0, 90.0]
    assert raster(FAST, 0.1).size == FAST.size


@pytest.mark.parametrize(
    ("times", "problem"),
    [([0.0, np.nan, 2.0], "sample 2 has none"), ([0.0, 1.0, 1.0], "after 1 s comes 1 s")],
)
def test_times_must_increase(times, problem):
    with pytest.raises(InputError, match=problem):
        require_increasing(np.array(times), "run.mf4")
