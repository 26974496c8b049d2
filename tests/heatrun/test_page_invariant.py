"""What the page says, the page's numbers do; and the effects that the tests ask for are on it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from page_numbers import said_and_simulated

from heatrun.cli import main
from heatrun.readers.mat5 import read_variables

DATA = Path(__file__).parents[2] / "data" / "synthetic" / "hidden_cause"
WORDS = ["calibrate", str(DATA / "motor.toml"), str(DATA / "staircase.csv.gz"), "--model", "second",
         "--quick"]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    run = tmp_path_factory.mktemp("page") / "run"
    assert main([*WORDS, "--out", str(run)]) == 0
    return run


def test_the_numbers_simulated_have_the_error_of_the_page(folder):
    for said, simulated in said_and_simulated(folder):
        assert abs(simulated - said) <= 0.1 * said + 0.05


def test_the_effect_is_in_the_model_and_the_resistance_at_its_conditions(folder):
    fit = json.loads((folder / "fit.json").read_text())
    truth = json.loads((DATA / "truth.json").read_text())
    assert fit["effects"] == truth["hidden"] == ["speed_cooling"]
    page = fit["models"]["second"]
    rest, loaded = (page["derived"][f"Req_sr_{where}"] for where in ("at_rest", "loaded"))
    assert loaded["value"] < rest["value"]
    assert "rpm" in loaded["condition"]
    assert rest["condition"].startswith("0 rpm")
    low, high = rest["interval_95"]
    assert low < truth["Req_sr"] < high
    assert fit["use"]["use"] in ("usable", "restricted")
    assert "speed_cooling" in fit["use"]["sentence"]
    sheet = json.loads((folder / "sheet.json").read_text())
    rows = [row[0] for row in sheet["certificate"]["parameters"]]
    assert rows.index("Req_sr under load") < rows.index("Req_sr at rest") < rows.index("Req_sr")
    assert sheet["certificate"]["headline"] == fit["use"]["sentence"]


def test_four_numbers_alone_are_labelled_and_tell_their_error(folder):
    fit = json.loads((folder / "fit.json").read_text())
    page = fit["models"]["second"]
    replica = page["replica"]
    assert set(replica["parameters"]) == {"Ceq_w", "Ceq_sr", "Req_w", "Req_sr"}
    (row,) = page["residuals"]
    assert replica["rmse_K"][row["test"]] > row["rmse_K"]
    # between what the fan leaves at rest and what it leaves at speed
    at = page["derived"]
    low, high = (at[f"Req_sr_{where}"]["value"] for where in ("loaded", "at_rest"))
    assert 0.9 * low < replica["parameters"]["Req_sr"] < 1.1 * high
    sheet = json.loads((folder / "sheet.json").read_text())
    assert "Replica for tools that take four numbers, not a result" in sheet["replica"]
    (line,) = sheet["residuals"]["rows"]
    assert line[2] == f"{row['rmse_K']:.2f}"
    assert line[-1] == f"{replica['rmse_K'][row['test']]:.2f}"


def test_the_replica_is_exported_for_tools_that_take_four_numbers(folder, tmp_path, capsys):
    replica = json.loads((folder / "fit.json").read_text())["models"]["second"]["replica"]
    words = ["export", str(folder), "--to", "mat", "--json", "--out"]
    assert main([*words, str(tmp_path / "four"), "--replica"]) == 0
    said, told = capsys.readouterr()
    written = json.loads(said)
    assert "not a result" in told
    assert "speed_cooling" in told
    held = read_variables((tmp_path / "four" / "prova.mat").read_bytes())
    four = [float(held[name][0, 0]) for name in ("Ceqw", "Ceqsr", "Reqw", "Reqsr")]
    assert four == [replica["parameters"][n] for n in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")]
    assert written["effects"] == []
    # sample by sample here, over block means there
    assert written["rmse_reading_K"] == pytest.approx(replica["rmse_K"][written["test"]], rel=0.1)
    assert main([*words, str(tmp_path / "all")]) == 0
    assert (tmp_path / "all" / "network.mat").exists()


@pytest.mark.slow
def test_the_bare_network_says_what_it_costs(tmp_path, capsys):
    run = tmp_path / "run"
    assert main([*WORDS, "--plain", "--json", "--out", str(run)]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["effects"] == []
    assert said["use"]["use"] != "usable"
    (left,) = [each for each in said["findings"] if each["id"] == "effects_left_out"]
    assert "speed_cooling" in left["message"]
