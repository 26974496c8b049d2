"""From a run folder to prova.mat and back, bit for bit; what cannot be exported is refused."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from run_files import CHANNELS, edit, write_csv

from heatrun import cli
from heatrun.errors import InputError
from heatrun.export import (
    Corrections,
    export_mat,
    export_test,
    read_run_test,
    simulate_variables,
    thesis_variables,
)
from heatrun.export.mat import LARGEST_UNSAID_K, _effects_left_out
from heatrun.export.variables import Shaft
from heatrun.io.whole_files import write_whole
from heatrun.motor.file import load_motor
from heatrun.readers.joined import read_test
from heatrun.readers.mat5 import read_variables
from heatrun.readers.read import read_record
from heatrun.runs.run import open_run

THESIS = ["B", "Ceqsr", "Ceqw", "Is", "Pd", "Reqsr", "Reqw"]
THESIS += ["Rrif", "Te", "Trif", "Tso", "Two", "Tw_m", "t"]
FIRST_ORDER = [name for name in THESIS if name not in ("Ceqsr", "Reqsr", "Tso")]


def test_every_variable_reads_back_to_the_last_bit(day):
    written = export_mat(Path("run"), folder=Path("out"))
    variables = read_variables(Path("out/prova.mat").read_bytes())
    assert list(variables) == THESIS == list(written["variables"])
    record = read_record("duty.csv", load_motor("motor.toml"))
    signals = {name: record[channel] for channel, name in CHANNELS.items() if name in THESIS}
    model = json.loads(Path("run/fit.json").read_text())["models"]["second"]
    found = {n: e["value"] for n, e in {**model["parameters"], **model["nuisances"]}.items()}
    scalars = {"B": 234.5, "Trif": 25.0, "Rrif": 3 * found["Rs0"],
               "Two": found["Tw_start[duty]"], "Tso": found["Tsr_start[duty]"]}  # fmt: skip
    for name in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"):
        scalars[name.replace("_", "")] = found[name]
    for name, signal in signals.items():
        assert variables[name].shape == (record.time_s.size, 1)
        assert np.array_equal(variables[name][:, 0], signal)
    for name, value in scalars.items():
        assert np.array_equal(variables[name], [[value]])


def test_our_reader_takes_the_file_for_the_record(day):
    export_mat(Path("run"), folder=Path("out"))
    motor = load_motor("motor.toml")
    original, again = read_record("duty.csv", motor), read_record("out/prova.mat", motor)
    for channel in again.channels:
        assert np.array_equal(again[channel], original[channel])
    assert set(original.channels) - set(again.channels) == {"speed_rpm"}
    assert again.findings == ()  # above all, no conflict of resistances


def test_the_first_order_has_the_names_of_its_own_model(day):
    def known(result):
        network = result["models"]["first"]["parameters"]
        network["Ceq"]["value"], network["Req"]["value"] = 12500.0, 0.132

    edit(Path("run/fit.json"), known)
    written = export_mat(Path("run"), folder=Path("out"), network="first")
    variables = read_variables(Path("out/prova.mat").read_bytes())
    assert list(variables) == FIRST_ORDER
    assert (variables["Ceqw"], variables["Reqw"]) == (12500.0, 0.132)
    assert variables["Rrif"] == pytest.approx(3 * 0.0062, rel=1e-15)
    assert written["order"] == "first"


def test_the_file_says_what_the_run_said(day):
    test = read_run_test(Path("run"))
    variables, _ = thesis_variables(test.record, test.values, test.motor, test.model.name)
    corrections = Corrections.of(test.values)
    variables = corrections.applied(variables, Shaft())
    course = simulate_variables(variables, corrections)
    of_run = pd.read_csv("run/course_1.csv")["second_winding_degC"].to_numpy()
    block = np.maximum(np.ceil(course.time / 20.0 - 1e-9).astype(int) - 1, 0)  # blocks of 20 s
    means = np.bincount(block, course.reading) / np.bincount(block)
    # 0.05 K is the limit of what steps of 2 s may change; as much again for the median of the
    # courses of all draws against the course of the medians
    assert means == pytest.approx(of_run, abs=0.1)


def test_a_held_out_test_starts_at_its_first_readings(day):
    test = read_run_test(Path("run"), test="step")
    assert test.is_held_out
    model = json.loads(Path("run/fit.json").read_text())["models"]["second"]
    offset = model["nuisances"]["sensor_offset"]["value"]
    # readings are whole degrees, the first few scatter by one
    assert test.values["Tw_start"] + offset == pytest.approx(
        test.record["winding_degC"][:10].mean(), abs=1.0
    )
    # a cold start: the machine has soaked, and both ends differ by less than the 1 K it leaves
    assert test.values["Tsr_start"] == pytest.approx(test.values["Tw_start"], abs=1.0)


def test_the_command_prints_one_object(day, capsys):
    words = ["export", "run", "--to", "mat", "--out", "out", "--test", "step", "--json"]
    assert cli.main(words) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["test"] == "step"
    assert printed["variables"]["Is"] == {"shape": [1801, 1], "unit": "A"}
    assert [Path(file).exists() for file in printed["files"]] == 3 * [True]


def test_a_correction_is_said_and_applied_on_demand(day, capsys):
    def a_tenth_more(result):
        nuisances = result["models"]["second"]["nuisances"]
        nuisances["power_gain"]["value"] = 0.1
        nuisances["load_timing[duty]"]["value"] = 0.0

    edit(Path("run/fit.json"), a_tenth_more)
    assert cli.main(["export", "run", "--to", "mat", "--out", "plain"]) == 0
    assert "power_gain = 0.1" in (said := capsys.readouterr().err)
    assert "--corrected" in said
    assert cli.main(["export", "run", "--to", "mat", "--out", "plain", "--json", "--force"]) == 0
    told = capsys.readouterr()
    assert "power_gain = 0.1" in told.out  # once: a program that reads it shows it
    assert "power_gain = 0.1" not in told.err
    assert cli.main(["export", "run", "--to", "mat", "--out", "corrected", "--corrected"]) == 0
    assert "--corrected" not in capsys.readouterr().err
    plain = read_variables(Path("plain/prova.mat").read_bytes())
    corrected = read_variables(Path("corrected/prova.mat").read_bytes())
    assert np.array_equal(corrected["Pd"], 1.1 * plain["Pd"])
    assert np.array_equal(corrected["Tw_m"], plain["Tw_m"])


def test_a_load_that_comes_later_is_exported_later(day):
    def by_half_a_sample(result):
        for entry in result["models"]["second"]["nuisances"].values():
            entry["value"] = 0.0
        result["models"]["second"]["nuisances"]["load_timing[duty]"]["value"] = 0.5

    edit(Path("run/fit.json"), by_half_a_sample)
    for folder, words in (("plain", []), ("corrected", ["--corrected"])):
        assert cli.main(["export", "run", "--to", "mat", "--out", folder, *words]) == 0
    plain = read_variables(Path("plain/prova.mat").read_bytes())
    corrected = read_variables(Path("corrected/prova.mat").read_bytes())
    halfway = 0.5 * (plain["Pd"][1:] + plain["Pd"][:-1])
    np.testing.assert_allclose(corrected["Pd"][1:], halfway, rtol=1e-12)
    square = 0.5 * (plain["Is"][1:] ** 2 + plain["Is"][:-1] ** 2)
    np.testing.assert_allclose(corrected["Is"][1:] ** 2, square, rtol=1e-12)


def test_a_rate_given_on_the_command_line_is_taken_up(day):
    table = pd.read_csv("duty.csv").drop(columns="t")
    table.to_csv("duty.csv", index=False)
    digest = read_test("duty.csv@1Hz", load_motor("motor.toml")).sources[0].sha256

    def without_time(content):
        content["command"] = "heatrun calibrate motor.toml duty.csv@1Hz --holdout step.csv"
        for entry in content.get("tests", content.get("inputs")):
            if entry["path"] == "duty.csv":
                entry["sha256"] = digest

    edit(Path("run/fit.json"), without_time)
    edit(Path("run/manifest.json"), without_time)
    export_mat(Path("run"), folder=Path("out"))
    time = read_variables(Path("out/prova.mat").read_bytes())["t"]
    assert np.array_equal(time[:, 0], np.arange(3601.0))


def test_a_test_of_two_loggers_is_read_from_both_files(day, monkeypatch):
    drive = Path("drive.csv")
    drive.write_text("Power [W]\n1\n")
    entry = {"path": "drive.csv", "sha256": hashlib.sha256(drive.read_bytes()).hexdigest()}
    edit(Path("run/manifest.json"), lambda content: content["inputs"].insert(2, entry))
    words = "heatrun calibrate motor.toml duty.csv+drive.csv@10Hz --holdout step.csv"
    edit(Path("run/fit.json"), lambda result: result.update(command=words))
    asked = []

    def read(text, motor):
        asked.append(text)
        return read_test("step.csv" if text == "step.csv" else "duty.csv", motor)

    monkeypatch.setattr("heatrun.export.rerun.read_test", read)
    read_run_test(Path("run"))
    assert asked == ["duty.csv+drive.csv@10Hz"]
    drive.write_text("Power [W]\n2\n")
    with pytest.raises(InputError, match=r"drive\.csv has changed"):
        read_run_test(Path("run"))
    assert read_run_test(Path("run"), test="step").is_held_out  # the other test has one file


def test_a_new_test_is_exported_with_the_run_s_own_motor_file(day, bench, generator):
    new = bench(generator.constant_load(900.0), seed=7)
    write_csv(new, Path("new.csv"))
    Path("motor.toml").unlink()  # the run keeps a copy
    assert cli.main(["export", "run", "new.csv", "--to", "mat", "--corrected"]) == 0
    variables = read_variables(Path("new_mat/prova.mat").read_bytes())
    assert np.array_equal(variables["Tw_m"][:, 0], new["winding_degC"])
    found = open_run("run").predict("new.csv")
    values = found.middle  # of the network alone, as they are stated
    assert variables["Ceqw"].item() == pytest.approx(values["Ceq_w"], rel=1e-12)
    assert variables["Two"].item() == pytest.approx(values["Tw_start"], rel=1e-12)
    course = simulate_variables(variables).sensed
    length = variables["t"][-1, 0] / found.nodes["winding"].size
    block = np.maximum(np.ceil(variables["t"].ravel() / length - 1e-9).astype(int) - 1, 0)
    means = np.bincount(block, course) / np.bincount(block)
    # the moment of the load step is a correction of the reading; three winding time constants
    # after it, it is forgotten
    later = found.time_s > 500.0
    assert np.sum(later) > 30
    # the winding at the medians of the network alone; what it may miss, such as a sensor that picks
    # up the current, moves the middle of the run's band by less than a quarter of its half-width
    low, high = found.nodes_95["winding"]
    apart = np.abs(means - found.nodes["winding"]) / (0.5 * (high - low))
    assert np.all(apart[later] < 0.25)
    assert np.all((high - low)[later] < 4.0)


def test_a_test_of_the_run_is_exported_by_the_run_s_own_motor_file(day):
    """The motor file may be edited after the run: another resistance, columns, parts of tests."""
    before = export_mat(Path("run"), folder=Path("before"))
    text = Path("motor.toml").read_text(encoding="utf-8")
    Path("motor.toml").write_text(
        text.replace("0.0062", "0.5") + '\n[columns]\nwinding_degC = "none of these"\n',
        encoding="utf-8",
    )
    after = export_mat(Path("run"), folder=Path("after"))
    Path("motor.toml").unlink()
    gone = export_mat(Path("run"), folder=Path("gone"))
    files = [Path(name, "prova.mat").read_bytes() for name in ("before", "after", "gone")]
    assert files[0] == files[1] == files[2]
    assert before["rmse_K"] == after["rmse_K"] == gone["rmse_K"]


def test_a_test_of_the_run_is_known_by_its_bytes(day):
    Path("same.csv").write_bytes(Path("duty.csv").read_bytes())
    of_run = export_mat(Path("run"), folder=Path("one"))
    new = export_test(Path("run"), Path("same.csv"), folder=Path("two"))
    assert (new["test"], new["is_held_out"]) == ("duty", False)
    assert Path("one/prova.mat").read_bytes() == Path("two/prova.mat").read_bytes()
    assert new["rmse_K"] == of_run["rmse_K"]


def test_from_a_run_to_the_file_and_back_to_a_simulation(day):
    def halfway(result):  # else the load of the file is later than that of the record
        result["models"]["second"]["nuisances"]["load_timing[duty]"]["value"] = 0.0

    edit(Path("run/fit.json"), halfway)
    assert cli.main(["export", "run", "--to", "mat", "--out", "mat", "--corrected"]) == 0
    assert cli.main(["simulate", "motor.toml", "mat/prova.mat", "mat/prova.mat"]) == 0
    assert cli.main(["simulate", "motor.toml", "run", "duty.csv"]) == 0
    back, direct = pd.read_csv("prova_virtual.csv"), pd.read_csv("duty_virtual.csv")
    low, high = direct["winding_95_low_degC"], direct["winding_95_high_degC"]
    assert np.all((low < back["winding_degC"]) & (back["winding_degC"] < high))
    assert not any("95" in name for name in back)  # a file says nothing of uncertainty
    test = read_run_test(Path("run"))
    trace = test.model.simulate(
        {name: jnp.asarray(value) for name, value in test.values.items()}, test.blocks.inputs
    )
    for node in ("winding", "stator"):
        T = np.asarray(trace.temperature[node])
        of_medians = 0.5 * (T[1:] + T[:-1])[: len(back)]
        np.testing.assert_allclose(back[f"{node}_degC"], of_medians, rtol=0.0, atol=0.01)
        # the median of the courses is not the course of the medians
        np.testing.assert_allclose(back[f"{node}_degC"], direct[f"{node}_degC"], rtol=0, atol=0.2)


def test_a_second_export_of_a_run_gets_a_place_of_its_own(day, capsys):
    first = export_mat(Path("run"))["files"]
    before = Path(first[0]).read_bytes()
    second = export_mat(Path("run"), test="step")["files"]
    assert [str(Path(path).parent) for path in (first[0], second[0])] == ["run", "run/mat-2"]
    assert Path(first[0]).read_bytes() == before
    with pytest.raises(InputError, match="pass --force to replace it"):
        export_mat(Path("run"), folder=Path("run"), test="step")
    export_mat(Path("run"), folder=Path("run"), test="step", is_replacing=True)
    assert Path(first[0]).read_bytes() == Path(second[0]).read_bytes()


def test_effects_that_the_run_averages_over_and_the_file_lacks_are_said(day, monkeypatch):
    found = read_run_test(Path("run"), network="first")
    # the median of the predictions and the prediction of the medians are half a kelvin apart, with
    # one node for two
    limit_K = 2.0 * LARGEST_UNSAID_K
    monkeypatch.setattr("heatrun.export.mat.LARGEST_UNSAID_K", limit_K)

    def findings(added_K, missing):
        reading = found.predicted.reading + added_K
        predicted = replace(found.predicted, reading=reading, maybe_missing=missing)
        changed = replace(found, predicted=predicted)
        monkeypatch.setattr("heatrun.export.mat.read_run_test", lambda *_, **__: changed)
        exported = export_mat(Path("run"), folder=Path("out"), is_replacing=True)
        return [each for each in exported["findings"] if each.id == "effects_left_out"]

    (finding,) = findings(8.0, {"speed_cooling": 0.2, "winding_node": 0.7})
    assert "winding_node 70 %, speed_cooling 20 %" in finding.message
    assert "--with winding_node" in finding.remedy
    (further,) = findings(16.0, {"winding_node": 0.7})
    gap_K, more_K = finding.values["effects_K"], further.values["effects_K"]
    assert abs(gap_K - 8.0) < limit_K  # so far the two agree without effects
    assert more_K - gap_K == pytest.approx(8.0)
    assert findings(0.0, {"winding_node": 0.7}) == findings(8.0, {}) == []


def test_a_reading_that_jumps_is_held_against_means_of_blocks_by_its_own():
    time_s = np.arange(0.0, 401.0)
    reading = np.where(time_s < 207.5, 40.0, 46.0)  # what a line picks up of a step of the current
    middle = np.arange(10.0, 400.0, 20.0)
    means = np.interp(middle, [190.0, 210.0, 230.0], [40.0, 40.0 + 6.0 * 12.5 / 20.0, 46.0])
    found = SimpleNamespace(
        record=SimpleNamespace(time_s=time_s, name="step"),
        predicted=SimpleNamespace(time_s=middle, reading=means, maybe_missing={"radiation": 0.1}),
    )
    assert _effects_left_out(found, reading, "network.mat") == ()
    found.predicted.reading = means + 0.6
    (finding,) = _effects_left_out(found, reading, "network.mat")
    assert finding.values["effects_K"] == pytest.approx(0.6, abs=0.2)


def of_capacity(value):
    def spoil(result):
        result["models"]["second"]["parameters"]["Ceq_w"]["value"] = value

    return spoil


OF_FIT = {
    **{f"no {key}": (lambda result, key=key: result.pop(key), "fit.json of the run cannot be read")
       for key in ("motor", "tests", "models")},
    "a capacity of text": (of_capacity("x"), "cannot be read"),
    "no capacity": (of_capacity(None), "cannot be read"),
    "a capacity below zero": (of_capacity(-1.0), "expected Ceq_w above 0, got -1"),
    "no calibrated test": (lambda result: result["tests"].pop(0), "no test that was calibrated on"),
}  # fmt: skip
OF_FILES = {
    "duty.csv": ("of another day", r"duty\.csv has changed since the run: SHA-256"),
    **{f"run/manifest.json {number}": (text, r"manifest\.json") for number, text in enumerate(
        ("", "[]", '{"inputs": [{"path": 3}]}', '{"inputs": []}'))},
}  # fmt: skip


@pytest.mark.parametrize("case", OF_FIT | OF_FILES)
def test_a_run_that_is_damaged_is_refused(day, case):
    spoil, said = (OF_FIT | OF_FILES)[case]
    if case in OF_FIT:
        edit(Path("run/fit.json"), spoil)
    else:
        Path(case.split(" ")[0]).write_text(spoil)
    with pytest.raises(InputError, match=said):
        export_mat(Path("run"), folder=Path("out"))
    assert not Path("out").exists()


def test_a_missing_record_is_refused(day, capsys):
    Path("duty.csv").unlink()
    assert cli.main(["export", "run", "--to", "mat"]) == 1
    said = capsys.readouterr().err
    assert "duty.csv of this run cannot be read (No such file" in said
    assert "in the folder that the run was started in" in said


def test_what_the_run_has_not_is_refused(day):
    with pytest.raises(InputError, match="with one of: duty, step"):
        export_mat(Path("run"), test="other")
    with pytest.raises(InputError, match="holds no third network, only first, second"):
        export_mat(Path("run"), network="third")


def test_an_effect_from_a_file_of_the_user_is_refused_by_name(day):
    path = Path("run/model_second.toml")
    path.write_text(path.read_text().replace("effects = []", 'effects = ["shaft_fan"]', 1))
    listing = json.loads(Path("run/manifest.json").read_text())
    listing["files"][path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    Path("run/manifest.json").write_text(json.dumps(listing))
    with pytest.raises(InputError, match="not that of shaft_fan"):
        export_mat(Path("run"), folder=Path("out"))
    assert not Path("out").exists()


def test_a_torque_offset_needs_the_speed(day, monkeypatch):
    found = read_run_test(Path("run"))
    offset = replace(found, values={**found.values, "torque_offset": 0.5})
    monkeypatch.setattr("heatrun.export.mat.read_run_test", lambda *_, **__: offset)
    assert export_mat(Path("run"), folder=Path("out"))["corrections_K"] > 1.0
    silent = {n: v for n, v in found.record.channels.items() if n != "speed_rpm"}
    offset = replace(offset, record=replace(found.record, channels=silent))
    with pytest.raises(InputError, match="corrects the torque, and this test has no speed_rpm"):
        export_mat(Path("run"), folder=Path("out"))


def test_a_file_of_someone_else_is_left_alone(day):
    out = Path("out")
    out.mkdir()
    (out / "prova.mat").write_bytes(b"MATLAB 5.0 MAT-file, Platform: PCWIN64")
    with pytest.raises(InputError, match="not as heatrun writes it; it is left as it is"):
        export_mat(Path("run"), folder=out)
    assert (out / "prova.mat").read_bytes() == b"MATLAB 5.0 MAT-file, Platform: PCWIN64"
    assert not (out / "run_prova.m").exists()


def test_an_edited_script_is_left_alone(day):
    script = Path(export_mat(Path("run"))["files"][1])
    script.write_text("% mine")
    with pytest.raises(InputError, match=r"run_prova\.m exists"):
        export_mat(Path("run"))
    assert script.read_text() == "% mine"


def test_a_place_that_cannot_be_written_to_is_refused(day):
    with pytest.raises(InputError, match="cannot be written"):
        export_mat(Path("run"), folder=Path("motor.toml"))


def test_the_script_is_not_there_without_the_variables(day, monkeypatch):
    def cut(path, content):
        write_whole(path, content)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("heatrun.export.mat.write_whole", cut)
    with pytest.raises(InputError, match="No space left"):
        export_mat(Path("run"), folder=Path("out"))
    assert not list(Path("out").iterdir())
