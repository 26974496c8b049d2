"""The day of a test comes from the clock of its record, and from nothing else."""

from __future__ import annotations

import os
from datetime import datetime

import numpy as np
import pytest

from heatrun.bench.readers.read import read_record

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
