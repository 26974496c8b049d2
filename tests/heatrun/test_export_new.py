"""Any test to prova.mat, with the parameters of a file, and from prova.mat back to a simulation.

What needs a run stands in `test_export_run.py`, which calibrates one.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from octave import needs_octave
from test_export_octave import run_octave

from heatrun import cli
from heatrun.errors import InputError
from heatrun.export import export_test, mat_bytes
from heatrun.motor.file import load_motor
from heatrun.readers.mat5 import read_variables
from heatrun.readers.read import read_record
from heatrun.simulation import read_parameters

DATA = Path(__file__).parents[2] / "data" / "synthetic"
PARAMETERS = "Ceq_w = 666.75\nCeq_sr = 15060.1\nReq_w = 0.14485\nReq_sr = 0.11625\n"


@pytest.fixture
def bench_day(tmp_path, monkeypatch):
    """The working directory with a motor file, a file of parameters and a test at 2 Hz."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(DATA / "motor.toml", "motor.toml")
    Path("thesis.toml").write_text(PARAMETERS)
    pd.read_csv(DATA / "step_30min.csv.gz").iloc[::5].to_csv("step.csv", index=False)
    return tmp_path


def export(*words):
    return cli.main(["export", *words, "--to", "mat"])


def rows_at_level_load(virtual):
    """Return the rows in whose 2 s the load does not jump: in the others the virtual record has
    the mean of the temperatures at both ends, which is not the mean over the row."""
    return np.abs(np.diff(virtual["phase_current_A"], prepend=0.0)) < 10.0


def row_means(time, T, middle):
    """Return the means over rows of 2 s of a course of straight lines [degC]."""
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (T[1:] + T[:-1]) * np.diff(time))])
    edges = np.append(middle - 1.0, np.max(middle) + 1.0)
    return np.diff(np.interp(edges, time, integral)) / 2.0


@needs_octave
def test_octave_says_of_a_new_test_what_simulate_says(bench_day, capsys):
    assert export("thesis.toml", "step.csv", "--motor", "motor.toml", "--out", "mat") == 0
    assert cli.main(["simulate", "motor.toml", "thesis.toml", "step.csv"]) == 0
    variables = read_variables(Path("mat/prova.mat").read_bytes())
    (bench_day / "octave").mkdir()
    course, _, _ = run_octave(bench_day / "octave", variables)
    virtual = pd.read_csv("step_virtual.csv")
    means = row_means(*course[["time_s", "winding_degC"]].to_numpy().T, virtual["time_s"])
    apart = np.abs(means - virtual["winding_degC"])
    is_level = rows_at_level_load(virtual)
    with capsys.disabled():
        print(f"\nOctave and heatrun simulate differ by at most {np.max(apart[is_level]):.1e} K")
    assert np.mean(is_level) > 0.99
    assert np.max(apart[is_level]) < 0.01
    assert np.max(np.abs(course["winding_degC"] - 20.0)) > 50.0  # it is a heat run


