"""`heatrun discover` as its user meets it, on the bundled records with a hidden cause."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from heatrun.cli import main
from heatrun.posterior.posterior import normal_draws
from lptn import EFFECTS

IDS = {kind.card.id for kind in EFFECTS}

DATA = Path(__file__).parents[2] / "data" / "synthetic" / "hidden_cause"

MINE = Path(__file__).with_name("cabinet_heater.py")


def quick_draws(fit, *, method, seed, **_):
    """Stand in for the samples, half a minute of them, which tests of `show` draw."""
    assert method == "quick"
    return normal_draws(fit, seed=seed)


def test_the_command_names_what_is_hidden_and_writes_its_folder(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("heatrun.calibration.sample", quick_draws)
    monkeypatch.setattr("heatrun.jobs.discover.weighted_draws", normal_draws)
    run = tmp_path / "run"
    code = main([
        "discover", str(DATA / "motor.toml"), str(DATA / "staircase.csv.gz"),
        "--holdout", str(DATA / "other_staircase.csv.gz"),
        "--effects", str(MINE), "--quick", "--json", "--out", str(run),
    ])  # fmt: skip
    said = json.loads(capsys.readouterr().out)
    assert code == 0
    truth = json.loads((DATA / "truth.json").read_text())
    assert said["verdict"] == "named"
    assert [effect["id"] for effect in said["effects"]] == truth["hidden"]
    low, high = said["effects"][0]["parameters"]["g"]["interval_95"]
    assert low < 1.5 * truth["amplitudes"]["speed_cooling"] < high + 0.1  # laws differ in form
    assert said["holdout"]["rmse_after_K"] < 0.3 * said["holdout"]["rmse_before_K"]
    assert said["parameters"]["Req_sr"]["after"]["value"] == pytest.approx(
        truth["Req_sr"], rel=0.05
    )
    stored = json.loads((run / "discovery.json").read_text())
    assert stored["verdict"] == said["verdict"]
    assert {row["id"] for row in stored["candidates"]} == {*IDS, "cabinet_heater"}
    for row in stored["candidates"]:
        assert row["reason"] or row["status"] == "accepted"
    (effect,) = stored["effects"]
    assert effect["parameters"]["g"]["unit"] == "1"
    assert low < effect["parameters"]["g"]["value"] < high
    assert effect["evidence"]["familywise_p"] < 0.05
    assert stored["holdout"]["coverage_95_after"] > 0.85
    assert set(stored["parameters"]) == {"Ceq_w", "Ceq_sr", "Req_w", "Req_sr", "Rs0"}
    assert stored["where"][0]["node"] in ("stator", "winding", "sensor")
    for name in ("discovery.pdf", "sheet.pdf", "fit.json", "posterior_second.nc", "manifest.json"):
        assert (run / name).stat().st_size > 0
    assert not run.with_name("run.partial").exists()
    # what was found can be used: the same model, the same number, everywhere
    held_out = str(DATA / "other_staircase.csv.gz")
    words = ["simulate", str(DATA / "motor.toml"), str(run), held_out, "--out", str(tmp_path)]
    assert main([*words, "--json"]) == 0
    (simulated,) = json.loads(capsys.readouterr().out)["simulated"]
    assert simulated["effects"] == truth["hidden"]
    assert simulated["rmse_K"] == pytest.approx(said["holdout"]["rmse_after_K"], rel=1e-6)
    for kind in ("thermal", "virtual"):
        words = ["report", "--type", kind, "--run", str(run), str(DATA / "motor.toml"), held_out]
        assert main([*words, "--json", "--out", str(tmp_path / "reports")]) == 0
        report = capsys.readouterr().out
        if kind == "thermal":
            row = report.split('"rmse_K"')[1]
            found = float(row.split('"value": ')[1].split(",")[0])
            assert found == pytest.approx(simulated["rmse_K"], rel=1e-9)
    assert main(["sheet", str(run), "--out", str(tmp_path / "sheet")]) == 0
    assert "speed_cooling" in (tmp_path / "sheet" / "sheet.json").read_text()
    assert main(["export", str(run), "--to", "mat", "--out", str(tmp_path / "matlab")]) == 0
    assert (tmp_path / "matlab" / "network.mat").stat().st_size > 0


def test_a_file_of_effects_that_is_not_there_is_an_error(tmp_path, capsys):
    code = main([
        "discover", str(DATA / "motor.toml"), str(DATA / "staircase.csv.gz"),
        "--effects", str(tmp_path / "nowhere.py"), "--out", str(tmp_path / "run"),
    ])  # fmt: skip
    assert code == 1
    assert "--effects" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
