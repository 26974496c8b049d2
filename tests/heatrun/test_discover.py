"""Discovery on benches with a hidden cause: the command on the bundled records, what its page says.

And a small version of the study.
"""

import json
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import jsonschema
import pytest
from discovered import discovered
from hidden_machines import machine
from page_numbers import said_and_simulated

from heatrun.checks.load_moments import with_load_moments
from heatrun.cli import main
from heatrun.errors import InputError
from heatrun.export.rerun import as_replica, read_run_test
from heatrun.model.catalogue import all_effects
from heatrun.posterior.posterior import normal_draws
from heatrun.readers.mat5 import read_variables
from heatrun.record.record import Record
from heatrun.record.reduction import reduce
from heatrun.results.schema import schema_of
from heatrun.runs.run import open_run
from lptn import EFFECTS

IDS = {kind.card.id for kind in EFFECTS}
HERE = Path(__file__).parent
DATA = HERE.parents[1] / "data" / "synthetic" / "hidden_cause"
MOTOR, STAIRCASE, HELD_OUT = (
    str(DATA / name) for name in ("motor.toml", "staircase.csv.gz", "other_staircase.csv.gz")
)
TRUTH = json.loads((DATA / "truth.json").read_text())


def quick_draws(fit, *, method, seed, **_):
    """Stand in for the samples, half a minute of them, which tests of `show` draw."""
    assert method == "quick"
    return normal_draws(fit, seed=seed)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The run folder of the command, and what it printed beside it; nobody writes into it."""
    run = tmp_path_factory.mktemp("page") / "run"
    words = ["discover", MOTOR, STAIRCASE, "--holdout", HELD_OUT, "--quick", "--json", "--out",
             str(run)]  # fmt: skip
    with (
        pytest.MonkeyPatch.context() as patch,
        run.with_name("said.json").open("w", encoding="utf-8") as out,
        redirect_stdout(out),
    ):
        patch.setattr("heatrun.calibration.sample", quick_draws)
        assert main(words) == 0
    return run


@pytest.fixture(scope="module")
def stored(folder):
    return json.loads((folder / "discovery.json").read_text())


@pytest.fixture(scope="module")
def fit(folder):
    return json.loads((folder / "fit.json").read_text())


def test_the_command_names_what_is_hidden_with_its_amplitude_and_writes_its_folder(folder, stored):
    said = json.loads(folder.with_name("said.json").read_text())
    assert said["verdict"] == stored["verdict"] == "named"
    assert [effect["id"] for effect in said["effects"]] == TRUTH["hidden"]
    assert {row["id"] for row in stored["candidates"]} == IDS
    for row in stored["candidates"]:
        assert row["reason"] or row["status"] == "accepted"
    (effect,) = stored["effects"]
    g = effect["parameters"]["g"]
    # the machine's law is 1.5 a s^p with 0.65 < p < 0.85 behind a lag; at rated speed both agree
    true = 1.5 * TRUTH["amplitudes"]["speed_cooling"]
    assert (g["value"], g["unit"]) == (pytest.approx(true, rel=0.15), "1")
    assert g["interval_95"] == said["effects"][0]["parameters"]["g"]["interval_95"]
    assert g["interval_95"][0] < true < g["interval_95"][1] + 0.1  # laws differ in form
    assert g["interval_95"][0] < g["value"] < g["interval_95"][1]
    assert effect["evidence"]["familywise_p"] < 0.05
    assert effect["left_out"]["rmse_after_K"] < effect["left_out"]["rmse_before_K"]
    assert not stored["adequacy"]["before"]["is_adequate"]
    assert stored["adequacy"]["after"]["is_adequate"]
    assert said["holdout"]["rmse_after_K"] < 0.3 * said["holdout"]["rmse_before_K"]
    assert stored["holdout"]["coverage_95_after"] > 0.85
    for name in ("discovery.pdf", "sheet.pdf", "fit.json", "posterior_second.nc", "manifest.json"):
        assert (folder / name).stat().st_size > 0
    assert not folder.with_name("run.partial").exists()


def test_a_fresh_result_holds_to_the_schema_which_knows_each_field(stored):
    schema = schema_of("discovery-2.json")
    validator = jsonschema.Draft202012Validator(schema)
    assert [error.message for error in validator.iter_errors(stored)] == []
    assert set(stored) == set(schema["required"])


def test_the_gap_is_at_the_stator_in_significant_spans(stored):
    assert "stator" in stored["localisation"]["before"]["nodes"]
    spans = [span for span in stored["where"] if span["node"] == "stator"]
    assert spans
    for span in spans:
        low, high = span["interval_95"]
        assert low < span["missing_W"] < high
        assert low * high > 0.0


def test_network_parameters_move_back_to_the_truth(stored):
    assert set(stored["parameters"]) == {"Ceq_w", "Ceq_sr", "Req_w", "Req_sr", "Rs0"}
    found = stored["parameters"]["Req_sr"]
    before, after = (found[when]["value"] / TRUTH["Req_sr"] - 1.0 for when in ("before", "after"))
    assert abs(after) < 0.05
    assert abs(before) > 0.10


def test_what_was_found_is_the_model_that_is_simulated(folder, stored, tmp_path, capsys):
    words = ["simulate", MOTOR, str(folder), HELD_OUT, "--out", str(tmp_path)]
    assert main([*words, "--json"]) == 0
    (simulated,) = json.loads(capsys.readouterr().out)["simulated"]
    assert simulated["effects"] == TRUTH["hidden"]
    assert simulated["rmse_K"] == pytest.approx(stored["holdout"]["rmse_after_K"], rel=1e-6)


def test_a_file_of_effects_that_is_not_there_is_an_error(tmp_path, capsys):
    words = ["--effects", str(tmp_path / "nowhere.py"), "--out", str(tmp_path / "run")]
    assert main(["discover", MOTOR, STAIRCASE, *words]) == 1
    assert "--effects" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_file_of_effects_is_searched_beside_the_catalogue(tmp_path, monkeypatch):
    class Enough(BaseException):
        """So far it goes here; the rest takes a minute."""

    searched = []

    def search(*_, kinds, **__):
        searched.extend(kind.card.id for kind in kinds)
        raise Enough

    monkeypatch.setattr("heatrun.calibration.find", search)
    words = ["discover", MOTOR, STAIRCASE, "--quick", "--effects", str(HERE / "cabinet_heater.py")]
    with pytest.raises(Enough):
        main([*words, "--out", str(tmp_path / "run")])
    assert set(searched) == {*IDS, "cabinet_heater"}


def test_the_numbers_simulated_have_the_error_of_the_page(folder):
    ((said, simulated),) = said_and_simulated(folder)
    assert simulated == pytest.approx(said, rel=0.1, abs=0.05)


def test_the_effect_is_in_the_model_and_the_resistance_at_its_conditions(folder, fit):
    assert fit["effects"] == TRUTH["hidden"] == ["speed_cooling"]
    page = fit["models"]["second"]
    rest, loaded = (page["derived"][f"Req_sr_{where}"] for where in ("at_rest", "loaded"))
    assert loaded["value"] < rest["value"]
    assert "rpm" in loaded["condition"]
    assert rest["condition"].startswith("0 rpm")
    low, high = rest["interval_95"]
    assert low < TRUTH["Req_sr"] < high
    assert fit["use"]["use"] in ("usable", "restricted")
    assert "speed_cooling" in fit["use"]["sentence"]
    sheet = json.loads((folder / "sheet.json").read_text())
    rows = [row[0] for row in sheet["certificate"]["parameters"]]
    assert rows.index("Req_sr under load") < rows.index("Req_sr at rest")
    assert "Req_sr" not in rows  # that of the law alone is what it is at rest
    assert sheet["certificate"]["headline"] == fit["use"]["sentence"]


def test_four_numbers_alone_are_labelled_and_tell_their_error(folder, fit):
    page = fit["models"]["second"]
    replica = page["replica"]
    assert set(replica["parameters"]) == {"Ceq_w", "Ceq_sr", "Req_w", "Req_sr"}
    row = next(row for row in page["residuals"] if row["role"] == "calibration")
    assert replica["rmse_K"][row["test"]] > row["rmse_K"]
    # between what the fan leaves at rest and what it leaves at speed
    at = page["derived"]
    low, high = (at[f"Req_sr_{where}"]["value"] for where in ("loaded", "at_rest"))
    assert 0.9 * low < replica["parameters"]["Req_sr"] < 1.1 * high
    sheet = json.loads((folder / "sheet.json").read_text())
    assert "Replica for tools that take four numbers, no result" in sheet["replica"]
    line = sheet["residuals"]["rows"][0]
    assert line[2] == f"{row['rmse_K']:.2f}"
    assert line[-1] == f"{replica['rmse_K'][row['test']]:.2f}"


def test_the_replica_is_exported_for_tools_that_take_four_numbers(folder, fit, tmp_path, capsys):
    replica = fit["models"]["second"]["replica"]
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


def test_a_replica_that_keeps_the_law_stays_near_the_model(folder, fit):
    plain = fit["models"]["second"]["replica"]["from_model_K"]
    found, apart_K = as_replica(read_run_test(folder), kept=["speed_cooling", "sensor_lag"])
    assert [kind.card.id for kind in found.model.effects] == ["speed_cooling"]
    assert found.values["speed_cooling.g"] > 0.0
    assert apart_K < 0.1 * plain


@pytest.mark.slow
def test_the_bare_network_says_what_it_costs(tmp_path, capsys):
    run = tmp_path / "run"
    words = ["calibrate", MOTOR, STAIRCASE, "--model", "second", "--quick", "--plain", "--json"]
    assert main([*words, "--out", str(run)]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["effects"] == []
    assert said["use"]["use"] != "usable"
    (left,) = [each for each in said["findings"] if each["id"] == "effects_left_out"]
    assert "speed_cooling" in left["message"]


def test_a_test_that_cannot_be_predicted_has_no_gap_and_the_run_can_be_read(tmp_path, monkeypatch):
    def fail(*_, **__):
        raise InputError("a node is too fast for the steps of this test.")

    monkeypatch.setattr("heatrun.calibration.sample", quick_draws)
    monkeypatch.setattr("heatrun.calibration.predict", fail)
    said = StringIO()
    with redirect_stdout(said):
        assert main(["discover", MOTOR, STAIRCASE, "--quick", "--out", str(tmp_path / "run")]) == 0
    found = open_run(tmp_path / "run").discovery
    assert found.calibration is None
    assert found.holdout is None
    assert [effect.id for effect in found.effects] == TRUTH["hidden"]
    assert " nan " not in said.getvalue()


@pytest.fixture(scope="module")
def cooled(hidden_bench):
    """It leaves a network without the effect 0.8 K off."""
    return machine(hidden_bench, ("speed_cooling",), 31, target_K=0.8)


@pytest.mark.slow
def test_without_its_name_in_the_catalogue_the_cause_stays_unexplained(cooled):
    """Place and watts are there all the same."""
    _, motor, tests, _ = cooled
    kinds = [kind for kind in EFFECTS if kind.card.id != "speed_cooling"]
    found = discovered(motor, tests, kinds=kinds)
    assert found.verdict.word == "unexplained"
    assert "stator" in found.where_before.node


@pytest.mark.slow
def test_heat_from_outside_is_found_where_and_when_it_was(hidden_bench):
    """A heat step is in no catalogue: no name, but place, time and watts."""
    case, motor, tests, _ = machine(hidden_bench, ("unknown:heat_step",), 36, target_K=0.8)
    found = discovered(motor, tests)
    assert found.verdict.word == "unexplained"
    where = found.where_before
    assert "stator" in where.node
    added = case.tests[0].added_W
    inside = case.tests[0].columns["time_s"][added > 0]
    span = max((s for s in where.spans if s.node == "stator"), key=lambda s: s.missing)
    assert span.test == "test_1"
    # knots are two minutes apart, and a smooth course rounds off a step
    assert span.from_s == pytest.approx(inside[0], abs=500.0)
    assert span.to_s == pytest.approx(inside[-1], abs=500.0)
    assert 0.5 * added.max() < span.missing < 1.2 * added.max()


def test_on_a_clean_machine_nothing_is_claimed(hidden_bench):
    """Logged and reduced as the bundled record, so that programs of the command are found again."""
    case, motor, *_ = machine(hidden_bench, (), 32)
    record = Record("staircase", {name: v[::2] for name, v in case.tests[0].columns.items()})
    found = discovered(motor, [with_load_moments(reduce(record, motor), record, motor)])
    assert found.verdict.word == "adequate"
    assert not found.asked.core.effects
    assert found.asked.familywise_p > 0.05


@pytest.mark.slow
def test_a_single_load_step_cannot_tell(hidden_bench):
    _, motor, tests, _ = machine(hidden_bench, ("ac_copper_loss",), 33, kind="single_step")
    found = discovered(motor, tests)
    assert found.verdict.word == "not_identifiable"
    assert not found.asked.core.effects


@pytest.mark.slow
def test_a_users_effect_is_found_when_it_is_the_hidden_one(cooled):
    """Its one file stands in for what the catalogue would call speed cooling."""
    case, motor, tests, _ = cooled
    kinds = all_effects([HERE / "shaft_fan.py"])
    found = discovered(motor, tests, kinds=[k for k in kinds if k.card.id != "speed_cooling"])
    assert found.verdict.word == "named"
    assert found.asked.ids == ("shaft_fan",)
    values = found.asked.search.engine.values(found.asked.core.z, 0)[0]
    assert values["shaft_fan.g"] == pytest.approx(1.5 * case.amplitudes["speed_cooling"], rel=0.15)