def test_the_parameters_come_back_from_the_file(bench_day):
    assert export("thesis.toml", "step.csv", "--motor", "motor.toml", "--out", "mat") == 0
    given = read_parameters(Path("mat/prova.mat"), None, load_motor("motor.toml"))
    assert given.form.name == "second"
    assert given.values == pytest.approx(
        {"Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625, "Rs0": 0.0062},
        rel=1e-14,
    )
    words = ["simulate", "motor.toml"]
    assert cli.main([*words, "thesis.toml", "step.csv", "--out", "toml"]) == 0
    assert cli.main([*words, "mat/prova.mat", "step.csv", "--out", "mat"]) == 0
    one, two = (pd.read_csv(f"{folder}/step_virtual.csv") for folder in ("toml", "mat"))
    pd.testing.assert_frame_equal(one, two, rtol=0.0, atol=2e-4)  # six digits are written


def test_only_the_test_of_the_file_starts_as_the_file_says(bench_day):
    assert export("thesis.toml", "step.csv", "--motor", "motor.toml", "--out", "mat") == 0
    variables = read_variables(Path("mat/prova.mat").read_bytes())
    variables |= {"Two": np.array([[31.0]]), "Tso": np.array([[29.0]])}
    Path("warm.mat").write_bytes(mat_bytes(variables))
    table = pd.read_csv("step.csv")
    table.assign(Tw_m=table["Tw_m"] + 0.5).to_csv("other.csv", index=False)
    words = ["simulate", "motor.toml", "warm.mat", "warm.mat", "step.csv", "other.csv"]
    assert cli.main(words) == 0
    start = {name: pd.read_csv(f"{name}_virtual.csv").iloc[0] for name in ("warm", "step", "other")}
    for own in ("warm", "step"):
        assert start[own]["winding_degC"] == pytest.approx(31.0, abs=0.1)
        assert start[own]["stator_degC"] == pytest.approx(29.0, abs=0.1)
    assert start["other"]["winding_degC"] == pytest.approx(table["Tw_m"][0] + 0.5, abs=1.0)


def test_the_winding_of_the_file_counts_and_is_said(bench_day, capsys):
    assert export("thesis.toml", "step.csv", "--motor", "motor.toml", "--out", "mat") == 0
    variables = read_variables(Path("mat/prova.mat").read_bytes())
    variables |= {"Rrif": np.array([[0.03]]), "B": np.array([[225.0]])}
    Path("aluminium.mat").write_bytes(mat_bytes(variables))
    capsys.readouterr()
    assert cli.main(["simulate", "motor.toml", "aluminium.mat", "step.csv"]) == 0
    said = capsys.readouterr().err
    assert "phase_resistance_ohm = 0.01 as the file of parameters has it" in said
    assert "resistance_coefficient_degC = 225" in said
    virtual = pd.read_csv("step_virtual.csv")
    loss = 0.03 * virtual["phase_current_A"] ** 2 * (225.0 + virtual["winding_degC"]) / 250.0
    is_level = rows_at_level_load(virtual)
    np.testing.assert_allclose(virtual["copper_loss_W"][is_level], loss[is_level], rtol=1e-4)


def test_the_first_order_keeps_the_names_of_the_thesis(bench_day):
    Path("first.toml").write_text("Ceq = 12500.0\nReq = 0.132\n")
    words = ["first.toml", "step.csv", "--motor", "motor.toml", "--model", "first", "--out", "mat"]
    assert export(*words) == 0
    given = read_parameters(Path("mat/prova.mat"), None, load_motor("motor.toml"))
    assert given.form.name == "first"
    assert given.values["Ceq"] == 12500.0
    with pytest.raises(InputError, match="parameters of the first order, asked for is second"):
        read_parameters(Path("mat/prova.mat"), "second", load_motor("motor.toml"))


def test_a_file_without_parameters_is_refused(bench_day):
    Path("signals.mat").write_bytes(mat_bytes({"t": np.arange(9.0)[:, None]}))
    with pytest.raises(InputError, match="Ceqw, Reqw missing; expected the variables of a prova"):
        read_parameters(Path("signals.mat"), None, load_motor("motor.toml"))


def test_a_test_without_a_winding_is_exported_as_simulate_takes_it(bench_day, capsys):
    pd.read_csv("step.csv").drop(columns="Tw_m").to_csv("bare.csv", index=False)
    assert export("thesis.toml", "bare.csv", "--motor", "motor.toml", "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["rmse_K"] is None
    variables = read_variables(Path("bare_mat/prova.mat").read_bytes())
    assert np.all(np.isnan(variables["Tw_m"]))
    # a machine without a reading starts soaked at the sink, which is read to 0.5 K
    assert variables["Two"].item() == pytest.approx(variables["Te"][0, 0], abs=0.25)


def test_a_missing_channel_is_said_as_simulate_says_it(bench_day, capsys):
    pd.read_csv("step.csv").drop(columns="Pd").to_csv("bare.csv", index=False)
    assert export("thesis.toml", "bare.csv", "--motor", "motor.toml") == 1
    of_export = capsys.readouterr().err
    assert cli.main(["simulate", "motor.toml", "thesis.toml", "bare.csv"]) == 1
    assert of_export == capsys.readouterr().err
    assert "losses_W" in of_export


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["thesis.toml", "step.csv"], "pass --motor MOTOR.toml"),
        (["thesis.toml"], "holds no test: name a bench file"),
        (["thesis.toml", "step.csv", "--test", "step"], "either bench files or --test"),
    ],
)
def test_wrong_use_is_told_from_a_wrong_file(bench_day, capsys, words, said):
    assert export(*words) == 2
    assert said in capsys.readouterr().err


