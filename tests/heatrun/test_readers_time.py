"""Clock times, dates, the day of a test, and the grid behind 32-bit times."""

import os
from datetime import datetime

import numpy as np
import pandas as pd
import pytest
from openpyxl import Workbook

from heatrun.checks import check_record
from heatrun.errors import InputError
from heatrun.readers.clock import parse_time_format, read_clock, stated_format
from heatrun.readers.dates import header_day, read_dates
from heatrun.readers.read import read_record
from heatrun.readers.text.reader import read_text
from heatrun.record.motor import Motor
from heatrun.record.raster import counted_from, exact_grid, from_first_sample


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        (["0:00.0", "0:00.7", "2:13.2"], [0.0, 0.7, 133.2]),
        (["59:59.5", "1:00:00.0"], [3599.5, 3600.0]),
        (["75:12,25", "75:13"], [4512.25, 4513.0]),
        (["1:59:59.999", "25:00:00.000"], [7199.999, 90000.0]),
    ],
)
def test_clock_times(cells, seconds):
    assert read_clock(pd.Series(cells)).numbers.tolist() == seconds


def test_clock_times_that_are_none():
    seconds = read_clock(pd.Series(["0:00.0", "1:75:00", "noon"])).numbers
    assert np.isnan(seconds).tolist() == [False, True, True]


@pytest.mark.parametrize(
    ("cells", "seconds", "order"),
    [
        (["2025-11-20T18:02:33.123Z", "2025-11-20T18:02:33.223Z"], [0, 0.1], "year-month-day"),
        (["2025-11-20 23:59:59,5", "2025-11-21 00:00:00,0"], [0, 0.5], "year-month-day"),
        (["20/11/2025 18:02:33.0", "21/11/2025 18:02:33.0"], [0, 86400], "day/month/year"),
        (["11/20/2025 11:59:59 PM", "11/21/2025 12:00:00 AM"], [0, 1], "month/day/year"),
        (["05.11.2025 18:02", "06.11.2025 18:03"], [0, 86460], "day/month/year"),
        # On one day the order makes no difference, with a short year neither
        (["01/02/25 23:59:58", "01/02/25 23:59:59"], [0, 1], "makes no difference"),
        # The other orders run backwards, or skip a year
        (["12/01/2025 23:59:59", "01/02/2026 00:00:00"], [0, 31 * 86400 + 1], "month/day/year"),
        (["25-11-20 23:59:59", "25-11-21 00:00:00"], [0, 1], "year-month-day"),
        (["20-11-25 23:59:59", "21-11-25 00:00:00"], [0, 1], "day/month/year"),
        (["31/12/25 23:59:59", "01/01/26 00:00:00"], [0, 1], "day/month/year"),
        # Clocks go back on this night; the zone tells
        (["2025-10-26T02:59:59+02:00", "2025-10-26T02:00:00+01:00"], [0, 1], "year-month-day"),
    ],
)
def test_dates(cells, seconds, order):
    column = read_dates(pd.Series(cells))
    assert column.numbers.tolist() == seconds
    assert order in column.note


@pytest.mark.parametrize(
    ("cells", "first", "second"),
    [
        # Neither number is above 12, and both orders run forward
        (["01/02/2025 23:59:59", "02/02/2025 00:00:01"], "2 s in all", "30 days in all"),
        (["02/01/2025 23:59:59", "02/02/2025 00:00:01"], "30 days in all", "2 s in all"),
        (["05/06/25 10:00", "05/07/25 10:00"], "30 days in all", "24 h in all"),
    ],
)
def test_dates_of_two_readings_are_a_question(cells, first, second):
    column = read_dates(pd.Series(cells), "Time")
    assert column.question is not None
    assert f"day/month/year ({first})" in column.question.problem
    assert f"month/day/year ({second})" in column.question.problem
    for answer in column.question.answers:
        stated = parse_time_format(answer.removeprefix("Time [").removesuffix("]"))
        assert stated is not None
        answered = read_dates(pd.Series(cells), "Time", stated.order)
        assert answered.question is None
        assert "as stated" in answered.note


