"""A test that is read while a bench writes it: whole lines only, each once, nothing lost."""

import io
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.motor.file import load_motor, parse_motor
from heatrun.readers.following import MARK_BYTES, FollowedTest, GrowingColumns, Growth, NotFollowed
from heatrun.readers.read import read_record
from heatrun_view.reading import Reader
from heatrun_view.store import RecordStore

WRITER = Path(__file__).with_name("bench_writer.py")
PATIENCE_S = 120.0
MOTOR = b'[motor]\nname = "x"\n[winding]\nphase_resistance_ohm = 0.01\n'


def _open(path: Path) -> io.BufferedReader:
    return path.open("rb")


def _lines(first: int, last: int) -> str:
    rows = (
        (f"{k // 2},{5 * (k % 2)}", f"{k % 50},25", 500 + k % 9, "21,0", f"{20 + k % 70},5", k % 4)
        for k in range(first, last)
    )
    return "".join(";".join(map(str, row)) + "\n" for row in rows)


HEAD = "time_s;phase_current_A;losses_W;ambient_degC;winding_degC;oil [bar]\n"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "running.csv"


def test_a_real_writer_at_both_rates_is_read_as_far_as_it_is(tmp_path):
    slow, fast = tmp_path / "slow.csv", tmp_path / "fast.csv"
    writers = [
        subprocess.Popen([sys.executable, str(WRITER), str(path), str(rate), str(seed)])
        for seed, (path, rate) in enumerate(((slow, 0.4), (fast, 20.0)))
    ]
    reader = Reader(lambda name: tmp_path / name, RecordStore(), _open)
    try:
        end = time.monotonic() + PATIENCE_S
        reading = reader.read(["slow.csv", "fast.csv"], None)
        seen: list[tuple[int, int]] = []
        while time.monotonic() < end and (not seen or seen[-1][0] < 3 or seen[-1][1] < 60):
            reading = reader.follow({**reading.opened, **reading.refused}, None)
            sizes = {n: each.record.time_s.size for n, each in reading.opened.items()}
            seen.append((sizes.get("slow.csv", 0), sizes.get("fast.csv", 0)))
            _holds_what_was_written(reading.opened)
            time.sleep(0.05)
    finally:
        for writer in writers:
            writer.kill()
            writer.wait()
    assert seen[-1][0] >= 3
    assert seen[-1][1] >= 60
    assert seen == sorted(seen)
    for name in ("slow.csv", "fast.csv"):
        whole = (tmp_path / name).read_bytes()
        num_rows = whole.count(b"\n") - 1
        last = reader.follow(reading.opened, None).opened[name].record
        assert last.time_s.size == num_rows


def _holds_what_was_written(opened) -> None:
    for name, each in opened.items():
        rate = 0.4 if name == "slow.csv" else 20.0
        number = np.arange(each.record.time_s.size)
        np.testing.assert_allclose(each.record.time_s, number / rate, atol=6e-4)
        np.testing.assert_array_equal(each.record["phase_current_A"], 80 + number % 40)
        winding = 20.0 + 60.0 * (1.0 - np.exp(-number / rate / 1200.0))
        np.testing.assert_allclose(each.record["winding_degC"], winding, atol=6e-5)
        if each.others:
            np.testing.assert_array_equal(each.others["oil_pressure [bar]"].values, number % 9)


def test_a_torn_last_line_waits_for_its_end(path):
    path.write_text(HEAD + _lines(0, 5) + "2,5;5,25;5")
    test = FollowedTest(path, None)
    assert test.look(_open).record.time_s.size == 5
    with path.open("a") as file:
        file.write("05;21,0;25,5;1")
    assert test.look(_open).record.time_s.size == 5
    with path.open("a") as file:
        file.write("\n")
    record = test.look(_open).record
    assert record["losses_W"][-1] == 505.0
    assert record.time_s.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]


SEVERAL = MOTOR + b'[columns]\nwinding_degC = "mean(winding_degC, ambient_degC)"\n'


@pytest.mark.parametrize("motor", [None, *(parse_motor(m, "motor.toml") for m in (MOTOR, SEVERAL))])
def test_piece_by_piece_is_as_whole(path, motor, monkeypatch):
    monkeypatch.setattr("heatrun.readers.following.BUSY_SHARE", 1e-9)  # nothing is read whole again
    path.write_text(HEAD)
    test = FollowedTest(path, motor)
    with pytest.raises(InputError):
        test.look(_open)
    first = 0
    for num in (3, 1, 2, 30, 3000, 1, 5):
        with path.open("a") as file:
            file.write(_lines(first, first + num))
        first += num
        seen = test.look(_open)
    whole = read_record(path, motor)
    assert whole.time_s.size == first
    assert list(seen.record.channels) == list(whole.channels)
    for name, values in whole.channels.items():
        np.testing.assert_array_equal(seen.record[name], values)
    assert whole.unused == ("oil [bar]",)
    np.testing.assert_array_equal(seen.others["oil [bar]"].values, np.arange(first) % 4)
    assert seen.others["oil [bar]"].unit == "bar"


