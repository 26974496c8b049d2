"""Excel workbooks: titles, units, merged cells, dates, sheets."""

import gzip
import io
import json
import zipfile
from datetime import datetime, time, timedelta
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
import xlsxwriter
from hypothesis import given
from hypothesis import strategies as st

from heatrun import cli
from heatrun.errors import InputError
from heatrun.readers.joined import read_test
from heatrun.readers.read import read_raw, read_record
from heatrun.readers.workbook import as_text
from heatrun.record.motor import Motor
from heatrun.runs.run_folder import as_named

DATA = Path(__file__).parents[2] / "data" / "synthetic"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "bench.xlsx"


def saved(path: Path, *rows, title: str = "Test") -> openpyxl.Workbook:
    """Write rows into the first sheet of a new workbook."""
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    sheet.title = title
    for row in rows:
        sheet.append(row)
    book.save(path)
    return book


HEAD = ("time_s", "winding_degC", "phase_current_A")
ROWS = ((0, 20.5, 10.25), (1, 21.125, 10.5), (2, 22, 0.1 + 0.2))


def test_titles_units_and_an_empty_first_column(path):
    saved(
        path,
        (None, "Prüfstand 3", None, None, 21.5),
        (None, "Ambient mean", 19.36),
        (),
        (None, "time", "T_wdg", "P_loss"),
        (None, "min", "°F", "kW"),
        *((None, 0.5 * i, 68.0 + 9.0 * i, 1.5 + 0.25 * i) for i in range(6)),
    )
    motor = Motor("M", columns={"winding_degC": "T_wdg", "losses_W": "P_loss"})
    record = read_record(path, motor)
    step = np.arange(6)
    np.testing.assert_allclose(record.time_s, 30.0 * step, rtol=1e-12)
    np.testing.assert_allclose(record["winding_degC"], 20.0 + 5.0 * step, rtol=1e-12)
    np.testing.assert_allclose(record["losses_W"], 1500.0 + 250.0 * step, rtol=1e-12)
    assert "Preamble: Ambient mean 19.36" in record.notes


SAMPLES = [(i, 20.5 + i, 1) for i in range(5)]


@pytest.mark.parametrize(
    ("head", "merged", "columns"),
    [
        ([("time [s]", "Temperatures", None), (None, "winding", "housing")], ["A1:A2", "B1:C1"],
         {"time [s]": "s", "winding": None, "housing": None}),
        ([("time", "winding", "state"), ("s", "°C", None)], ["C1:C2"],
         {"time": "s", "winding": "°C", "state": None}),
    ],
    ids=["over two rows of names", "over the row of units"],
)  # fmt: skip
def test_merged_names_keep_their_column(path, head, merged, columns):
    book = saved(path, *head, *SAMPLES)
    for cells in merged:
        book.worksheets[0].merge_cells(cells)
    book.save(path)
    assert {column.name: column.unit for column in read_raw(path).columns} == columns


@pytest.mark.parametrize(
    "times",
    [
        [datetime(2025, 11, 20, 18, 2, 33) + timedelta(milliseconds=500 * i) for i in range(4)],
        [time(18, 2, 33), time(18, 2, 33, 500000), time(18, 2, 34), time(18, 2, 34, 500000)],
        [timedelta(hours=30, milliseconds=500 * i) for i in range(4)],
    ],
    ids=["dates", "times of day", "durations"],
)
def test_dates_and_times_are_seconds(path, times):
    saved(path, ("Time", "winding_degC"), *zip(times, (20.0, 20.5, 21.0, 21.5), strict=True))
    np.testing.assert_allclose(read_record(path).time_s, [0.0, 0.5, 1.0, 1.5], atol=1e-6)


@pytest.mark.parametrize("stated", ["hh:mm:ss", "h:m:s", "TT.MM.JJJJ hh:mm"])
def test_cells_that_are_dates_need_no_format(path, stated):
    times = [datetime(2025, 3, 4, 9, 59, 30 + i) for i in range(4)]
    saved(path, ("Uhrzeit", "Wicklung"), (stated, "°C"), *((one, 20.0) for one in times))
    for columns in ({}, {"time_s": "Uhrzeit [hh:mm:ss]"}):
        record = read_record(path, Motor("M", columns=columns))
        np.testing.assert_array_equal(record.time_s, [0.0, 1.0, 2.0, 3.0])


