"""The day of a test comes from its record, the clock or the header, and from nothing else."""

from __future__ import annotations

import os
from datetime import datetime

import numpy as np
import pytest

from heatrun.readers.header_date import header_day
from heatrun.readers.read import read_record

HEAD = "time,current [A],losses [W],ambient [degC],winding [degC]\n"


def record_of(tmp_path, cells, name="t.csv"):
    path = tmp_path / name
    path.write_text(HEAD + "".join(f"{cell},10,100,20,{30 + i}\n" for i, cell in enumerate(cells)))
    os.utime(path, (946684800, 946684800))  # 1 January 2000: the file's own time is no date
    return read_record(path)


@pytest.mark.parametrize(
    ("cells", "day"),
    [
        ([f"2026-03-04 10:00:0{i}" for i in range(5)], "2026-03-04"),
        ([f"04.03.2026 10:00:0{i}" for i in range(5)], "2026-03-04"),
        ([f"03/24/2026 10:00:0{i}" for i in range(5)], "2026-03-24"),
        ([f"4-Mar-2026 10:00:0{i}" for i in range(5)], "2026-03-04"),
        ([f"20260304T10000{i}" for i in range(5)], "2026-03-04"),
        # 4 March or 3 April: the times are the same, the day is not known
        ([f"04/03/2026 10:00:0{i}" for i in range(5)], ""),
        # the same day either way
        ([f"03/03/2026 10:00:0{i}" for i in range(5)], "2026-03-03"),
        # a clock that was never set
        ([f"1970-01-01 10:00:0{i}" for i in range(5)], ""),
        ([f"10:00:0{i}" for i in range(5)], ""),
        ([f"{i}.0" for i in range(5)], ""),
        # over midnight: the first day
        (["2026-03-04 23:59:59", "2026-03-05 00:00:00", "2026-03-05 00:00:01"], "2026-03-04"),
    ],
)
def test_the_day_is_that_of_the_first_time(tmp_path, cells, day):
    assert record_of(tmp_path, cells).start == day


def test_a_name_with_a_date_and_the_time_of_the_file_are_no_clock(tmp_path):
    assert record_of(tmp_path, [f"{i}" for i in range(5)], "duty_2026_03_04.csv").start == ""


def test_parquet_and_excel_say_it_too(tmp_path):
    pandas = pytest.importorskip("pandas")
    times = pandas.date_range("2026-03-04 10:00", periods=5, freq="s")
    table = pandas.DataFrame(
        {"time": times, "winding_degC": np.arange(5.0), "losses_W": np.full(5, 100.0)}
    )
    table.to_parquet(tmp_path / "t.parquet")
    assert read_record(tmp_path / "t.parquet").start == "2026-03-04"
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["time", "winding_degC", "losses_W"])
    for i in range(5):
        sheet.append([datetime(2026, 3, 4, 10, 0, i), 30.0 + i, 100.0])
    book.save(tmp_path / "t.xlsx")
    assert read_record(tmp_path / "t.xlsx").start == "2026-03-04"


@pytest.mark.parametrize(
    ("lines", "day"),
    [
        (["Datum: 04.03.2025"], "2025-03-04"),
        (["Datum: 05.03.25"], "2025-03-05"),
        (["Date;2025-03-04 08:15:00;;"], "2025-03-04"),
        (["Start: 20/11/2025 18:02:33 End: 21/11/2025"], "2025-11-20"),
        (["Date of test: 4 March 2025"], "2025-03-04"),
        (["Messdatum 20250304"], "2025-03-04"),
        (["2025-03-04 08:15", "Operator: 3"], "2025-03-04"),
        (["Date: 03/04/2025"], ""),  # March or April
        (["Date: 04/04/2025"], "2025-04-04"),
        (["Kalibriert: 01.02.2023", "Bench 3, software of 02.02.2024"], ""),
        (["Exportdatum: 06.03.2025", "Datum: 04.03.2025"], "2025-03-04"),
        (["Datum: 31.02.2025", "Date: 1970-01-01"], ""),
        (["Serial 2025-03-04-77", "Version 10.12.2024"], ""),
        (["Prüfstand 3", "Ende: 05.03.2025"], ""),
    ],
)
def test_a_line_above_the_table_says_the_day_where_it_speaks_of_the_test(lines, day):
    assert header_day(lines).day == day


def test_two_days_in_a_header_are_none_and_said():
    found = header_day(["Datum: 04.03.2025", "Start: 05.03.2025"])
    assert found.day == ""
    assert "2025-03-04, 2025-03-05" in found.note


def test_the_header_dates_a_record_whose_clock_does_not(tmp_path):
    path = tmp_path / "t.csv"
    rows = "".join(f"{i},10,100,20,{30 + i}\n" for i in range(5))
    path.write_text("Bench 3\nDatum: 04.03.2025\n" + HEAD.replace("time", "time [s]") + rows)
    record = read_record(path)
    assert (record.start, record.start_from) == ("2025-03-04", "header of the file")
    assert any("by the line 'Datum: 04.03.2025'" in note for note in record.notes)
    dated = record_of(tmp_path, [f"2026-03-04 10:00:0{i}" for i in range(5)])
    assert dated.start_from == "clock of the record"


def test_title_rows_of_a_sheet_say_it_too(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["Date", datetime(2026, 3, 4)])
    book.active.append(["time [s]", "winding_degC", "losses_W"])
    for i in range(5):
        book.active.append([i, 30.0 + i, 100.0])
    book.save(tmp_path / "t.xlsx")
    assert read_record(tmp_path / "t.xlsx").start == "2026-03-04"
