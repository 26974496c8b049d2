"""The three files of a report are there together or not at all, and no two reports share a name."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from heatrun.io.file_set import FileSet
from heatrun.record.motor import Motor
from heatrun_reports import job, make_report
from heatrun_reports.report_name import set_name

CAR = Motor("car", gear_ratio=9.1, wheel_radius_m=0.3)
STEM = "GeneralInformationTest_2022_12_07_001"
ENDS = (".csv", ".json", ".pdf")


@pytest.fixture
def test_file(tmp_path):
    path = tmp_path / "Test_2022_12_07_001.csv"
    rows = [f"{t},100,10,36,{20 + t}" for t in (0, 10, 20, 30)]
    head = "time_s,dc_voltage_V,dc_current_A,vehicle_speed_km_per_h,winding_degC"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def report(path: Path, out: Path):
    (outcome,) = make_report("general", CAR, [path], out)
    return outcome


@pytest.mark.parametrize("step", ["write_pdf", "csv_table", "to_json"])
def test_a_full_disk_leaves_the_earlier_report_and_no_piece(step, test_file, tmp_path, monkeypatch):
    out = tmp_path / "out"
    assert report(test_file, out).error is None
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(job, step, full)
    outcome = report(test_file, out)
    assert "the report cannot be written: No space left" in str(outcome.error)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert "No space left" in str(report(test_file, tmp_path / "new").error)
    assert not list((tmp_path / "new").iterdir())


def test_a_killed_report_leaves_nothing_that_looks_like_one(test_file, tmp_path):
    out = tmp_path / "out"
    program = (
        "import os, signal, sys, pathlib\n"
        "from heatrun.record.motor import Motor\n"
        "from heatrun_reports import job, make_report\n"
        "job.csv_table = lambda report: os.kill(os.getpid(), signal.SIGKILL)\n"
        f"make_report('general', Motor('car'), [pathlib.Path({str(test_file)!r})], "
        f"pathlib.Path({str(out)!r}))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert done.returncode == -9
    assert all(path.name.startswith(".") for path in out.iterdir())
    assert report(test_file, out).error is None
    assert sorted(path.name for path in out.iterdir()) == [STEM + end for end in ENDS]


def test_the_mark_that_an_earlier_version_left_is_taken_over(test_file, tmp_path):
    first = report(test_file, tmp_path / "out")
    identity = json.loads(first.json.read_text())["identity"]
    left = tmp_path / "left"
    left.mkdir()
    (left / f"{STEM}.json").write_text(json.dumps({"identity": identity}))
    assert report(test_file, left).pdf.name == f"{STEM}.pdf"
    assert sorted(path.name for path in left.iterdir()) == [STEM + end for end in ENDS]


def test_a_name_that_another_process_has_begun_is_taken_unless_it_is_the_same_report(
    test_file, tmp_path
):
    out = tmp_path / "out"
    other = FileSet.begin(out, set_name(STEM, ["another test"]))
    first = report(test_file, out)
    assert first.pdf.name == f"{STEM}-2.pdf"
    other.drop()
    identity = json.loads(first.json.read_text())["identity"]
    new = tmp_path / "new"
    same = FileSet.begin(new, set_name(STEM, identity))
    assert report(test_file, new).pdf.name == f"{STEM}.pdf"
    same.drop()
    assert sorted(path.name for path in new.iterdir()) == [STEM + end for end in ENDS]
