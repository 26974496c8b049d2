"""heatrun never takes what it has written itself for a test."""

import gzip
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xlsxwriter

from heatrun import cli
from heatrun.checks import check_record
from heatrun.errors import InputError
from heatrun.io import own_files
from heatrun.io.own_files import refuse_own_file
from heatrun.motor.file import load_motor
from heatrun.readers.read import read_record
from heatrun_fleet.entries import ALIASES
from heatrun_reports.job import tests_in as bench_tests_in
from heatrun_view.store import Folder

DATA = Path(__file__).parents[2] / "data" / "synthetic"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A day on the bench: one test, and all that the commands write about it beside it."""
    folder = tmp_path_factory.mktemp("bench") / "day"
    folder.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        shutil.copy(DATA / "motor.toml", "motor.toml")
        Path("thesis.toml").write_text(
            "Ceq_w = 666.75\nCeq_sr = 15060.1\nReq_w = 0.14485\nReq_sr = 0.11625\n"
        )
        pd.read_csv(DATA / "step_30min.csv.gz").iloc[::10].to_csv("step.csv", index=False)
        assert cli.main(["simulate", "motor.toml", "thesis.toml", "step.csv"]) == 0
        words = ["export", "thesis.toml", "step.csv", "--motor", "motor.toml", "--to", "mat"]
        assert cli.main(words) == 0
        words = ["report", "--type", "general", "motor.toml", "step.csv", "--out", "reports"]
        assert cli.main(words) == 0
        table = next(Path("reports").glob("*.csv"))
        shutil.copy(table, "renamed.csv")  # the tables of a report, known by what is in them
        Path("step_mat/prova_course.csv").write_text("time_s,winding_degC\n0,20\n1,21\n")
        run = Path("run")
        run.mkdir()
        for name in ("manifest.json", "fit.json"):
            (run / name).write_text("{}")
        (run / "course_1.csv").write_text("time_s,measured_degC,second_parameters_95_low_degC\n")
        (run / "sheet.xlsx").touch()
    return folder


@pytest.fixture
def day(made, tmp_path, monkeypatch):
    shutil.copytree(made, tmp_path / "day")
    monkeypatch.chdir(tmp_path / "day")
    return Path()


def test_a_folder_gives_the_bench_files_alone(day):
    found = bench_tests_in([day])
    assert [str(path) for path in found.tests] == ["step.csv"]
    assert {str(path) for path in found.own} == {
        "run",
        "renamed.csv",
        "step_virtual.csv",
        "step_mat/prova.mat",
        "step_mat/prova_course.csv",
    }


def test_a_report_of_a_folder_says_what_it_leaves_out(day, capsys):
    words = ["report", "--type", "general", "motor.toml", ".", "--out", "again", "--json"]
    assert cli.main(words) == 0
    printed = capsys.readouterr()
    assert [Path(one["file"]).name for one in json.loads(printed.out)["reports"]] == ["step.csv"]
    said = next(line for line in printed.err.splitlines() if "written by heatrun itself" in line)
    for name in ("run", "step_virtual.csv", "prova.mat", "prova_course.csv", "renamed.csv"):
        assert name in said


def test_a_folder_of_nothing_else_is_refused_with_the_reason(day):
    Path("step.csv").unlink()
    with pytest.raises(InputError, match="found none in it but what heatrun has written"):
        bench_tests_in([day])


@pytest.mark.parametrize(
    "words",
    [
        ["calibrate", "motor.toml", "run"],
        ["check", "motor.toml", "run"],
        ["report", "--type", "general", "motor.toml", "run"],
        ["simulate", "motor.toml", "thesis.toml", "run"],
    ],
    ids=lambda words: words[0],
)
def test_a_run_is_no_test(day, capsys, words):
    assert cli.main(words) == 1
    said = capsys.readouterr().err
    assert "run folder of heatrun" in said
    assert "Name the bench file that the run was made from" in said


def test_a_simulated_record_is_said_to_be_none(day, capsys):
    record = read_record("step_virtual.csv", load_motor("motor.toml"))
    found = check_record(record, load_motor("motor.toml"))
    assert [f.severity for f in found if f.id == "simulated_by_heatrun"] == ["warning"]
    measured = read_record("step.csv", load_motor("motor.toml"))
    ids = {finding.id for finding in check_record(measured, load_motor("motor.toml"))}
    assert "simulated_by_heatrun" not in ids


def test_a_bench_s_own_files_are_tests(day):
    table = pd.DataFrame({"time_s": [0.0, 1.0], "winding_degC": [20.0, 21.0]})
    table.to_csv("thermometer.csv", index=False)  # the columns of prova_course.csv
    table.assign(copper_loss_W=1.0, other_loss_W=2.0).to_csv("losses.csv", index=False)
    names = {str(path) for path in bench_tests_in([day]).tests}
    assert names == {"step.csv", "thermometer.csv", "losses.csv"}


@pytest.mark.parametrize("start", [b"", b"\x1f\x8b broken", b"\xff" * 100, b",,,\n", b"\n\n"])
def test_any_bytes_are_no_file_of_ours(start):
    assert own_files.own_file("test.csv", start) is None


@pytest.mark.parametrize(
    ("text", "is_one"),
    [
        ("machine,tests,supplier\nM1,tests/a.csv|tests/b.mf4@10min..20min,north\n", True),
        ("Serial;Test;Role\r\n17;a.csv.gz;holdout\r\n", True),
        ("id\ttype\ttests\n1\tA\tday 1/cold start.csv\n", True),
        ("time_s,test,machine,winding_degC\n0,3,1,21.5\n", False),  # a bench's own numbering
        ("time_s,test,machine,winding_degC\n0,1.5,M1,21.5\n", False),
        ("test,winding_degC\na.csv,20\n", False),
        ("machine,tests\n", False),
    ],
)
def test_a_table_of_machines_is_told_by_the_files_that_it_names(text, is_one):
    assert (own_files.own_file("line.csv", text.encode()) == own_files.MACHINES) is is_one


def test_every_name_of_the_column_of_machines_is_known():
    assert {"machine", *ALIASES} == own_files.MACHINE


def test_rows_of_a_fleet_are_no_tests(tmp_path):
    names = ("machines.parquet", "population.parquet", f"{'0a' * 32}.parquet", "bench.parquet")
    kinds = [own_files.own_file(name, b"PAR1 and more") for name in names]
    assert kinds == [own_files.FLEET] * 3 + [None]
    assert own_files.own_file("machines.parquet", b"time_s,winding_degC\n") is None


def test_a_packed_record_is_known_too(day):
    packed = gzip.compress(Path("step_virtual.csv").read_bytes())
    assert own_files.own_file("step_virtual.csv.gz", packed[:4000]) == own_files.SIMULATION


def test_the_live_view_lists_no_file_of_ours_but_what_is_there_to_be_looked_at(day):
    listing = Folder(day.resolve()).list()
    assert set(listing.tests) == {"step.csv"}
    assert set(listing.simulated) == {"step_virtual.csv"}
    assert listing.num_own == 4  # renamed.csv, the table of the report, prova.mat, its course
    assert np.all([not name.startswith("run") for name in listing.tests])


@pytest.mark.parametrize("name", ["run/course_1.csv", "step_mat/prova.mat", "copy.xlsx"])
def test_a_file_of_ours_given_by_its_name_is_refused(day, capsys, name):
    _workbook(Path("copy.xlsx"), ["Parameters", "Correlation", "Columns", "Residuals", "Findings"])
    for words in (["init", name, "--out", "new.toml"], ["check", "motor.toml", name]):
        if words[0] == "check" and name.endswith(".mat"):
            continue  # the test that it holds may be simulated again
        assert cli.main(words) == 1
        said = capsys.readouterr().err
        assert "Expected a bench file, this is" in said
        assert name in said
    assert not Path("new.toml").exists()
    assert "copy.xlsx" in {str(path) for path in bench_tests_in([day]).own}


def test_a_course_of_a_script_can_be_looked_at_but_makes_no_motor_file(day):
    assert cli.main(["init", "step_mat/prova_course.csv", "--out", "new.toml"]) == 1
    refuse_own_file(Path("step_mat/prova_course.csv"), for_fit=False)
    with pytest.raises(InputError, match="a script of heatrun"):
        refuse_own_file(Path("step_mat/prova_course.csv"), for_fit=True)


def test_a_table_of_machines_is_told_what_it_is_for(day):
    Path("line 3.csv").write_text("machine,tests\nM1,step.csv\n")
    with pytest.raises(InputError, match=r"heatrun fleet 'line 3\.csv'"):
        refuse_own_file(Path("line 3.csv"), for_fit=True)


@pytest.mark.parametrize("content", [b"PK\x03\x04", b"PK\x03\x04" + b"\xff" * 100])
def test_a_damaged_workbook_is_no_file_of_ours(tmp_path, content):
    (tmp_path / "a.xlsx").write_bytes(content)
    refuse_own_file(tmp_path / "a.xlsx", for_fit=True)
    _workbook(tmp_path / "b.xlsx", ["Parameters", "Findings"])  # a bench's own
    refuse_own_file(tmp_path / "b.xlsx", for_fit=True)


def _workbook(path: Path, sheets: list[str]) -> None:
    with xlsxwriter.Workbook(path) as book:
        for name in sheets:
            book.add_worksheet(name)