def test_a_second_export_never_replaces_a_first_in_silence(bench_day, capsys):
    table = pd.read_csv("step.csv")
    words = ["thesis.toml", "step.csv", "--motor", "motor.toml"]
    assert export(*words) == 0
    assert export(*words) == 0  # the same again is the same place
    first = Path("step_mat/prova.mat").read_bytes()
    assert not Path("step_mat-2").exists()
    table.iloc[:900].to_csv("step.csv", index=False)
    assert export(*words) == 0
    assert Path("step_mat/prova.mat").read_bytes() == first
    second = Path("step_mat-2/prova.mat").read_bytes()
    assert second != first
    capsys.readouterr()
    assert export(*words, "--out", "step_mat") == 1
    assert "--force" in capsys.readouterr().err
    assert Path("step_mat/prova.mat").read_bytes() == first
    assert export(*words, "--out", "step_mat", "--force") == 0
    assert Path("step_mat/prova.mat").read_bytes() == second


def test_several_tests_go_to_folders_of_their_own(bench_day, capsys):
    shutil.copy("step.csv", "again.csv")
    words = ["thesis.toml", "step.csv", "again.csv", "--motor", "motor.toml", "--out", "all"]
    assert export(*words, "--json") == 0
    assert [one["test"] for one in json.loads(capsys.readouterr().out)["exports"]] == [
        "step",
        "again",
    ]
    assert sorted(path.parent.name for path in Path("all").rglob("prova.mat")) == [
        "again_mat",
        "step_mat",
    ]


def test_a_second_simulation_never_replaces_a_first_in_silence(bench_day, capsys):
    words = ["simulate", "motor.toml", "thesis.toml", "step.csv"]
    assert cli.main(words) == 0
    assert cli.main(words) == 0  # the same again is the same file
    first = Path("step_virtual.csv").read_bytes()
    assert not Path("step_virtual-2.csv").exists()
    Path("thesis.toml").write_text(PARAMETERS.replace("666", "766"))
    capsys.readouterr()
    assert cli.main(words) == 0
    assert "step_virtual-2.csv" in capsys.readouterr().out
    assert Path("step_virtual.csv").read_bytes() == first
    assert cli.main([*words, "--out", "."]) == 1
    assert "--force" in capsys.readouterr().err
    assert Path("step_virtual.csv").read_bytes() == first
    assert cli.main([*words, "--out", ".", "--force"]) == 0
    assert Path("step_virtual.csv").read_bytes() == Path("step_virtual-2.csv").read_bytes()


def test_a_loss_map_is_no_pd(bench_day):
    motor = Path("motor.toml")
    motor.write_text(motor.read_text().replace('losses = "balance"', 'losses = "map"'))
    machine = load_motor("motor.toml")
    assert machine.losses == "map"
    written = export_test(Path("thesis.toml"), Path("step.csv"), motor=machine, folder=Path("out"))
    assert Path(written["files"][0]).name == "network.mat"
    record = read_record("step.csv", machine)
    pol = read_variables(Path("out/network.mat").read_bytes())["Pol"]
    assert np.array_equal(pol[:, 0], record["losses_W"])


def test_a_given_start_and_a_constant_of_the_motor_file_hold(bench_day):
    """Both were ignored without a word."""
    with Path("thesis.toml").open("a") as file:
        file.write("Tw_start = 40.0\nTsr_start = 35.0\n")
    pd.read_csv("step.csv").drop(columns="Te").to_csv("bare.csv", index=False)
    with Path("motor.toml").open("a") as file:
        file.write("\n[constants]\nambient_degC = 12.5\n")
    assert cli.main(["simulate", "motor.toml", "thesis.toml", "bare.csv"]) == 0
    first = pd.read_csv("bare_virtual.csv").iloc[0]
    assert first["ambient_degC"] == 12.5
    assert first["winding_degC"] == pytest.approx(40.0, abs=0.1)
    assert first["stator_degC"] == pytest.approx(35.0, abs=0.1)
