"""A network from a TOML file in `check`, `compare` and `discover`, and what forbids one."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

import heatrun
from heatrun import cli
from heatrun.effects.engine import library
from heatrun.errors import InputError, UsageError
from heatrun.model.catalogue import effects_named
from heatrun.model.model import Model
from heatrun.model.network_text import network_named, pair_of
from lptn import EFFECTS

FOUR = Path(__file__).with_name("four.toml").read_text("utf-8")
PLAIN = """[motor]
name = "bench"
[winding]
phase_resistance_ohm = 0.0062
"""
COOLED = PLAIN + '[model]\neffects = ["speed_cooling"]\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory, bench, generator):
    """A bench folder with two short tests, one of them without a speed."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "motor.toml").write_text(PLAIN)
    (folder / "cooled.toml").write_text(COOLED)
    (folder / "four.toml").write_text(FOUR)
    (folder / "known.toml").write_text(Path(__file__).with_name("four_known.toml").read_text())
    (folder / "coolant.toml").write_text(
        FOUR.replace("[network]\n", '[network]\nsinks = ["coolant"]\n').replace(
            '"ambient"', '"coolant"'
        )
    )
    duty = pd.DataFrame(bench(generator.duty(1800.0), seed=40).channels)
    duty.to_csv(folder / "duty.csv", index=False)
    step = pd.DataFrame(bench(generator.constant_load(900.0), seed=41).channels)
    step.to_csv(folder / "step.csv", index=False)
    duty.drop(columns="speed_rpm").to_csv(folder / "no_speed.csv", index=False)
    return folder


@pytest.fixture
def call(folder, capsys, monkeypatch):
    """Run a command with `--json` in the folder; return its exit code, object and messages."""
    monkeypatch.chdir(folder)

    def run(*words):
        capsys.readouterr()
        code = cli.main([*words, "--json"])
        said = capsys.readouterr()
        return code, json.loads(said.out), said.err

    return run


def test_check_takes_a_network_and_known_effects(call):
    code, found, _ = call(
        "check", "motor.toml", "duty.csv", "--model", "four.toml", "--with", "speed_cooling"
    )
    assert code == 0
    assert "error" not in {finding["severity"] for finding in found["findings"]}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["cooled.toml", "no_speed.csv"], "speed_cooling needs the channel speed_rpm"),
        (["motor.toml", "no_speed.csv", "--with", "speed_cooling"], "the channel speed_rpm"),
        (["motor.toml", "duty.csv", "--model", "four.toml", "--with", "winding_node"],
         "winding_node cannot be added to a network"),
    ],
)  # fmt: skip
def test_check_says_what_the_model_lacks(call, words, said):
    code, found, _ = call("check", *words)
    assert code == 1
    (refusal,) = [f for f in found["findings"] if f["severity"] == "error"]
    assert refusal["id"] == "model_refused"
    assert said in refusal["message"]
    assert refusal["remedy"]


def test_check_names_a_network_file_that_is_not_there(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    assert cli.main(["check", "motor.toml", "duty.csv", "--model", "five.toml"]) == 1
    assert "five.toml" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["calibrate", "compare", "discover"])
def test_an_effect_without_its_channel_is_refused_before_a_fit(
    command, folder, capsys, monkeypatch
):
    monkeypatch.chdir(folder)
    words = [command, "cooled.toml", "duty.csv", "--holdout", "no_speed.csv", "--out", "refused"]
    assert cli.main(words) == 1
    said = capsys.readouterr().err
    assert "no_speed: the effect speed_cooling needs the channel speed_rpm" in said
    assert not (folder / "refused").exists()


def test_simulation_of_an_effect_without_its_channel_is_refused(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "values.toml").write_text(
        "Ceq_w = 666.75\nCeq_sr = 15060.1\nReq_w = 0.14485\nReq_sr = 0.11625\n"
    )
    assert cli.main(["simulate", "cooled.toml", "values.toml", "no_speed.csv"]) == 1
    assert "needs the channel speed_rpm" in capsys.readouterr().err


