"""The commands as a user runs them: results, refusals, exit codes, nothing half-written."""

import argparse
import ctypes
import gzip
import json
import os
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from heatrun import cli
from heatrun.commands import all_commands, calibrate

DATA = Path(__file__).parents[2] / "data" / "synthetic"


def test_the_bare_name_lists_the_commands(capsys):
    assert cli.main([]) == 2
    said = capsys.readouterr()
    assert set(all_commands()) <= set(said.err.split())
    assert said.out == ""


@pytest.fixture(scope="module")
def table():
    """The bundled duty at 1 Hz."""
    with gzip.open(DATA / "duty_90min.csv.gz", "rt") as file:
        return pd.read_csv(file).iloc[::10].reset_index(drop=True)


@pytest.fixture
def motor_file(tmp_path):
    path = tmp_path / "motor.toml"
    path.write_text((DATA / "motor.toml").read_text())
    return path


@pytest.fixture
def run(tmp_path, motor_file, capsys, monkeypatch):
    """Run calibrate on a table or a text; return exit code, output, and what was left behind."""
    monkeypatch.chdir(tmp_path)

    def call(content, *options, command="calibrate", motor=motor_file, name="test.csv"):
        path = tmp_path / name
        if isinstance(content, pd.DataFrame):
            content.to_csv(path, index=False)
        elif content is not None:
            path.write_text(content)
        words = [command, str(motor), str(path), *options]
        if command == "calibrate":
            words += ["--out", str(tmp_path / "run")]
        code = cli.main(words)
        captured = capsys.readouterr()
        left = [p.name for p in tmp_path.iterdir() if p.name.startswith("run")]
        return code, captured.out, captured.err, left

    return call


def nan_block(table):
    made = table.copy()
    made.loc[1000:1400, "Tw_m"] = np.nan
    return made


def kelvin(table):
    return table.assign(Tw_m=table["Tw_m"] + 273.15, Te=table["Te"] + 273.15)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda table: "", "empty"),
        (lambda table: "t,Is,Pd,Te,Tw_m\n", "no line of numbers"),
        (lambda table: table.to_csv(index=False).replace(",", "@"), "no line of numbers"),
        (lambda table: table.drop(columns="Is"), "phase_current_A"),
        (lambda table: table.rename(columns={"Is": "Is [furlong]"}), "furlong"),
        (nan_block, "nan_block"),
        (lambda table: table.iloc[:3], "samples"),
        (kelvin, "kelvin"),
    ],
    ids=["empty", "header_only", "wrong_delimiter", "missing_channel", "unknown_unit", "nan_block",
         "three_samples", "kelvin"],
)  # fmt: skip
def test_bad_records_are_refused_with_reasons(make, words, run, table):
    code, out, err, left = run(make(table))
    assert code == 1
    assert words in err
    assert "Traceback" not in err
    assert out == ""
    assert left == []


def test_a_directory_is_no_record(run, tmp_path):
    (tmp_path / "folder").mkdir()
    code, _, err, left = run(None, name="folder")
    assert code == 1
    assert "folder" in err
    assert left == []


def test_a_misspelt_key_in_the_motor_file_is_named(run, table, motor_file):
    motor_file.write_text(motor_file.read_text().replace("phase_resistance", "phase_resistence"))
    code, _, err, left = run(table)
    assert code == 1
    assert "phase_resistance_ohm" in err
    assert left == []


def test_a_folder_that_is_no_run_is_left_alone(run, table, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "precious.txt").write_text("keep me")
    code, _, err, _ = run(table)
    assert code == 1
    assert "not a run" in err
    assert (tmp_path / "run" / "precious.txt").read_text() == "keep me"


def test_a_folder_that_cannot_be_written_is_said(run, table, tmp_path, motor_file):
    blocker = tmp_path / "file"
    blocker.write_text("")
    words = ["calibrate", str(motor_file), str(tmp_path / "test.csv"), "--out",
             str(blocker / "run")]  # fmt: skip
    table.to_csv(tmp_path / "test.csv", index=False)
    assert cli.main(words) == 1


def test_findings_come_as_one_json_object(run, table):
    code, out, _, _ = run(kelvin(table), "--json", command="check")
    assert code == 1
    ids = [finding["id"] for finding in json.loads(out)["findings"]]
    assert "units_temperature" in ids


def test_a_clean_record_passes_the_check(run, table):
    code, out, _, _ = run(table, command="check")
    assert code == 0
    assert "ERROR" not in out


def test_wrong_use_is_exit_code_two():
    with pytest.raises(SystemExit) as stop:
        cli.main(["calibrate"])
    assert stop.value.code == 2