def test_a_clock_that_passes_midnight_in_a_column_of_times(path):
    book = saved(path, ("Time", "winding_degC"))
    sheet = book.worksheets[0]
    for i in range(4):
        sheet.append((1.0 + (i - 2) * 10.0 / 86400.0, 20.0 + i))
        sheet.cell(i + 2, 1).number_format = "hh:mm:ss"
    book.save(path)
    np.testing.assert_allclose(read_record(path).time_s, [0.0, 10.0, 20.0, 30.0], atol=1e-3)


def test_numbers_as_text_have_their_decimal_comma(path):
    saved(path, HEAD, (0.5, "20,5", 10.25), (1.5, "21,25", 10.5), (2.5, "22", 0.125))
    record = read_record(path)
    assert record["winding_degC"].tolist() == [20.5, 21.25, 22.0]
    assert record["phase_current_A"].tolist() == [10.25, 10.5, 0.125]


def test_three_decimals_are_a_question_in_a_text_cell_and_none_in_a_number(path):
    saved(path, ("time_s", "losses_W"), (0, 4.125), (1, 4.625))
    assert read_record(path)["losses_W"].tolist() == [4.125, 4.625]
    saved(path, ("time_s", "losses_W"), (0.5, "4,500"), (1.5, "4,625"))
    with pytest.raises(InputError, match=r"'4,500' may be 4\.5 or 4500"):
        read_record(path)
    assert read_record(path, Motor("M", decimal="."))["losses_W"].tolist() == [4500.0, 4625.0]
    assert read_record(path, Motor("M", decimal=","))["losses_W"].tolist() == [4.5, 4.625]


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_reads_back_as_itself(value):
    text = as_text(value, datetime(1899, 12, 30))
    assert float(text) == value
    assert "." not in text


def test_blank_rows_and_errors_are_missing_samples(path):
    rows = [(i, 20.0 + i, 10.0) for i in range(30)]
    rows[4] = (4, "#DIV/0!", 10.0)
    rows[7] = ()
    saved(path, HEAD, *rows)
    record = read_record(path)
    assert record.time_s.size == 29
    assert np.isnan(record["winding_degC"][4])
    assert {finding.id for finding in record.findings} >= {"unreadable_cells", "rows_missing"}


def formulas(path: Path, **options) -> None:
    book = xlsxwriter.Workbook(path)
    sheet = book.add_worksheet("Test")
    sheet.write_row(0, 0, ("time_s", "winding_degC"))
    for i in range(4):
        sheet.write_number(i + 1, 0, i)
        sheet.write_formula(i + 1, 1, f"=A{i + 2}+20", **({"value": 20 + i} if options else {}))
    book.close()


def test_a_formula_is_the_value_that_the_workbook_keeps(path):
    formulas(path, value=True)
    assert read_record(path)["winding_degC"].tolist() == [20.0, 21.0, 22.0, 23.0]


def test_a_formula_never_calculated_is_refused(path):
    formulas(path)  # xlsxwriter writes 0 for each
    with pytest.raises(InputError, match="Cell B2 of sheet 'Test' holds a formula"):
        read_record(path)
    saved(path, ("time_s", "winding_degC"), *((i, f"=A{i + 2}+20") for i in range(4)))
    with pytest.raises(InputError, match=r"never calculated\. Open the workbook in Excel"):
        read_record(path)


def two_tests(path: Path) -> None:
    with pd.ExcelWriter(path, engine="openpyxl") as writer:
        for name, start in (("Cold start", 20.0), ("Warm start", 60.0)):
            made = pd.DataFrame(ROWS, columns=HEAD)
            made["winding_degC"] += start
            made.to_excel(writer, sheet_name=name, index=False)


def test_the_sheet_with_the_channels_is_read_and_the_others_named(path):
    book = saved(path, ("point", "value"), (1, 2), (3, 4), title="Points")
    sheet = book.create_sheet("Log")
    for row in (HEAD, *ROWS):
        sheet.append(row)
    book.create_sheet("Notes")["A1"] = "nothing"
    book.save(path)
    record = read_record(path)
    assert record.sources[0].reader == "Excel, sheet 'Log'"
    (finding,) = [one for one in record.findings if one.id == "sheet_chosen"]
    assert "'Points'" in finding.message
    assert "Notes" not in finding.message


def test_several_tests_in_one_workbook_are_named(path):
    two_tests(path)
    with pytest.raises(InputError, match="'Cold start' and 'Warm start' may each be the test") as e:
        read_record(path)
    assert f"{path}#Cold start" in e.value.remedy
    record = read_test(f"{path}#Warm start", Motor("M"))
    assert record.name == "bench_Warm start"
    assert record["winding_degC"][0] == 80.5
    with pytest.raises(InputError, match=r"no sheet 'Worm start'\. Did you mean 'Warm start'"):
        read_test(f"{path}#Worm start", Motor("M"))