def test_a_day_that_is_none():
    seconds = read_dates(pd.Series(["30/01/2025 00:00:00", "30/02/2025 00:00:00"])).numbers
    assert np.isnan(seconds).tolist() == [False, True]


@pytest.mark.parametrize("start", [0.0, 1.1, 512.3])
@pytest.mark.parametrize("step", [0.1, 0.3, 0.02])
def test_grid_behind_32_bit_times(start, step):
    index = np.arange(18_000)
    stored = (np.float32(start) + (index * step).astype(np.float32)).astype(np.float32)
    times, *_ = from_first_sample(stored.astype(float))
    grid, note = exact_grid(times)
    assert np.array_equal(grid, np.round(index * step, 2))
    # Half a second is exact in 32 bits, so there is nothing to say when nothing moved.
    assert (f"{step:g} s" in note) == (not np.array_equal(times, grid))


def test_grid_of_the_thesis_records():
    times = np.array([0.0, 0.100000143, 0.200000048, 0.300000191, 0.400000095])
    grid, note = exact_grid(times)
    assert grid.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert "32-bit" in note


def test_gaps_and_repeats_stay_on_the_grid():
    index = np.array([0, 1, 2, 2, 3, 500, 501, 502])
    times = (index * 0.1).astype(np.float32).astype(float)
    assert exact_grid(times)[0].tolist() == np.round(index * 0.1, 1).tolist()


@pytest.mark.parametrize(
    "times",
    [
        np.arange(100) * 0.5,
        np.round(np.arange(100) * 0.1, 1),
        np.round(np.arange(100) * 0.30193, 1),  # a clock that shows tenths of an odd step
        np.arange(100) * 0.1 + np.random.default_rng(1).normal(0.0, 1e-3, 100),
        np.array([0.0, 0.1]),
        np.array([0.0, np.nan, 0.2, 0.3]),
        np.arange(10)[::-1] * 1.0,
        np.zeros(5),
        np.arange(1000.0) * 1e-5 + np.random.default_rng(2).normal(0.0, 3e-6, 1000),
    ],
)
def test_other_times_stay_as_they_are(times):
    same, note = exact_grid(times)
    assert same is times
    assert note == ""


def test_time_from_first_sample():
    shifted, origin_s, note = from_first_sample(np.array([np.nan, 5.0, 6.5]))
    assert shifted[1:].tolist() == [0.0, 1.5]
    assert (origin_s, note) == (5.0, "")
    assert "5 s" in counted_from(origin_s)
    assert from_first_sample(np.array([0.0, 1.0]))[1] == 0.0


