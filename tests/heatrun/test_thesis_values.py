"""The first-order values that the thesis prints, beside its second order."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.simulation import simulate_values

THESIS = Path(__file__).parents[2] / "data" / "thesis"
MOTOR = Motor("IPM-SynRel 2022", phase_resistance_ohm=0.0062)
CURRENT_A, LOSSES_W, AMBIENT_DEGC = 74.2, 521.0, 19.3577
"""The working point of the worksheet, which the first test is held at."""


@pytest.fixture(scope="module")
def constants():
    return tomllib.loads((THESIS / "constants.toml").read_text("utf-8"))


@pytest.fixture(scope="module")
def held() -> Record:
    time_s = np.arange(0.0, 5401.0, 1.0)
    return Record(
        "held",
        {
            "time_s": time_s,
            "phase_current_A": np.full(time_s.size, CURRENT_A),
            "losses_W": np.full(time_s.size, LOSSES_W),
            "ambient_degC": np.full(time_s.size, AMBIENT_DEGC),
        },
    )


def second_order(constants, seconds: list[float]) -> np.ndarray:
    """The winding of the printed second order, by scipy."""
    p = constants["second_order"]

    def rates(_, T):
        joule = 3.0 * CURRENT_A**2 * 0.0062 * (234.5 + T[0]) / (234.5 + 25.0)
        down = (T[0] - T[1]) / p["Req_w"]
        rest = LOSSES_W - joule + down - (T[1] - AMBIENT_DEGC) / p["Req_sr"]
        return [(joule - down) / p["Ceq_w"], rest / p["Ceq_sr"]]

    start = [AMBIENT_DEGC, AMBIENT_DEGC]
    return solve_ivp(rates, (0.0, 5400.0), start, t_eval=seconds, rtol=1e-9, atol=1e-9).y[0]


def test_the_printed_first_order_is_five_kelvin_low_after_a_minute(constants, held):
    seconds = [60.0, 300.0, 5399.0]
    second = second_order(constants, seconds)
    one = constants["first_order"]
    tau_s = one["Ceq"] * one["Req"]
    first = AMBIENT_DEGC + LOSSES_W * one["Req"] * (1.0 - np.exp(-np.array(seconds) / tau_s))
    # as data/thesis/README.md says
    assert first - second == pytest.approx([-4.8, -9.4, -9.8], abs=0.05)
    made = simulate_values(MOTOR, one, held, "first")
    # rows are means over steps of 2 s: the curvature in them is far below 0.05 K
    ours = np.interp(seconds, made["time_s"], made["winding_degC"])
    assert ours == pytest.approx(first, abs=0.05)
