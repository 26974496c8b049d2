"""A run of any network with effects goes through every command, with the same numbers."""

import doctest
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from octave import needs_octave, octave

import heatrun
from heatrun import calibration, cli
from heatrun.errors import InputError
from heatrun.export import simulate_network
from heatrun.posterior.posterior import normal_draws
from heatrun.runs import result as of_result

MOTOR = """[motor]
name = "bench"
rated_speed_rpm = 6000
insulation_class = "F"
[winding]
phase_resistance_ohm = 0.0062
[model]
effects = ["speed_cooling"]
[parameters."speed_cooling.g"]
fixed = 0.02
[parameters."speed_cooling.m"]
fixed = 0.8
[adequacy]
unmodelled_heat = 0.003
"""
FOUR = Path(__file__).with_name("four.toml").read_text("utf-8")
LAG_S = 12.0


def lagging(record):
    """The record with a thermometer that follows with a time constant of 12 s, at 1 Hz."""
    share, winding = 1.0 - np.exp(-1.0 / LAG_S), record["winding_degC"].copy()
    for i in range(1, winding.size):
        winding[i] = winding[i - 1] + share * (record["winding_degC"][i] - winding[i - 1])
    return {**record.channels, "winding_degC": winding}


@pytest.fixture(scope="module")
def day(tmp_path_factory, bench, generator):
    """A bench folder with two tests and a calibrated four-node network with an effect.

    What its calibration does beside the fit is that of any run, which other tests look at: the
    search for effects, the samples, the check of the reduction, the forecast. Both tests are as
    long, so that one program simulates both.
    """
    folder = tmp_path_factory.mktemp("day")
    (folder / "motor.toml").write_text(MOTOR)
    (folder / "four.toml").write_text(FOUR)
    profiles = {"duty": generator.duty(1800.0), "step": generator.constant_load(1800.0)}
    for seed, (name, profile) in enumerate(profiles.items()):
        channels = lagging(bench(profile, seed=40 + seed))
        pd.DataFrame(channels).to_csv(folder / f"{name}.csv", index=False)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name in ("find", "small_effects"):
            patch.setattr(calibration, name, lambda *_, **__: None)
        patch.setattr(calibration, "sample", lambda fit, seed, **_: normal_draws(fit, seed=seed))
        patch.setattr(calibration, "check_reduction", lambda *_: (0.0, ()))
        patch.setattr(of_result, "forecast", lambda *_: {})
        words = ["motor.toml", "duty.csv", "--holdout", "step.csv", "--model", "four.toml",
                 "--with", "sensor_lag", "--quick", "--out", "run"]  # fmt: skip
        assert cli.main(["calibrate", *words]) == 0
    return folder


def json_of(capsys, *words):
    capsys.readouterr()
    assert cli.main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_every_command_gives_one_rmse_for_one_test(day, capsys, monkeypatch):
    monkeypatch.chdir(day)
    fit = json.loads(Path("run/fit.json").read_text())
    assert fit["models"]["four"]["effects"][0]["id"] == "speed_cooling"
    rmse = {row["test"]: row["rmse_K"] for row in fit["models"]["four"]["residuals"]}
    simulated = json_of(capsys, "simulate", "motor.toml", "run", "duty.csv", "step.csv",
                        "--out", "virtual")  # fmt: skip
    run = heatrun.open_run("run")
    for row in simulated["simulated"]:
        name = row["test"]
        assert row["effects"] == ["speed_cooling", "sensor_lag"]
        assert row["rmse_K"] == pytest.approx(rmse[name], rel=1e-9)
        assert run.predict(f"{name}.csv").rmse_K == pytest.approx(rmse[name], rel=1e-9)
        report = json_of(capsys, "report", "--type", "thermal", "--run", "run", "motor.toml",
                         f"{name}.csv", "--out", "reports")  # fmt: skip
        assert rmse_of(report) == pytest.approx(rmse[name], rel=1e-9)


def test_unmodelled_heat_stands_in_the_run_in_its_unit(day):
    """As the share of the loss that the motor file speaks of, whatever it is computed with."""
    run = heatrun.open_run(day / "run")
    stored = np.asarray(run.posterior("four")["posterior"]["unmodelled_heat"]).ravel()
    np.testing.assert_allclose(stored, 2.0 * np.asarray(run.draws().noise().heat), rtol=1e-9)
    said = run.result.models["four"].noise.prior["unmodelled_heat"]
    assert said == pytest.approx([0.003 * np.exp(f * 1.96 * 1.2) for f in (-1, 1)])


def rmse_of(report):
    text = json.dumps(report)
    return float(text.split('"rmse_K"')[1].split('"value": ')[1].split(",")[0])


def test_the_row_of_a_course_belongs_to_one_moment(day):
    run = heatrun.open_run(day / "run")
    values, virtual = run.values(), run.simulate(day / "duty.csv")
    drop = virtual["winding_degC"] - virtual["tooth_degC"]
    by_ohm = drop / values["Req_winding_tooth"]
    # medians over draws and flow at the median parameters: the same moment to within their spread
    error = np.abs(by_ohm - virtual["flow_winding_tooth_W"])
    assert error.max() < 0.05 * np.abs(by_ohm).max()