def test_what_was_handed_out_stays_as_it_was(path):
    path.write_text(HEAD + _lines(0, 10))
    test = FollowedTest(path, None)
    before = test.look(_open).record
    kept = before["losses_W"].copy()
    with path.open("a") as file:
        file.write(_lines(10, 4000))
    assert test.look(_open).record.time_s.size == 4000
    np.testing.assert_array_equal(before["losses_W"], kept)
    columns = GrowingColumns({"a": np.arange(3.0)})
    view = columns.views()["a"]
    columns.add({"a": np.array([9.0])}, 1)
    assert view.tolist() == [0.0, 1.0, 2.0]
    assert columns.views()["a"].tolist() == [0.0, 1.0, 2.0, 9.0]
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1.0


class Counted(io.BytesIO):
    num_read = 0

    def read(self, size: int | None = -1, /) -> bytes:
        found = super().read(size)
        self.num_read += len(found)
        return found


@pytest.mark.parametrize("num_rows", [1_000, 100_000])
def test_a_look_reads_what_is_new_however_long_the_file_is(num_rows):
    growth = Growth()
    data = (HEAD + _lines(0, num_rows)).encode()
    growth.look(Counted(data))
    new = _lines(num_rows, num_rows + 20).encode()
    file = Counted(data + new)
    assert growth.look(file) == new
    assert file.num_read <= len(new) + 2 * MARK_BYTES


def test_a_file_that_is_replaced_or_cut_is_said_and_read_again(path):
    path.write_text(HEAD + _lines(0, 40))
    test = FollowedTest(path, None)
    assert test.look(_open).notice == ""
    path.write_text(HEAD + _lines(100, 103))
    seen = test.look(_open)
    assert "replaced or cut" in seen.notice
    assert seen.record["losses_W"].tolist() == [500 + k % 9 for k in (100, 101, 102)]
    longer = path.with_name("longer")
    longer.write_text(HEAD + _lines(7, 500))
    longer.replace(path)
    assert test.look(_open).record.time_s.size == 493
    os.truncate(path, len(HEAD) + len(_lines(7, 9)))
    assert test.look(_open).record.time_s.size == 2


def test_a_file_that_is_saved_anew_with_more_lines_goes_on(path):
    path.write_text(HEAD + _lines(0, 40))
    test = FollowedTest(path, None)
    test.look(_open)
    anew = path.with_name("anew")
    anew.write_text(HEAD + _lines(0, 60))
    anew.replace(path)
    seen = test.look(_open)
    assert seen.record.time_s.size == 60
    assert seen.notice == ""


def test_lines_that_are_none_lose_no_others(path):
    path.write_text(HEAD + _lines(0, 40))
    test = FollowedTest(path, None)
    test.look(_open)
    with path.open("a") as file:
        file.write("20,0;oops\n\n" + _lines(41, 45))
    seen = test.look(_open)
    assert seen.record.time_s.tolist()[-4:] == [20.5, 21.0, 21.5, 22.0]
    assert any("hold no sample" in note for note in seen.record.notes)


def test_a_clock_goes_over_midnight(path):
    head = "time_s [hh:mm:ss];phase_current_A;losses_W;ambient_degC;winding_degC\n"

    def rows(first: int, last: int) -> str:
        clock = [(86_370 + 10 * k) % 86_400 for k in range(first, last)]
        return "".join(
            f"{s // 3600:02d}:{s // 60 % 60:02d}:{s % 60:02d};1,5;{k};20,0;30,5\n"
            for k, s in enumerate(clock, start=first)
        )

    path.write_text(head + rows(0, 2))
    test = FollowedTest(path, None)
    test.look(_open)
    for first in (2, 3, 4):
        with path.open("a") as file:
            file.write(rows(first, first + 1))
        seen = test.look(_open)
    assert seen.record.time_s.tolist() == [0.0, 10.0, 20.0, 30.0, 40.0]


def test_a_column_that_begins_to_hold_numbers_is_found(path, monkeypatch):
    monkeypatch.setattr("heatrun.readers.following.BUSY_SHARE", 1e9)
    path.write_text(
        "time_s,losses_W,phase_current_A,ambient_degC,winding_degC\n0,1,2,3,\n1,1,2,3,\n"
    )
    test = FollowedTest(path, None)
    assert "winding_degC" not in test.look(_open).record
    with path.open("a") as file:
        file.write("2,1,2,3,40\n")
    assert test.look(_open).record["winding_degC"][-1] == 40.0


def test_only_text_is_followed_and_other_files_are_opened_whole(folder):
    path = folder / "duty_30min.csv.gz"
    with pytest.raises(NotFollowed):
        FollowedTest(path, None).look(_open)
    motor = load_motor(folder / "motor.toml")
    store = RecordStore()
    reader = Reader(lambda name: folder / name, store, _open)
    opened = reader.read([path.name], "motor.toml").opened
    assert opened[path.name] is store.open(path, motor)
    again = reader.follow(opened, "motor.toml").opened
    assert again[path.name] is opened[path.name]


def test_calibration_still_refuses_a_file_that_changes(path, monkeypatch):
    path.write_text(HEAD + _lines(0, 40))
    stamps = iter(range(100))
    real = os.fstat

    def changing(descriptor: int) -> os.stat_result:
        found = list(real(descriptor))
        return os.stat_result(found, {"st_mtime_ns": next(stamps)})

    monkeypatch.setattr("heatrun.io.open_file.os.fstat", changing)
    with pytest.raises(InputError, match="changed while it was read"):
        read_record(path)
