"""The sheet of a run: what stands on it, and the same bytes whenever it is made."""

import doctest
import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from msgspec import UNSET
from pypdf import PdfReader

from heatrun import calibration, cli
from heatrun.calibration import Settings, load_tests
from heatrun.errors import InputError
from heatrun.io.texts import LANGUAGES, Texts
from heatrun.motor.file import load_motor
from heatrun.posterior.posterior import normal_draws
from heatrun.record.record import ColumnReading
from heatrun.reports import printed as digits
from heatrun.reports.certificate import figure_lines, parameter_lines
from heatrun.reports.figures import certificate_figure
from heatrun.reports.of_run import rewrite_sheet, write_sheet
from heatrun.reports.pdf import FLATTEST
from heatrun.results import to_json
from heatrun.results.values import combined
from heatrun.runs.run import certificate_of, open_run
from heatrun.runs.run_folder import RunFolder
from heatrun.runs.write import write_run

HOSTILE = '=HYPERLINK("x") #panic() $a_1$ *b* \\ <script> \x1b[31m שלום @import "/etc/passwd"'


@pytest.fixture(scope="module")
def found(finished_day):
    """A calibration whose names are as bad as a user can make them.

    What other tests assert and takes long is left out: the search for effects and the samples,
    which stand behind the same figures of the sheet. The test is that of the shared run, so that
    nothing new is compiled for its fit.
    """
    motor = load_motor(finished_day / "motor.toml")
    (duty,) = load_tests(motor, [finished_day / "duty.csv"])
    column = ColumnReading("time_s", HOSTILE, "s", "assumed", "names of the time", "a.csv")
    named = replace(duty.record, name=HOSTILE, mapping=(column,), start="2026-03-04")
    evil = replace(motor, name=HOSTILE)
    tests = [replace(duty, record=named, blocks=replace(duty.blocks, name=HOSTILE), findings=())]
    with pytest.MonkeyPatch.context() as patch:
        for name in ("find", "small_effects"):
            patch.setattr(calibration, name, lambda *_, **__: None)
        patch.setattr(calibration, "sample", lambda fit, seed, **_: normal_draws(fit, seed=seed))
        settings = Settings(networks=["second"], method="quick", command=HOSTILE)
        return calibration.calibrate(evil, tests, settings)


@pytest.fixture(scope="module")
def folder(found, tmp_path_factory):
    run = RunFolder.begin(tmp_path_factory.mktemp("sheet") / "run", {})
    whole = write_run(run, found.motor, found.result, found.posteriors, found.predictions)
    write_sheet(whole, run.partial)
    return run.partial


def test_the_result_is_valid_json_without_nan(found):
    assert json.loads(to_json(found.result))["format"] == "heatrun-fit/1"


def test_the_day_of_the_record_stands_on_the_sheet(folder):
    content = json.loads((folder / "sheet.json").read_text())
    assert ["Date of test", "2026-03-04"] in content["certificate"]["identification"]
    assert content["certificate"]["dates"]["test_from"] == "2026-03-04"


def test_names_do_not_act_as_markup_in_the_pdf(folder):
    text = "".join(page.extract_text() for page in PdfReader(folder / "sheet.pdf").pages)
    flat = "".join(text.split())
    for word in ("#panic()", "$a_1$", "*b*", "<script>", "@import"):
        assert word in flat
    assert "\x1b" not in text
    assert "Ceq_w" in text


def test_the_sheet_says_how_columns_were_read(folder, found):
    text = "".join(page.extract_text() for page in PdfReader(folder / "sheet.pdf").pages)
    assert "Unit assumed for time_s" in " ".join(text.split())
    (row,) = found.result.tests[0].mapping
    assert (row.channel, row.unit, row.unit_from) == ("time_s", "s", "assumed")
    cells = list(openpyxl.load_workbook(folder / "sheet.xlsx")["Columns"].values)
    assert cells[1][1:5] == ("time_s", HOSTILE.replace("\x1b", "_x001B_"), "s", "ASSUMED")


def test_the_workbook_holds_the_derived_figures(folder, found):
    head, *rows = openpyxl.load_workbook(folder / "sheet.xlsx")["Derived"].values
    assert head[:3] == ("figure", "value", "unit")
    by_name = {row[0]: row for row in rows}
    (model,) = found.result.models.values()
    for name, entry in model.derived.items():
        row = by_name.pop(name)
        if entry.refused is not UNSET:
            assert (row[1], row[5]) == (None, entry.refused)
        else:
            assert (row[1], row[2]) == (pytest.approx(entry.value), entry.unit)
            assert row[3:5] == pytest.approx(entry.interval_95)
    assert not by_name


def test_the_workbook_holds_the_budgets(folder, found):
    (model,) = found.result.models.values()
    rows = [*openpyxl.load_workbook(folder / "sheet.xlsx", data_only=True)["Budget"].values]
    lines = [*parameter_lines(model), *figure_lines(model)]
    lines = [line for line in lines if line.budget]
    told = json.loads((folder / "sheet.json").read_text())["budget"]["rows"]
    assert [row[0] for row in told] == [line.name for line in lines]
    assert {"Ceq_w", "Rs0", "tau_slow", "steady_rise"} <= {line.name for line in lines}
    for line in lines:
        title, _, *own = rows[: len(line.budget) + 4]
        rows = rows[len(line.budget) + 5 :]
        assert title[0] == f"{line.name}: {line.meaning}"
        for row, said in zip(own, line.budget, strict=False):
            assert row[:2] == (said.source, said.type)
            assert row[5:] == pytest.approx((said.contribution, said.share))
        total, by_draws = own[-2:]
        assert total[5] == pytest.approx(combined(line.budget))
        assert by_draws[5] == pytest.approx(line.sd)
    assert not rows


