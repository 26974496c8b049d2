"""A calibrated run as the prior of a machine's cooling."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.linalg import expm

from heatrun import cli
from heatrun.motor.file import load_motor
from heatrun.shutdown.of_run import _modal, modes_of_run
from heatrun.shutdown.readings import read_readings

AIR = 20.0
HOT = np.array([104.0, 68.0])  # winding and stator over the air [K]


def state_matrix(truth):
    w, s, inner, outer = (truth[name] for name in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"))
    return np.array([[-1 / (w * inner), 1 / (w * inner)],
                     [1 / (s * inner), -1 / (s * inner) - 1 / (s * outer)]])  # fmt: skip


def write(folder, truth, first_s):
    """The reference motor's winding between two terminals, after switch-off."""
    A, time_s = state_matrix(truth), np.arange(first_s, first_s + 300.0, 15.0)
    winding = AIR + np.array([(expm(A * t) @ HOT)[0] for t in time_s])
    scatter = np.random.default_rng(4).normal(1.0, 1e-4, time_s.size)
    ohm = 0.0124 * (234.5 + winding) / (234.5 + 25.0) * scatter
    lines = [f"{t:.0f},{1e3 * R:.6f}" for t, R in zip(time_s, ohm, strict=True)]
    (folder / "readings.csv").write_text("\n".join(["time_s,R [mOhm]", *lines]), encoding="utf-8")
    text = (folder / "motor.toml").read_text(encoding="utf-8")
    if "[shutdown]" not in text:
        text = text.replace(
            "phase_resistance_ohm", "measured_resistance_ohm = 0.0124\nphase_resistance_ohm"
        )
        text += f"[constants]\nambient_degC = {AIR}\n[shutdown]\nrun_down_s = 0\n"
        text += (
            "cold_resistance_sd = 0.0005\ncold_temperature_sd_K = 0.1\ncoefficient_sd_degC = 0.2\n"
        )
        (folder / "motor.toml").write_text(text, encoding="utf-8")


def test_modes_of_two_nodes(truth):
    A = state_matrix(truth)[None]
    heat = np.array([[[1.0 / truth["Ceq_w"], 0.0], [0.0, 1.0 / truth["Ceq_sr"]]]])
    tau, shares, place = _modal(A, heat)
    np.testing.assert_allclose(np.sort(-1.0 / np.linalg.eigvals(A[0]).real), tau[0])
    assert place == 0
    # a second later, by the matrix exponential and by the modes
    for loss in (0, 1):
        steady = np.linalg.solve(A[0], -heat[0, loss])
        later = (expm(100.0 * A[0]) @ steady)[0] / steady[0]
        assert np.sum(shares[0, loss] * np.exp(-100.0 / tau[0])) == pytest.approx(later)


def test_a_run_brings_its_time_constants_along(day, truth, capsys):
    write(day, truth, 120.0)
    words = ["shutdown", "motor.toml", "readings.csv", "--json"]
    assert cli.main([*words, "--within", "50"]) == 0
    alone = json.loads(capsys.readouterr().out)
    assert cli.main([*words, "--run", "run", "--model", "second"]) == 0
    with_run = json.loads(capsys.readouterr().out)
    low, high = with_run["winding_95_degC"]
    assert low < AIR + HOT[0] < high
    # the readings alone leave the fast mode open
    assert with_run["extrapolation_95_K"] < 0.7 * alone["extrapolation_95_K"]
    assert "network second" in with_run["prior"]


def test_the_prior_is_that_of_the_draws(day, truth):
    write(day, truth, 30.0)
    motor = load_motor(day / "motor.toml")
    modes = modes_of_run(day / "run", read_readings(day / "readings.csv", motor), "second")
    expected = np.sort(-1.0 / np.linalg.eigvals(state_matrix(truth)).real)
    # an hour of duty at 1 Hz, quickly sampled, and 5 % beside it
    np.testing.assert_allclose(np.exp(modes.log_times), expected, rtol=0.1)
    z = np.random.default_rng(0).standard_normal((4000, len(modes.of_times)))
    tau = modes.times(z)
    assert np.all(np.diff(tau[:, :2], axis=1) > 0.0)
    assert np.std(np.log(tau[:, 1])) == pytest.approx(np.linalg.norm(modes.factor[0]), rel=0.1)