def test_sheet_and_export_of_a_network_with_effects(day, capsys, monkeypatch):
    monkeypatch.chdir(day)
    assert cli.main(["sheet", "run", "--out", "sheet"]) == 0
    text = json.loads(Path("sheet/sheet.json").read_text())
    assert "with speed_cooling and sensor_lag" in text["certificate"]["headline"]
    for name in ("sheet.pdf", "sheet.xlsx", "sheet.json"):
        assert Path("sheet", name).read_bytes() == Path("run", name).read_bytes()
    written = json_of(capsys, "export", "run", "--to", "mat", "--out", "matlab")
    assert [Path(path).name for path in written["files"]] == ["network.mat", "run_network.m"]
    assert written["effects"] == ["speed_cooling", "sensor_lag"]
    assert written["variables"]["nodes"]["value"] == ["winding", "tooth", "yoke", "rotor"]


@needs_octave
def test_octave_integrates_the_export_of_the_run(day, capsys, monkeypatch):
    monkeypatch.chdir(day)
    test = "step"  # held out, so that its start is found anew
    written = json_of(capsys, "export", "run", "--to", "mat", "--test", test, "--out", test)
    said = octave(written["files"][1], day)
    table = pd.read_csv(Path(test, "network_course.csv"))
    course = simulate_network(Path(test, "network.mat").read_bytes())
    np.testing.assert_allclose(table["reading_degC"], course.reading, rtol=0, atol=1e-3)
    for node, T in course.temperature.items():
        np.testing.assert_allclose(table[f"{node}_degC"], T, rtol=0, atol=1e-3, err_msg=node)
    measured = pd.read_csv(f"{test}.csv")["winding_degC"]
    rmse = np.sqrt(np.mean((table["reading_degC"] - measured) ** 2))
    # four decimals are printed, six stand in the table
    assert f"RMSE of the reading to Tw_m: {rmse:.4f} K over {len(measured)} readings" in said
    assert written["rmse_reading_K"] == pytest.approx(rmse, abs=1e-3)


def test_the_virtual_report_takes_the_run(day, capsys, monkeypatch):
    monkeypatch.chdir(day)
    report = json_of(capsys, "report", "--type", "virtual", "--run", "run", "motor.toml",
                     "step.csv", "--out", "reports")  # fmt: skip
    assert "winding_degC" in json.dumps(report)


def test_the_python_interface(day, monkeypatch):
    monkeypatch.chdir(day)
    run = heatrun.open_run("run")
    summary = run.summary()
    assert {"Ceq_winding", "speed_cooling.g", "sensor_lag.tau"} <= set(summary.index)
    assert (summary["low_95"] <= summary["value"]).all()
    assert set(run.idata.posterior.data_vars) >= {"Ceq_winding", "noise_sd"}
    assert len(run.plot().axes) == 2
    assert run.motor.effects == ("speed_cooling",)
    assert [test.role for test in run.tests] == ["calibration", "holdout"]
    assert "Ceq_winding" in run._repr_html_()
    assert [f.severity for f in heatrun.check("motor.toml", "duty.csv")].count("error") == 0
    with pytest.raises(AttributeError, match="calibrte"):
        heatrun.calibrte  # noqa: B018
    with pytest.raises(InputError, match="holds no second network, only four"):
        run.predict("duty.csv", network="second")


def session_of_the_docstring():
    """The lines of the package's docstring, for files and folders that are here."""
    lines = [line.strip() for line in (heatrun.__doc__ or "").split("\n") if line[:4] == "    "]
    assert lines[0] == "import heatrun"
    assert len(lines) == 9
    # that takes readings of the resistance: test_shutdown.py
    lines = [line for line in lines if "winding_at_switch_off" not in line]
    swaps = {
        'holdout=["step.csv"])': 'holdout=["step.csv"], model="second", method="quick")',
        "discover(run)": 'discover(run, method="quick")',
        "results/runs/demo": "run",
    }
    for old, new in swaps.items():
        assert sum(old in line for line in lines) == 1
        lines = [line.replace(old, new) for line in lines]
    return lines


@pytest.mark.slow
@pytest.mark.parametrize("with_discovery", [False, True], ids=["short", "whole"])
def test_the_example_of_the_interface_runs_as_it_stands(day, tmp_path, monkeypatch, with_discovery):
    for name in ("duty.csv", "step.csv", "motor.toml"):
        (tmp_path / name).write_bytes((day / name).read_bytes())
    (tmp_path / "other.csv").write_bytes((day / "step.csv").read_bytes())
    (tmp_path / "run").symlink_to(day / "run")
    (tmp_path / "motor.toml").write_text(MOTOR.split("[model]")[0])
    monkeypatch.chdir(tmp_path)
    lines = [line for line in session_of_the_docstring() if with_discovery or "found" not in line]
    is_plain = [line.startswith(("import", "run =", "found =")) for line in lines]
    session = "".join(
        f">>> {line if plain else f'_ = {line}'}\n"
        for line, plain in zip(lines, is_plain, strict=True)
    )
    test = doctest.DocTestParser().get_doctest(session, {}, "session", None, 0)
    runner = doctest.DocTestRunner()
    runner.run(test)
    assert runner.failures == 0
    assert runner.tries == len(lines)
