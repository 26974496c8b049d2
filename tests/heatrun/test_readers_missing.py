"""Lines that hold no sample: time never closes up over them, and a cell never ends a file."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.readers.read import read_raw, read_record
from heatrun.record.motor import Motor

N = 7200
RATE = Motor("M", columns={"time_s": "rate 1 Hz"})
LOST = [*range(1200, 1500), 4000, *range(6000, 6199)]  # five hundred samples


def lines(with_time=False):
    return [
        f"{i};{20 + 0.01 * i:.2f};0,5" if with_time else f"{20 + 0.01 * i:.2f};0" for i in range(N)
    ]


def written(tmp_path, body, header="winding_degC;losses_W", end="\n"):
    path = tmp_path / "test.csv"
    path.write_text(end.join([header, *body, ""]), newline="")
    return path


@pytest.mark.parametrize("instead", [";", "", "  ", "5.5", "1.5;2;3", ";;;", '"1;2', "-;-"])
def test_lines_without_a_sample_are_missing_samples_where_time_is_a_rate(tmp_path, instead):
    body = lines()
    truth = 20 + 0.01 * np.arange(N)
    for index in LOST:
        body[index], truth[index] = instead, np.nan
    record = read_record(written(tmp_path, body), RATE)
    assert np.array_equal(record.time_s, np.arange(N))
    np.testing.assert_array_equal(record["winding_degC"], np.round(truth, 2))
    if instead == "-;-":  # cells that say so are samples
        return
    finding = next(one for one in record.findings if one.id == "rows_missing")
    assert finding.severity == "warning"
    assert "500 of 7200 samples" in finding.message
    assert "1200 s to 1499 s, 4000 s, 6000 s to 6198 s" in finding.message


def test_lines_of_delimiters_in_a_table_of_tabs(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text("winding_degC\tlosses_W\n20.5\t1\n\t\n21.5\t1\n")
    assert np.isnan(read_record(path, RATE)["winding_degC"]).tolist() == [False, True, False]


@pytest.mark.parametrize("behind", [["", "", ""], [";"] * 400, ["   ", ""], ["5.5"]])
def test_lines_at_the_end_are_no_samples(tmp_path, behind):
    record = read_record(written(tmp_path, lines() + behind), RATE)
    assert record.time_s.size == N
    assert "rows_missing" not in [one.id for one in record.findings]


def test_a_file_with_its_own_time_is_not_moved(tmp_path):
    body = [f"{i};{20 + 0.01 * i:.2f}" for i in range(N)]
    for index in LOST:
        body[index] = ";"
    record = read_record(written(tmp_path, body, "time_s;winding_degC"))
    assert record.time_s.tolist() == [i for i in range(N) if i not in set(LOST)]
    (finding,) = record.findings
    assert finding.severity == "note"
    assert "behind 1199 s, 3999 s, 5999 s" in finding.message


@pytest.mark.parametrize("end", ["\r\r\n", "\n\n"])
def test_a_blank_line_behind_each_line_is_a_way_of_writing(tmp_path, end):
    record = read_record(written(tmp_path, lines(), end=end), RATE)
    assert np.array_equal(record.time_s, np.arange(N))
    assert any("blank line follows each line" in note for note in record.notes)


def test_too_many_ragged_lines_are_refused_still(tmp_path):
    body = [line if i % 5 else "1" for i, line in enumerate(lines())]
    with pytest.raises(InputError, match="Expected 2 cells"):
        read_record(written(tmp_path, body), RATE)


def test_a_control_z_in_a_cell_does_not_end_the_file(tmp_path):
    body = [f"{i};{20 + 0.01 * i:.2f}" for i in range(N + 1)]
    body[3001] = "3001;50\x1a01"
    record = read_record(written(tmp_path, body, "time_s;winding_degC"))
    assert record.time_s.size == N + 1
    assert np.flatnonzero(np.isnan(record["winding_degC"])).tolist() == [3001]
    (finding,) = record.findings
    assert finding.id == "unreadable_cells"
    assert r"50\x1a01" in finding.message


@pytest.mark.parametrize("padding", [b"\x1a", b"\x1a" * 128, b"\x1a" + bytes(64), b"\x1a\r\n \r\n"])
def test_a_control_z_at_the_end_with_its_padding_is_the_end(tmp_path, padding):
    path = tmp_path / "test.csv"
    path.write_bytes(b"time_s;winding_degC\r\n0;20,5\r\n1;21,5\r\n" + padding)
    table = read_raw(path)
    assert table.num_rows == 2
    assert table.findings == ()