def test_columns_may_name_the_sheet(path):
    two_tests(path)
    motor = Motor("M", columns={"winding_degC": "Warm start/winding_degC"})
    record = read_record(path, motor)
    assert record["winding_degC"][0] == 80.5
    assert "phase_current_A" in record


def test_a_run_finds_the_sheet_that_each_test_was():
    command = "heatrun calibrate m.toml 'a b.xlsx#Cold start' 'a b.xlsx#Warm start' x.csv@10Hz"
    assert as_named("a b.xlsx", "a b_Warm start", command) == "a b.xlsx#Warm start"
    assert as_named("a b.xlsx", "a b_Cold start", command) == "a b.xlsx#Cold start"
    assert as_named("x.csv", "x", command) == "x.csv@10Hz"
    assert as_named("y.csv", "y", command) == "y.csv"


def test_a_sheet_of_what_is_no_workbook_is_refused(path):
    path.write_text("time_s,winding_degC\n0,20\n1,21\n")
    with pytest.raises(InputError, match="the file is no Excel workbook"):
        read_test(f"{path}#Test", Motor("M"))


def test_other_archives_are_refused(path):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("test.csv", "a,b\n1,2\n")
    with pytest.raises(InputError, match="got a zip archive or another spreadsheet"):
        read_record(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("xl/workbook.bin", b"")
    with pytest.raises(InputError, match="got a binary workbook"):
        read_record(path)


def test_a_far_cell_is_no_reason_to_fill_memory(path):
    book = saved(path, HEAD, *ROWS)
    book.worksheets[0]["XFD4"] = "remark"
    book.save(path)
    assert read_record(path)["winding_degC"].tolist() == [20.5, 21.125, 22.0]


@pytest.fixture(scope="module")
def whole() -> bytes:
    held = io.BytesIO()
    saved(held, HEAD, *((i, 20.0 + i, 10.0) for i in range(40)))
    return held.getvalue()


@pytest.mark.parametrize("share", [0.01, 0.2, 0.5, 0.8, 0.99])
def test_a_cut_workbook_is_refused(whole, path, share):
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match="could not be read"):
        read_record(path)


def with_part(whole: bytes, name: str, old: bytes, new: bytes) -> bytes:
    """Return the workbook with something else in one of its parts."""
    held = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as source, zipfile.ZipFile(held, "w") as target:
        for one in source.infolist():
            part = source.read(one)
            if one.filename == name:
                assert old in part
                part = part.replace(old, new)
            target.writestr(one, part)
    return held.getvalue()


SHEET = "xl/worksheets/sheet1.xml"


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        (SHEET, b"</sheetData>", b""),
        (SHEET, b"<v>20</v>", b"<v>twenty</v>"),
        (SHEET, b't="inlineStr"><is><t>time_s</t></is>', b't="s"><v>999</v>'),
        (SHEET, b'r="A3"', b'r="3A"'),
        (SHEET, b'<row r="5"', b'<row r="99999999999"'),
        ("xl/workbook.xml", b"<sheets>", b"<sheets><sheets>"),
        ("xl/_rels/workbook.xml.rels", b"sheet1.xml", b"sheet9.xml"),
        ("xl/styles.xml", b"<cellXfs", b"<cellYfs"),
    ],
)  # fmt: skip
def test_parts_that_contradict_each_other_give_a_message(whole, path, name, old, new):
    path.write_bytes(with_part(whole, name, old, new))
    with pytest.raises(InputError):
        read_record(path)


def test_entities_do_not_grow(whole, path):
    bomb = (
        b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaaaaaaaaaaaa">'
        + b"".join(b'<!ENTITY %c "%s">' % (98 + i, b"&%c;" % (97 + i) * 20) for i in range(8))
        + b"]><worksheet>&i;</worksheet>"
    )
    with zipfile.ZipFile(io.BytesIO(whole)) as source:
        sheet = source.read(SHEET)
    path.write_bytes(with_part(whole, SHEET, sheet, bomb))
    with pytest.raises(InputError):
        read_record(path)


def test_init_and_check_take_a_workbook(tmp_path, path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with gzip.open(DATA / "duty_90min.csv.gz", "rt") as file:
        table = pd.read_csv(file).iloc[::10]
    table.to_excel(path, index=False, startrow=3)
    assert cli.main(["init", "bench.xlsx", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["tests"][0]["reader"] == "Excel, sheet 'Sheet1'"
    assert cli.main(["check", "motor.toml", "bench.xlsx"]) == 0