def test_a_network_cooled_by_a_liquid_needs_a_motor_file_that_says_so(folder, tmp_path):
    with pytest.raises(InputError, match="the sink of the network is the coolant"):
        Model.of(str(folder / "coolant.toml"), heatrun.load_motor(folder / "motor.toml"))
    (tmp_path / "motor.toml").write_text(PLAIN.replace("[motor]\n", '[motor]\nsink = "coolant"\n'))
    motor = heatrun.load_motor(tmp_path / "motor.toml")
    assert Model.of(str(folder / "coolant.toml"), motor).form.sink == "coolant"
    assert Model.of("second", motor).name == "second"  # the built-in ones take either sink


def test_an_effect_that_would_add_a_node_again_is_not_searched(folder, blocks, motor):
    network = Model.of(str(folder / "four.toml"), motor).topology()
    found = library(EFFECTS, network, [blocks])
    assert found.unavailable["rotor_node"] == "adds a node that this network already has"
    assert "housing_node" in {kind.card.id for kind in found.kinds}
    twice = Model.of(str(folder / "four.toml"), motor, effects_named(["rotor_node"]))
    with pytest.raises(InputError, match="already has a node 'rotor'"):
        twice.refuse_unusable([blocks])


def test_which_two_networks_are_compared(folder):
    four = str(folder / "four.toml")
    assert [form.name for form in pair_of("both")] == ["first", "second"]
    assert [form.name for form in pair_of(four)] == ["second", "four"]
    assert [form.name for form in pair_of("second")] == ["first", "second"]
    assert [form.name for form in pair_of(f"{four},first")] == ["first", "four"]
    assert network_named("second") in pair_of("first")
    with pytest.raises(UsageError, match="names 3"):
        pair_of(f"first,second,{four}")
    with pytest.raises(UsageError, match="names no network"):
        pair_of(" , ")


@pytest.mark.slow
def test_compare_takes_two_networks(call, folder):
    words = ["compare", "motor.toml", "duty.csv", "--model", "known.toml,first", "--quick"]
    code, found, _ = call(*words)
    assert code == 0
    # the winding runs tens of kelvin ahead of the iron, which one node cannot follow
    assert found["verdict"]["order"] == "four"
    factor = found["verdict"]["log_bayes_factor"]
    assert factor > 100.0
    assert f"of four to first: {factor:+.0f}" in found["verdict"]["sentence"]
    errors = found["comparison"]["words"][0]
    assert errors.index("first order: RMSE") < errors.index("network four: RMSE")
    assert not list(folder.glob("results"))


@pytest.mark.slow
def test_compare_sets_a_network_against_the_second_order(call, folder):
    code, found, _ = call(
        "compare", "motor.toml", "duty.csv", "--holdout", "step.csv", "--model", "four.toml",
        "--quick",
    )  # fmt: skip
    assert code == 0
    assert "four to second" in found["verdict"]["sentence"]
    rows = [line for line in found["comparison"]["words"] if line.startswith("step (holdout)")]
    assert len(rows) == 1
    assert "second order: RMSE" in rows[0]
    assert "network four: RMSE" in rows[0]
    assert not list(folder.glob("results"))


@pytest.mark.slow
def test_discover_starts_from_a_network_of_ones_own(call, folder):
    code, found, _ = call(
        "discover", "motor.toml", "duty.csv", "--holdout", "step.csv", "--model", "known.toml",
        "--quick", "--out", "found",
    )  # fmt: skip
    assert code == 0
    assert found["verdict"] in ("adequate", "not_identifiable")  # nothing is hidden
    assert found["effects"] == []
    run = heatrun.open_run(folder / "found")
    assert run.model().model.form.nodes == ("winding", "tooth", "yoke", "rotor")
    rmse = run.predict("step.csv").rmse_K
    assert rmse == pytest.approx(found["holdout"]["rmse_after_K"], rel=1e-6)
    assert rmse < 1.0  # the sensor's noise and rounding are some tenths