def spelled(seconds, form):
    """Return times of day or elapsed in a format, by means that the reader does not share."""
    out = []
    for total in seconds:
        s = round(total)
        out.append(
            form.replace("d", str(s // 86400))
            .replace("HH", f"{s // 3600 % 24:02d}")
            .replace("hh", f"{s // 3600:02d}")
            .replace("MM", f"{s // 60 % 60:02d}")
            .replace("mm", f"{s // 60:02d}")
            .replace("SS", f"{s % 60:02d}")
        )
    return out


def table(tmp_path, cells, header="Time", units=None):
    path = tmp_path / "test.csv"
    lines = [f"{header};winding_degC", *([units] if units else [])]
    lines += [f"{cell};{20 + 0.25 * i}" for i, cell in enumerate(cells)]
    path.write_text("\n".join(lines) + "\n")
    return path


MINUTES = np.arange(0.0, 3 * 3600.0, 60.0)  # three hours by the minute
SECONDS = np.arange(0.0, 180.0)  # three minutes by the second


@pytest.mark.parametrize(
    ("header", "form", "truth"),
    [
        ("Time [hh:mm]", "hh:MM", MINUTES),
        ("Time [HH:MM]", "hh:MM", MINUTES),
        ("Time [h:mm]", "hh:MM", MINUTES),
        ("Time (hh:mm)", "hh:MM", MINUTES),
        ("Time hh:mm", "hh:MM", MINUTES),
        ("Zeit {h:min}", "hh:MM", MINUTES),
        ("Time [mm:ss]", "mm:SS", SECONDS),
        ("Time [min:s]", "mm:SS", SECONDS),
        ("Time [d:hh:mm]", "d:HH:MM", np.arange(0.0, 3 * 86400.0, 600.0)),
        ("Time [d:hh:mm:ss]", "d:HH:MM:SS", np.arange(0.0, 3 * 86400.0, 600.0)),
        ("Time [d hh:mm:ss]", "d HH:MM:SS", np.arange(0.0, 3 * 86400.0, 600.0)),
        ("Time [d.hh:mm:ss]", "d.HH:MM:SS", np.arange(0.0, 3 * 86400.0, 600.0)),
        ("Time [[h]:mm:ss]", "hh:MM:SS", MINUTES),
        ("Time [hh:mm:ss.fff]", "hh:MM:SS.000", SECONDS),
        ("Time [hh:mm:ss]", "hh:MM:SS", SECONDS),
    ],
)
def test_the_format_in_the_header_decides(tmp_path, header, form, truth):
    record = read_record(table(tmp_path, spelled(truth, form), header))
    assert np.array_equal(record.time_s, truth)
    assert any("as stated" in note for note in record.notes)


@pytest.mark.parametrize("units", ["hh:mm;°C", "[hh:mm];[°C]", "(h:min);°C"])
def test_the_format_in_a_row_of_units_decides(tmp_path, units):
    record = read_record(table(tmp_path, spelled(MINUTES, "hh:MM"), "Time", units))
    assert np.array_equal(record.time_s, MINUTES)
    assert record["winding_degC"][1] == 20.25


def test_the_format_in_the_motor_file_decides(tmp_path):
    path = table(tmp_path, spelled(MINUTES, "hh:MM"))
    for text, truth in (("Time [hh:mm]", MINUTES), ("Time [mm:ss]", MINUTES / 60.0)):
        record = read_record(path, Motor("M", columns={"time_s": text}))
        assert np.array_equal(record.time_s, truth)


def test_two_parts_without_a_format_are_a_question(tmp_path):
    for form, truth in (("hh:MM", MINUTES), ("mm:SS", SECONDS)):
        path = table(tmp_path, spelled(truth, form))
        with pytest.raises(InputError) as caught:
            read_record(path)
        assert "minutes:seconds (a step of 1 s" in caught.value.problem
        assert "hours:minutes (a step of 60 s" in caught.value.problem
        for answer in ("Time [mm:ss]", "Time [hh:mm]"):
            assert f'time_s = "{answer}"' in caught.value.remedy
            read_record(path, Motor("M", columns={"time_s": answer}))


def test_a_question_about_a_column_that_is_not_used_is_not_asked(tmp_path):
    path = tmp_path / "test.csv"
    rows = "".join(f"{i};{i // 60:02d}:{i % 60:02d};20,5\n" for i in range(300))
    path.write_text("time_s;shift;winding_degC\n" + rows)
    record = read_record(path)
    assert record.time_s.tolist() == list(range(300))
    assert record.unused == ("shift",)


@pytest.mark.parametrize(
    ("cells", "truth", "why"),
    [
        # A fraction of a second
        (["12:30.5", "12:31.0"], [0, 0.5], "minutes:seconds"),
        # Past midnight, which minutes and seconds do not have
        (["23:58", "23:59", "00:00", "00:01"], [0, 60, 120, 180], "midnight"),
        # Past the full hour, which hours and minutes do not have
        (["59:58", "59:59", "00:00", "00:01"], [0, 1, 2, 3], "full hour"),
        (["59:59", "1:00:00", "1:00:01"], [0, 1, 2], "minutes:seconds and hours"),
        (["11:59 AM", "12:00 PM", "12:01 PM"], [0, 60, 120], "am or pm"),
        (["11:59:59 pm", "12:00:00 am"], [0, 1], "midnight"),
        (["23:59:58", "23:59:59", "00:00:00", "00:00:01"], [0, 1, 2, 3], "midnight"),
        (["23:59:59.5", "00:00:00.0"], [0, 0.5], "midnight"),
    ],
)
def test_where_one_reading_alone_is_possible_it_is_taken_and_said(tmp_path, cells, truth, why):
    record = read_record(table(tmp_path, cells))
    assert record.time_s.tolist() == truth
    assert any(why in note for note in record.notes)


def test_more_than_an_hour_of_minutes_is_taken_with_a_doubt(tmp_path):
    path = table(tmp_path, spelled(np.arange(0.0, 7200.0, 10.0), "mm:SS"))
    record = read_record(path)
    assert record.time_s[-1] == 7190.0
    (finding,) = record.findings
    assert finding.id == "time_assumed"
    assert finding.severity == "warning"
    assert "hours:minutes (a step of 10 min, 4.99 days in all)" in finding.message


def test_three_parts_that_jump_as_hours_and_not_as_days_are_a_question(tmp_path):
    path = table(tmp_path, spelled(np.arange(0.0, 3 * 86400.0, 3600.0), "d:HH:MM"))
    with pytest.raises(InputError, match=r"hours:minutes:seconds.*days:hours:minutes"):
        read_record(path)
    for truth in (np.arange(0.0, 900.0), np.arange(0.0, 30 * 3600.0, 300.0)):
        path = table(tmp_path, spelled(truth, "hh:MM:SS"))
        assert np.array_equal(read_record(path).time_s, truth)


@pytest.mark.parametrize(
    ("header", "form"),
    [("Time [hh:mm]", "hh:MM:SS"), ("Time [hh:mm:ss]", "hh:MM"), ("Time [mm:ss]", "d:HH:MM:SS"),
     ("Time [hh:mm:ss]", "2025-11-20 hh:MM:SS"), ("Time [dd.mm.yyyy hh:mm]", "hh:MM"),
     ("Time [hh:mm]", "d HH:MM")],
)  # fmt: skip
def test_cells_of_another_format_than_the_stated_are_refused(tmp_path, header, form):
    with pytest.raises(InputError, match=r"format is stated as .* cells are not written so"):
        read_record(table(tmp_path, spelled(MINUTES, form), header))


def test_numbers_under_a_format_are_refused(tmp_path):
    with pytest.raises(InputError, match="unit 'hh:mm' is not known"):
        read_record(table(tmp_path, range(300), "Time [hh:mm]"))


def test_a_unit_that_is_no_time_is_not_passed_over(tmp_path):
    with pytest.raises(InputError, match="unit of power"):
        read_record(table(tmp_path, spelled(SECONDS, "hh:MM:SS"), "Time [kW]"))


def test_single_cells_of_another_format_are_unreadable(tmp_path):
    cells = spelled(MINUTES, "hh:MM")
    cells[5], cells[6] = "00:05:00", "0:75"
    record = read_record(table(tmp_path, cells, "Time [hh:mm]"))
    assert np.flatnonzero(np.isnan(record.time_s)).tolist() == [5, 6]
    assert record.findings[0].values["count"] == 2


def test_a_clock_that_is_set_back_stays_a_backward_step(tmp_path):
    for cells in (
        ["23:59:58", "23:59:59", "03:00:00", "03:00:01"],  # four hours are missing, or more
        ["12:59:58", "12:59:59", "01:00:00", "01:00:01"],  # twelve hours, without am and pm
    ):
        record = read_record(table(tmp_path, cells))
        assert (np.diff(record.time_s) < 0).any()
        assert "time_backwards" in [one.id for one in check_record(record, Motor("M"))]


def test_a_date_in_the_header_gives_the_order_of_the_dates(tmp_path):
    cells = ["01/02/2025 23:59:59", "02/02/2025 00:00:01"]
    with pytest.raises(InputError, match=r"day/month/year .2 s in all. or month/day/year"):
        read_record(table(tmp_path, cells))
    path = table(tmp_path, cells, "Time [dd/mm/yyyy hh:mm:ss]")
    assert read_record(path).time_s.tolist() == [0.0, 2.0]
    path = table(tmp_path, cells, "Time [%m/%d/%Y %H:%M:%S]")
    assert read_record(path).time_s.tolist() == [0.0, 30 * 86400.0 + 2.0]


@pytest.mark.parametrize(
    "text", ["", "s", "min", "°C", "kW", "1/min", "m/s", "l/min", "a:b", "m:h", "ss:hh", "hh.mm",
             "::", ":" * 60, "h:" * 40, "s.ms", "mm", "yyyy"],
)  # fmt: skip
def test_other_texts_are_no_formats(text):
    assert parse_time_format(text) is None


def test_names_without_a_format_stay_whole():
    for name in ("Ratio 1:2", "T: winding", "a:" * 500, "Time [s]"):
        assert stated_format(name, name, None) == (name, None)


def test_a_clock_beside_the_numbers_is_read_by_its_header():
    data = b"Time [hh:mm],Lap [mm:ss],P\n00:10,00:10,1.5\n00:20,00:20,2.5\n"
    clock, lap, _ = read_text(data, "test.csv").columns
    assert clock.values.tolist() == [600.0, 1200.0]
    assert lap.values.tolist() == [10.0, 20.0]


def test_hundredths_behind_a_colon_are_a_question(tmp_path):
    cells = [f"00:{i // 2:02d}:{50 * (i % 2):02d}" for i in range(100)]
    path = table(tmp_path, cells)
    with pytest.raises(InputError, match="minutes:seconds:hundredths") as caught:
        read_record(path)
    assert '"Time [mm:ss:ff]"' in caught.value.remedy
    record = read_record(path, Motor("M", columns={"time_s": "Time [mm:ss:ff]"}))
    assert record.time_s.tolist() == [0.5 * i for i in range(100)]


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
        ([f"20260304 10000{i}" for i in range(5)], "2026-03-04"),
        ([f"2026-03-04_10-00-0{i}" for i in range(5)], "2026-03-04"),
        ([f"2026-03-04 10.00.0{i}" for i in range(5)], "2026-03-04"),
        # of no year
        ([f"04.03. 10:00:0{i}" for i in range(5)], ""),
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
    record = record_of(tmp_path, cells)
    assert record.start == day
    assert record.time_s.tolist() == [float(i) for i in range(len(cells))]


@pytest.mark.parametrize(
    ("cells", "form"),
    [
        ([f"2026-03-04_10-00-0{i}" for i in range(5)], "yyyy-mm-dd_hh-mm-ss"),
        ([f"04.03. 10:00:0{i}" for i in range(5)], "dd.mm. hh:mm:ss"),
    ],
)
def test_a_date_is_read_by_the_very_format_that_is_stated(tmp_path, cells, form):
    (tmp_path / "t.csv").write_text(
        HEAD.replace("time", f"time [{form}]")
        + "".join(f"{cell},10,100,20,{30 + i}\n" for i, cell in enumerate(cells))
    )
    record = read_record(tmp_path / "t.csv")
    assert record.time_s.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert not any("1904" in note for note in record.notes)


def test_a_name_with_a_date_and_the_time_of_the_file_are_no_clock(tmp_path):
    assert record_of(tmp_path, [f"{i}" for i in range(5)], "duty_2026_03_04.csv").start == ""


MOMENTS = [datetime(2026, 3, 4, 10, 0, i) for i in range(5)]


def in_parquet(path):
    columns = {"time": MOMENTS, "winding_degC": np.arange(5.0), "losses_W": np.full(5, 100.0)}
    pd.DataFrame(columns).to_parquet(path)


def in_workbook(*rows):
    def write(path):
        book = Workbook()
        for row in rows:
            book.active.append(row)
        book.save(path)

    return write


HEADED = ["winding_degC", "losses_W"]


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("t.parquet", in_parquet),
        ("t.xlsx", in_workbook(["time", *HEADED], *([m, 30.0, 100.0] for m in MOMENTS))),
        ("titled.xlsx", in_workbook(["Date", datetime(2026, 3, 4)], ["time [s]", *HEADED],
                                    *([i, 30.0 + i, 100.0] for i in range(5)))),
    ],
    ids=["times of Parquet", "times of a sheet", "title rows of a sheet"],
)  # fmt: skip
def test_other_formats_say_the_day_too(tmp_path, name, write):
    write(tmp_path / name)
    assert read_record(tmp_path / name).start == "2026-03-04"


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