def test_the_workbook_draws_the_course_from_its_cells(folder):
    book = openpyxl.load_workbook(folder / "sheet.xlsx")
    sheet = book["Course 1"]
    (chart,) = sheet._charts  # openpyxl reads charts back, and has no other name for them
    drawn = [series.yVal.numRef.f for plot in (chart, *chart._charts) for series in plot.series]
    assert sorted(set(drawn)) == [f"'Course 1'!${c}$4:${c}${sheet.max_row}" for c in "BCD"]
    assert sheet["D4"].value == "=B4-C4"
    held = openpyxl.load_workbook(folder / "sheet.xlsx", data_only=True)["Course 1"]
    table = pd.read_csv(folder / "course_1.csv")
    shown = np.array([row[3] for row in held.iter_rows(min_row=4, values_only=True)], dtype=float)
    np.testing.assert_allclose(shown, table["second_residual_K"], atol=1e-9)


def test_names_are_no_formulas_in_the_workbook(folder):
    book = openpyxl.load_workbook(folder / "sheet.xlsx")
    for sheet in book:
        for row in sheet.iter_rows():
            for cell in row:
                if cell.data_type == "f":
                    assert sheet.title in ("Worksheet", "Course 1", "Budget")
                    assert "HYPERLINK" not in cell.value
    assert book["Parameters"]["A1"].value.startswith("=HYPERLINK")
    assert book["Parameters"]["A1"].data_type == "s"


def test_the_worksheet_of_the_workbook_is_that_of_its_test(folder, found):
    """Its formulas are held against the published sheet in `test_worksheet.py`."""
    values = openpyxl.load_workbook(folder / "sheet.xlsx", data_only=True)["Worksheet"]
    formulas = openpyxl.load_workbook(folder / "sheet.xlsx")["Worksheet"]
    rows = [[cell.value for cell in row[:13]] for row in values.iter_rows(min_row=12)]
    rows = np.array([row for row in rows if row[5] is not None], dtype=float)
    Rs0 = found.result.models["second"].parameters["Rs0"].value
    copper = 3 * rows[:, 7] ** 2 * Rs0 * (234.5 + rows[:, 1]) / (234.5 + 25.0)
    np.testing.assert_allclose(rows[:, 9], copper, rtol=1e-12)
    np.testing.assert_allclose(rows[:, 10], rows[:, 4] - copper, atol=1e-9)
    assert formulas["J20"].value == "=$E$6*H20^2*I20"


def test_parameters_carry_their_uncertainty(folder, found):
    book = openpyxl.load_workbook(folder / "sheet.xlsx")["Parameters"]
    row = next(row for row in book.iter_rows(values_only=True) if row[0] == "Ceq_w")
    entry = found.result.models["second"].parameters["Ceq_w"]
    assert row[1] == pytest.approx(entry.value)
    assert row[4] == pytest.approx(2 * entry.sd)
    assert row[9] == "identified"


def test_numbers_of_the_worksheet_have_the_digits_of_the_sheet(folder):
    book = openpyxl.load_workbook(folder / "sheet.xlsx")
    (shown,) = [row for row in book["Parameters"].iter_rows() if row[0].value == "Req_w"]
    sheet = book["Worksheet"]
    (cell,) = [row[11] for row in sheet.iter_rows() if row[10].value == "Req_w [K/W]"]
    assert cell.number_format == shown[1].number_format != "General"
    numbers = [cell for row in sheet.iter_rows(min_row=12, max_row=14) for cell in row
               if cell.value is not None]  # fmt: skip
    assert {cell.number_format for cell in numbers} == {"0.0", "0.00", "0.0000", "0.000000"}


def test_digits_follow_the_uncertainty():
    assert doctest.testmod(digits).failed == 0
    assert digits.format_value(0.145012, 0.00093) == ("0.14501", "0.00093")
    assert digits.format_value(float("nan"), 1.0)[0] == "not determined"


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


@pytest.mark.parametrize("language", LANGUAGES)
def test_labels_of_a_flat_figure_stay_beside_their_panels(language):
    time_s = np.arange(0.0, 3600.0, 60.0)
    course = 20.0 + time_s / 60.0
    table = pd.DataFrame({
        "time_s": time_s, "measured_degC": course + 1.0, "sink_degC": 20.0 + 0.0 * time_s,
        "second_winding_degC": course, "second_total_95_low_degC": course - 2.0,
        "second_total_95_high_degC": course + 2.0, "second_residual_K": 1.0 + 0.0 * time_s,
    })  # fmt: skip
    limits = [("class F", 155.0), ("rise", 125.0)]
    drawn = certificate_figure("duty", table, ("second", "x"), limits, Texts(language), FLATTEST)
    FigureCanvasAgg(drawn).draw()
    upper, lower = (axis.yaxis.label.get_window_extent() for axis in drawn.axes)
    assert not upper.overlaps(lower)
    assert min(upper.x0, lower.x0) >= 0.0