def test_an_option_that_takes_several_adds_up_where_it_is_given_again():
    parser = argparse.ArgumentParser()
    calibrate.add_parser(parser.add_subparsers())
    words = (
        "calibrate m.toml a --holdout b --holdout c d --with radiation "
        "--with sensor_lag,housing_node --model first --model mine.toml"
    )
    given = parser.parse_args(shlex.split(words))
    assert given.holdout == [Path("b"), Path("c"), Path("d")]
    assert given.effects_known == "radiation,sensor_lag,housing_node"
    assert given.model == "first,mine.toml"
    again = parser.parse_args(["calibrate", "m.toml", "a"])
    assert (again.holdout, again.effects_known, again.model) == ([], "", "both")


def test_the_main_job_from_file_to_sheet(finished_day, truth):
    assert [p.name for p in finished_day.iterdir() if p.name.startswith("run")] == ["run"]
    said = (finished_day / "said.txt").read_text("utf-8")
    sampling_s, total_s = map(float, re.search(r"here (\d+) of (\d+) s;", said).groups())
    assert 0.0 <= sampling_s < total_s  # what a quick run cannot shorten is said
    result = json.loads((finished_day / "printed.json").read_text("utf-8"))
    assert result["verdict"]["order"] == "second"
    assert "missing_effect" not in [finding["id"] for finding in result["findings"]]
    for name, value in truth.items():
        low, high = result["models"]["second"]["parameters"][name]["interval_95"]
        assert low < value < high
    folder = finished_day / "run"
    for name in ("manifest.json", "fit.json", "posterior_second.nc", "sheet.pdf", "sheet.xlsx"):
        assert (folder / name).stat().st_size > 0
    listing = json.loads((folder / "manifest.json").read_text())
    assert listing["inputs"][1]["sha256"] == result["tests"][0]["sha256"]


def test_another_run_does_not_take_its_place_in_silence(day, capsys):
    words = ["calibrate", "motor.toml", "duty.csv", "--model", "second", "--quick", "--seed", "1",
             "--out", "run"]  # fmt: skip
    before = Path("run/fit.json").read_bytes()
    assert cli.main(words) == 1
    assert "holds another run; it is left as it is. Choose another --out, or pass --force" in (
        capsys.readouterr().err
    )
    assert Path("run/fit.json").read_bytes() == before


def test_nor_does_the_sheet_of_another_run(day, capsys):
    other = Path("other")
    other.mkdir()
    (other / "sheet.json").write_text("{}")
    assert cli.main(["sheet", "run", "--out", str(other)]) == 1
    assert "holds the sheet of another run" in capsys.readouterr().err
    assert sorted(path.name for path in other.iterdir()) == ["sheet.json"]
    assert cli.main(["sheet", "run", "--out", str(other), "--force"]) == 0
    assert (other / "sheet.pdf").read_bytes()[:4] == b"%PDF"


def test_a_virtual_record_follows_the_measured_one(day, capsys):
    words = ["simulate", "motor.toml", "run", "duty.csv", "--json", "--out", "virtual"]
    assert cli.main(words) == 0
    row = json.loads(capsys.readouterr().out)["simulated"][0]
    assert row["rmse_K"] < 0.6  # rounding to 1 degC alone is 0.29 K
    virtual = pd.read_csv(row["file"])
    assert {"winding_degC", "stator_degC", "copper_loss_W"} <= set(virtual.columns)


def test_python_runs_the_package_as_a_command(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["heatrun", "check", "--nothing"])
    with pytest.raises(SystemExit) as left:
        runpy.run_module("heatrun", run_name="__main__")
    assert left.value.code == 2
    assert "usage: heatrun" in capsys.readouterr().err


HEAPS = """
import ctypes
import sys
import threading
from heatrun.runtime import share_one_heap

if len(sys.argv) > 1:
    share_one_heap()
libc, together = ctypes.CDLL(None), threading.Barrier(4)
libc.malloc.restype, libc.free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
def take():
    together.wait()
    held = libc.malloc(100_000)
    together.wait()
    libc.free(held)
threads = [threading.Thread(target=take) for _ in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
libc.fdopen.restype = ctypes.c_void_p
libc.malloc_info.argtypes = [ctypes.c_int, ctypes.c_void_p]
libc.fflush.argtypes = [ctypes.c_void_p]
out = libc.fdopen(1, b"w")
libc.malloc_info(0, out)
libc.fflush(out)
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_info"), reason="of glibc")
def test_threads_share_one_heap():
    # dask's clusters leave options of the allocator to whatever the process starts afterwards
    usual = {name: said for name, said in os.environ.items() if not name.startswith("MALLOC_")}
    command = [sys.executable, "-c", HEAPS]
    usually, shared = (
        subprocess.check_output([*command, *words], text=True, env=usual).count("<heap nr=")
        for words in ([], ["shared"])
    )
    assert shared == 1 < usually
