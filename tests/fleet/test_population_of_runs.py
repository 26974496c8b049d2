"""From run folders to a type, and from the type to the priors of the next machine."""

import json
from pathlib import Path

import numpy as np
import pytest
import run_near_truth as stored

import heatrun
from heatrun import cli
from heatrun.errors import InputError
from heatrun.motor.file import parse_motor
from heatrun.record.motor import Motor
from heatrun.record.record import Record

NAMES = ["Ceq_w", "Ceq_sr", "Req_w", "Req_sr"]
SPREAD = 0.04
NUM = 12


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Runs of twelve machines that spread by 4 %, the last one with a winding that sits loose."""
    folder = tmp_path_factory.mktemp("fleet")
    rng = np.random.default_rng(5)
    time_s = np.arange(0.0, 600.0, 2.0)
    record = Record("duty", {
        "time_s": time_s, "phase_current_A": np.full(300, 100.0),
        "losses_W": np.full(300, 400.0), "ambient_degC": np.full(300, 20.0),
        "winding_degC": 20.0 + 40.0 * -np.expm1(-time_s / 300.0),
    })  # fmt: skip
    motor = Motor("reference", phase_resistance_ohm=0.0062)
    paths = []
    with pytest.MonkeyPatch.context() as patch:
        for number in range(NUM):
            factor = np.exp(SPREAD * rng.standard_normal(5))
            factor[2] *= 1.6 if number == NUM - 1 else 1.0
            truth = dict(zip(stored.TRUTH, factor * list(stored.TRUTH.values()), strict=True))
            patch.setattr(stored, "TRUTH", truth)
            paths.append(stored.run_near_truth(folder / f"machine_{number:02d}", motor, record))
            patch.undo()
    return paths


@pytest.fixture(scope="module")
def known(runs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("type")
    return heatrun.population(runs, type_name="reference", out=folder), folder


def test_the_type_in_a_table(known):
    table = known[0].summary().set_index("parameter")
    assert list(table.index) == NAMES
    for name in NAMES:
        row = table.loc[name]
        assert row.low_95 < stored.TRUTH[name] * 1.05
        assert row.high_95 > stored.TRUTH[name] * 0.95
        assert row.spread_low_95 < SPREAD < row.spread_high_95
        assert row.tolerance_low < row.low_95 < row.high_95 < row.tolerance_high


def test_the_noise_of_the_runs_is_pooled(known):
    table = known[0].noise().set_index("parameter")
    assert list(table.index) == ["noise_sd", "noise_time", "noise_white", "unmodelled_heat"]
    assert known[0].result.noise.num_machines == NUM
    # the runs have one noise and one heat: no spread is seen
    assert table.loc["noise_sd", "median"] == pytest.approx(0.2, rel=0.01)
    assert table.loc["unmodelled_heat", "median"] == pytest.approx(0.0015, rel=0.1)
    assert table.spread_low_95.max() < 0.01


def test_the_machine_that_does_not_fit_is_named_with_what_is_different(known):
    table = known[0].machines().set_index("machine")
    assert table.loc["machine_11"].outlier_probability > 0.9
    assert table.loc["machine_11"].different == "Req_w"
    assert table.outlier_probability.drop("machine_11").max() < 0.5


def test_the_next_machine_takes_its_priors_from_the_type(known):
    _, folder = known
    text = f'[motor]\nname = "next"\n[population]\nrun = "{folder.name}"\n'
    text += "[parameters.Req_w]\nfixed = 0.15\n"
    motor = parse_motor(text.encode(), str(folder.parent / "motor.toml"))
    said = json.loads((folder / "population.json").read_text())["parameters"]
    assert motor.parameters["Ceq_sr"].value == pytest.approx(said["Ceq_sr"]["next_median"])
    sd = np.log1p(motor.parameters["Ceq_sr"].relative_sd)
    assert sd == pytest.approx(said["Ceq_sr"]["next_log_sd"])
    low, high = said["Ceq_sr"]["next_interval_95"]
    assert low < motor.parameters["Ceq_sr"].value < high
    # wider than the machines, for one in a few may be something else; narrower than no knowledge
    assert SPREAD < sd < 0.4
    assert motor.parameters["Req_w"].fixed == 0.15


def test_the_command_takes_runs(runs, known, tmp_path, capsys):
    out = tmp_path / "type"
    words = ["population", *map(str, runs), "--type", "reference", "--out", str(out), "--json"]
    assert cli.main(words) == 0
    (found,) = json.loads(capsys.readouterr().out)["populations"]
    stored = json.loads((known[1] / "population.json").read_text())
    assert {key: found[key] for key in stored} == stored
    assert [Path(each).name for each in found["files"]] == [
        "population.json", "population.parquet", "type_sheet.pdf",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "found no readable"), ("{}", "another content"), ('{"parameters": {}}', "positive")],
)
def test_a_population_that_is_none_is_refused(tmp_path, content, said):
    if content is not None:
        (tmp_path / "population.json").write_text(content)
    text = '[motor]\nname = "next"\n[population]\nrun = "population.json"\n'
    with pytest.raises(InputError, match=said):
        parse_motor(text.encode(), str(tmp_path / "motor.toml"))


def test_covariates_and_runs_are_checked(runs):
    with pytest.raises(InputError, match="3 machines or more, got 2"):
        heatrun.population(runs[:2])
    with pytest.raises(InputError, match="covariate 'supplier'"):
        heatrun.population(runs, covariates={"supplier": [0.0, 1.0]})
