"""Times written as a clock: the header's format decides, and without one nothing is guessed."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.checks import check_record
from heatrun.errors import InputError
from heatrun.readers.clock import parse_time_format, stated_format
from heatrun.readers.read import read_record
from heatrun.readers.text.reader import read_text
from heatrun.record.motor import Motor


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
