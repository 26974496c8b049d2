"""A machine that a plant logs every half hour for days: the steps follow the record's length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce

TRUTH = {"Ceq_w": 60e3, "Ceq_sr": 2.4e6, "Req_w": 0.01, "Req_sr": 0.006}
PERIOD_S, DAYS = 1800.0, 5
LOSSES_W, OHM = (400.0, 1500.0), 0.02


def logged(seed):
    """Load in straight lines between samples, a constant resistance; exact at samples."""
    rng = np.random.default_rng(seed)
    time_s = PERIOD_S * np.arange(DAYS * 48)
    current = np.repeat(rng.choice([0.0, 120.0, 200.0, 260.0], time_s.size // 6 + 1), 6)
    current = np.abs(current[: time_s.size] + 5.0 * rng.standard_normal(time_s.size))
    other = np.where(current > 50.0, LOSSES_W[1], LOSSES_W[0])
    copper = 3.0 * OHM * current**2
    C_w, C_s, R_w, R_s = TRUTH.values()
    A = np.zeros((6, 6))  # winding, stator over ambient; two heats and their slopes
    A[0, :2] = [-1.0 / (C_w * R_w), 1.0 / (C_w * R_w)]
    A[1, :2] = [1.0 / (C_s * R_w), -1.0 / (C_s * R_w) - 1.0 / (C_s * R_s)]
    A[0, 2], A[1, 3], A[2, 4], A[3, 5] = 1.0 / C_w, 1.0 / C_s, 1.0, 1.0
    step = expm(A * PERIOD_S)
    state, rise = np.zeros(2), np.zeros(time_s.size)
    for i in range(1, time_s.size):
        heat = np.array([copper[i - 1], other[i - 1]])
        slope = (np.array([copper[i], other[i]]) - heat) / PERIOD_S
        state = (step @ np.concatenate([state, heat, slope]))[:2]
        rise[i] = state[0]
    channels = {
        "time_s": time_s, "phase_current_A": np.sqrt(copper / (3.0 * OHM)),
        "losses_W": copper + other, "ambient_degC": np.full(time_s.size, 25.0),
        "winding_degC": np.round(25.0 + rise + 0.1 * rng.standard_normal(time_s.size), 1),
    }  # fmt: skip
    return Record("plant", channels)


# a coefficient so large that the resistance does not change, as in the simulation
MOTOR = Motor("m", phase_resistance_ohm=OHM, resistance_coefficient_degC=1e9)


def test_days_have_no_more_steps_than_half_a_day_and_shorter_records_have_short_ones():
    days = reduce(logged(3), MOTOR)
    assert 7_000 < days.inputs.num_time < 9_000
    first = replace(logged(3), channels={k: v[:20] for k, v in logged(3).channels.items()})
    assert float(reduce(first, MOTOR).inputs.step) == 5.0


@pytest.mark.slow
def test_half_hours_over_days_are_fitted():
    found = fit(Problem.of(Model.of("second", MOTOR), MOTOR, [reduce(logged(3), MOTOR)]))
    sd = np.sqrt(np.diag(found.covariance))
    for name, true in TRUTH.items():
        place = found.problem.parameters.index(name)
        off = found.z[place] - found.slots[place].parameter.score(true)
        assert abs(off) < 3.0 * sd[place], name
    assert sd[found.problem.parameters.index("Req_sr")] < 0.1
