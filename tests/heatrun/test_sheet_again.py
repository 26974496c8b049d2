"""The sheet of a run is the same bytes whenever it is made, and all of it is there or nothing."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import pytest

from heatrun import cli
from heatrun.errors import InputError
from heatrun.reports.of_run import rewrite_sheet
from heatrun.runs.run import certificate_of, open_run


@pytest.fixture(scope="module")
def run(finished_day, tmp_path_factory):
    """The run of both orders on a test that is fitted and one that is predicted, copied."""
    return Path(shutil.copytree(finished_day / "run", tmp_path_factory.mktemp("again") / "run"))


def digests(folder: Path) -> dict[str, str]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
    }


def test_the_sheet_of_a_run_is_the_one_that_the_run_wrote(run, tmp_path):
    written = rewrite_sheet(run, tmp_path)
    again, before = digests(tmp_path), digests(run)
    assert set(again) == {str(path.relative_to(tmp_path)) for path in written}
    assert {"sheet.pdf", "sheet.xlsx", "sheet.json", "figures/course_2.png"} <= set(again)
    assert "figures/first_against_second.png" in again
    assert again == {name: before[name] for name in again}


def test_a_sheet_that_was_damaged_is_written_and_listed_again(run):
    before = digests(run)
    (run / "sheet.json").write_text("{}")
    (run / "sheet.pdf").unlink()
    rewrite_sheet(run, run)
    assert digests(run) == before
    listed = json.loads((run / "manifest.json").read_text())["files"]
    assert listed["sheet.pdf"] == before["sheet.pdf"]
    open_run(run)


META = """
number = "2026-0147"
laboratory = "Bench 3"
laboratory_address = "Corso Duca 24, Torino"
customer = "Example Motors"
customer_address = "Via Roma 1, Torino"
serial_number = "SN 0042"
approved_by = "C. Rossi"
performed_at = "laboratory"
country = "IT"
test_from = 2026-03-04
"""


@pytest.fixture
def own_run(run, tmp_path):
    """A copy of the run that a test may write into."""
    return Path(shutil.copytree(run, tmp_path / "run"))


@pytest.fixture
def few_figures(monkeypatch):
    """The figures of the annex are left out: they take longest and say nothing of names."""

    def draw(tables, draws, units, titles, certified, say, folder, attempts):
        folder.mkdir()
        return []

    monkeypatch.setattr("heatrun.reports.of_run.draw", draw)


def identification(folder: Path) -> dict[str, str]:
    rows = json.loads((folder / "sheet.json").read_text())["certificate"]["identification"]
    return dict(rows)


def test_the_run_keeps_what_the_sheet_was_told(own_run, few_figures, tmp_path, capsys):
    meta, other = tmp_path / "meta.toml", tmp_path / "other.toml"
    meta.write_text(META)
    other.write_text('number = "9"\n')
    assert cli.main(["sheet", str(own_run), "--meta", str(meta)]) == 0
    assert identification(own_run)["Certificate number"] == "2026-0147"
    assert certificate_of(open_run(own_run)).customer == "Example Motors"
    told = digests(own_run)
    rewrite_sheet(own_run, own_run)  # into its run again: it changes nothing
    assert digests(own_run) == told
    # elsewhere, other words: the run stays as it is
    rewrite_sheet(own_run, tmp_path / "elsewhere", other)
    assert identification(tmp_path / "elsewhere")["Certificate number"] == "9"
    assert identification(tmp_path / "elsewhere")["Customer"] == ""
    assert digests(own_run) == told


def test_what_the_run_was_told_is_not_replaced_in_silence(own_run, few_figures, tmp_path, capsys):
    meta = tmp_path / "meta.toml"
    meta.write_text('number = "7"\ncustomer = "Example Motors"\n')
    words = ["sheet", str(own_run), "--meta", str(meta)]
    assert cli.main(words) == 0  # blank lines are filled in
    assert f"replaced in {own_run}: sheet.json, sheet.pdf" in capsys.readouterr().err
    told = digests(own_run)
    assert cli.main(words) == 0
    assert "replaced" not in capsys.readouterr().err
    meta.write_text('number = "8"\n')
    assert cli.main(words) == 1
    said = capsys.readouterr().err
    assert "number '7' would become '8', customer 'Example Motors' would be left out" in said
    assert "--out" in said
    assert "--force" in said
    assert digests(own_run) == told
    meta.write_text('number = "7"\ncustomer = "Example Motors"\noperator = "A. B."\n')
    assert cli.main(words) == 0  # nothing is lost by a further line
    meta.write_text('number = "8"\n')
    assert cli.main([*words, "--force"]) == 0
    assert identification(own_run)["Certificate number"] == "8"
    assert "replaced in" in capsys.readouterr().err


def test_the_run_keeps_its_language(own_run, few_figures, tmp_path, capsys):
    words = ["sheet", str(own_run), "--language", "de"]
    assert cli.main([*words, "--out", str(tmp_path / "de")]) == 0
    assert "Zertifikat Nr." in identification(tmp_path / "de")
    assert "Certificate number" in identification(own_run)
    assert cli.main(words) == 0
    told = digests(own_run)
    rewrite_sheet(own_run, own_run)
    assert digests(own_run) == told
    assert "Auftraggeber" in identification(own_run)
    assert cli.main([*words[:2], "--language", "en"]) == 0  # no leave is asked for
    assert "Customer" in identification(own_run)


def test_the_digital_certificate_lies_beside_the_sheet(own_run, few_figures, tmp_path, capsys):
    assert cli.main(["sheet", str(own_run), "--dcc", "--out", str(tmp_path / "no")]) == 1
    assert "Missing: number, laboratory" in capsys.readouterr().err
    assert not (tmp_path / "no").exists()
    meta = tmp_path / "meta.toml"
    meta.write_text(META)
    assert cli.main(["sheet", str(own_run), "--meta", str(meta), "--dcc"]) == 0
    first = (own_run / "dcc.xml").read_bytes()
    assert b"2026-0147" in first
    assert "dcc.xml" in json.loads((own_run / "manifest.json").read_text())["files"]
    # the two never say different things
    meta.write_text(META.replace("0147", "0148"))
    rewrite_sheet(own_run, own_run, meta, is_replacing=True)
    assert b"2026-0148" in (own_run / "dcc.xml").read_bytes()


def test_a_sheet_for_which_there_is_no_room_leaves_no_figure(run, tmp_path, monkeypatch):
    (tmp_path / "sheet.pdf").write_bytes(b"an earlier one")
    drawn = []

    def draw(tables, draws, units, titles, certified, say, folder, attempts):
        folder.mkdir()
        drawn.append(folder / "course_1.png")
        drawn[0].write_bytes(b"a figure")
        return drawn

    def full(*_):
        assert drawn[0].exists()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("heatrun.reports.of_run.draw", draw)
    monkeypatch.setattr("heatrun.reports.of_run.write_xlsx", full)
    with pytest.raises(InputError, match="the sheet cannot be written: No space left"):
        rewrite_sheet(run, tmp_path)
    assert digests(tmp_path) == {"sheet.pdf": hashlib.sha256(b"an earlier one").hexdigest()}
    assert [path.name for path in tmp_path.iterdir()] == ["sheet.pdf"]


def test_a_folder_in_the_place_of_a_file_is_said_before_anything_moves(run, few_figures, tmp_path):
    (tmp_path / "sheet.xlsx").mkdir()
    with pytest.raises(InputError, match="Is a directory"):
        rewrite_sheet(run, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["sheet.xlsx"]
