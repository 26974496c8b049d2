"""The study of noise over fleets: its machines are what they were drawn from; a small one."""

import json

import numpy as np
import pytest
from fleet_noise import run, table
from fleet_noise_cases import IRON_SPREAD, NOISE, draw_noisy_fleet, smoothly, write_noisy_fleet
from study_runs import write_rows


def test_a_fleet_is_what_it_was_drawn_from():
    fleet = draw_noisy_fleet(3, 4000, has_effect=True)
    usual = ~fleet.is_other
    assert np.mean(fleet.is_other) == 0.05
    np.testing.assert_allclose(fleet.noise[usual].std(axis=0), fleet.noise_sd, rtol=0.05)
    np.testing.assert_allclose(fleet.noise[usual].mean(axis=0), fleet.noise_mean, atol=0.03)
    further = (fleet.noise - fleet.noise_mean) / fleet.noise_sd
    assert np.all(further[fleet.is_other].max(axis=1) > 1.0)
    assert np.log(fleet.iron_W).std() == pytest.approx(IRON_SPREAD, rel=0.05)
    plain = draw_noisy_fleet(3, 20, has_effect=False)
    assert plain.iron_median_W == 0.0
    assert np.all(plain.iron_W == 0.0)


def test_the_missed_heat_has_unit_variance_and_no_kinks():
    heat = smoothly(400, 1200, np.full(400, 300.0), np.random.default_rng(1))
    assert heat.std() == pytest.approx(1.0, rel=0.06)
    # a Gauss-Markov process of this time has steps of 0.3
    assert np.abs(np.diff(heat, axis=1)).max() < 0.03


def test_the_files_are_the_ones_that_a_bench_leaves(tmp_path):
    fleet = draw_noisy_fleet(5, 3, has_effect=True)
    write_noisy_fleet(fleet, tmp_path / "a", 5, minutes=10.0, places=range(1, 3))
    assert "iron_loss_in_winding" in (tmp_path / "a" / "motor.toml").read_text()
    assert sorted(each.name for each in (tmp_path / "a" / "tests").iterdir()) == [
        "M0001.csv", "M0002.csv",
    ]  # fmt: skip
    said = '[population]\nrun = "../type"\n'
    write_noisy_fleet(fleet, tmp_path / "b", 5, minutes=10.0, places=range(1, 3), motor=said)
    # its sisters name the effect, not its motor file; the readings are the same
    assert "iron_loss_in_winding" not in (tmp_path / "b" / "motor.toml").read_text()
    first, second = ((tmp_path / name / "tests" / "M0001.csv").read_text() for name in "ab")
    assert first == second


@pytest.mark.slow
def test_a_small_fleet_by_the_users_path(tmp_path, monkeypatch):
    monkeypatch.setattr("fleet_noise.NUM_NEXT", 4)
    monkeypatch.setattr("sys.argv", ["fleet_noise.py", "--seed", "700"])
    row = run({"seed": 700, "machines": 6, "workers": 1, "has_effect": True, "heat": 0.005})
    assert {each["of"] for each in row["type"]} == {"network", "noise", "effect"}
    assert len(row["machines_found"]) == 6
    assert len(row["machines_found"][0]["noise_inside"]) == len(NOISE)
    write_rows(tmp_path / "rows.json", [row], seed=700, planned=1)
    found = table([row], json.loads((tmp_path / "rows.json").read_text()))
    inside = sum(sum(each["noise_inside"]) for each in row["machines_found"])
    assert f"({inside} of 24)" in found
    assert "of unmodelled_heat, types with 0.5 % of heat" in found
    assert "(4 of 4 fitted)" in found
    # by its sisters a short test knows more
    sd = {how: np.mean([each["sd"] for each in row["next"][how]], axis=0)
          for how in ("alone", "sisters")}  # fmt: skip
    assert sd["sisters"][3] < 0.7 * sd["alone"][3]
