"""Rows and channels of a table: without a sample, sorted, of one name, each at its own rate."""

import gzip
from pathlib import Path

import arviz
import numpy as np
import pandas as pd
import pytest

import heatrun
from heatrun.checks import check_record
from heatrun.cli import main
from heatrun.errors import InputError
from heatrun.init.survey import survey
from heatrun.readers.read import read_raw, read_record
from heatrun.record.motor import Motor
from heatrun.record.raster import at_own_rates, means_around, raster, require_increasing

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


NUM_ROWS = 240
RNG = np.random.default_rng(5)
COLUMNS = {
    "time_s": 10.0 * np.arange(NUM_ROWS),
    "speed_rpm": 500.0 * RNG.integers(1, 9, NUM_ROWS) + RNG.normal(0.0, 2.0, NUM_ROWS),
    "torque_Nm": 5.0 * RNG.integers(0, 7, NUM_ROWS) + RNG.normal(0.0, 0.05, NUM_ROWS),
    "phase_current_A": RNG.uniform(5.0, 60.0, NUM_ROWS),
    "losses_W": RNG.uniform(100.0, 900.0, NUM_ROWS),
    "ambient_degC": np.full(NUM_ROWS, 23.0),
    "winding_degC": RNG.uniform(40.0, 110.0, NUM_ROWS),
}


def test_one_line_says_that_the_rows_are_in_another_order(tmp_path):
    order = np.roll(np.arange(NUM_ROWS), NUM_ROWS // 2)  # others are in `tests/readings`
    path = tmp_path / "map.csv"
    columns = np.column_stack([values[order] for values in COLUMNS.values()])
    np.savetxt(path, columns, "%.6g", ",", header=",".join(COLUMNS), comments="")
    (finding,) = check_record(read_record(path), Motor("M", phase_resistance_ohm=0.05))
    assert (finding.id, finding.severity) == ("time_backwards", "error")
    assert "another order" in finding.message
    assert "Sort the rows by time" in finding.remedy


HEAD = ["t [s]", "T_w [K]", "T_w [K]", "T_w [K]", "losses_W"]
FIVE = [[i, 300.0 + i, 310.0 + i, 320.0 + i, 100.0] for i in range(5)]
TEXT = "\n".join(",".join(map(str, row)) for row in [HEAD, *FIVE])


def as_csv(path):
    path.write_text(TEXT)


def as_gzip(path):
    path.write_bytes(gzip.compress(TEXT.encode()))


def as_workbook(path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in [HEAD, *FIVE]:
        book.active.append(row)
    book.save(path)


@pytest.fixture(params=[("t.csv", as_csv), ("t.csv.gz", as_gzip), ("t.xlsx", as_workbook)],
                ids=lambda one: one[0])  # fmt: skip
def bench(request, tmp_path):
    name, write = request.param
    write(tmp_path / name)
    return tmp_path / name


@pytest.mark.parametrize(
    ("line", "first"),
    [
        ("T_w [K] #1", 26.85),
        ("T_w [K] #2", 36.85),
        ("T_w [K] #3", 46.85),
        ("T_w [K] #2 [degC]", 310),
    ],
)
def test_each_of_them_can_be_named_and_keeps_its_unit(bench, line, first):
    record = read_record(bench, Motor("M", columns={"winding_degC": line}))
    np.testing.assert_allclose(record["winding_degC"], first + np.arange(5))
    assert len(record.unused) == 2
    assert any("3 columns are called 'T_w [K]'" in note for note in record.notes)


@pytest.mark.parametrize("line", ["T_w", "T_w [K]"])
def test_a_name_that_is_two_is_a_question_with_an_answer(bench, line):
    with pytest.raises(InputError, match=r"'T_w \[K\] #1' and 'T_w \[K\] #2'") as error:
        read_record(bench, Motor("M", columns={"winding_degC": line}))
    assert 'winding_degC = "T_w [K] #1"' in str(error.value)


def test_init_offers_both(bench):
    free = {column.name: column for column in survey(bench).free}
    assert set(free) == {"T_w [K] #1", "T_w [K] #2", "T_w [K] #3"}
    assert free["T_w [K] #2"].unit == "K"
    assert "T_w [K] #2" in {one.line for one in free["T_w [K] #2"].proposals}


def test_a_name_that_is_there_already_is_not_taken(tmp_path):
    (tmp_path / "t.csv").write_text("t,a,a #2,a\n0,1,2,3\n1,1,2,3\n")
    names = [column.name for column in read_raw(tmp_path / "t.csv").columns]
    assert names == ["t", "a #1", "a #2", "a #3"]


END_S = 2400.0
COIL = Motor("M", phase_resistance_ohm=0.04)


def coil(t):
    return 21.0 + 55.0 * (1.0 - np.exp(-t / 300.0)) + 0.003 * np.sin(t)


SIGNALS = {
    "winding_degC": coil,
    "ambient_degC": lambda t: 20.0 + t / 4000.0,
    "phase_current_A": lambda t: np.where(t < 1500.0, 40.0, 10.0),
    "losses_W": lambda t: np.where(t < 1500.0, 220.0, 20.0) + t / 1000.0,
}


def union(stamps):
    """Return the table of channels that each have their own times [s]."""
    parts = [pd.Series(SIGNALS[name](t), index=t, name=name) for name, t in stamps.items()]
    return pd.concat(parts, axis=1).sort_index().rename_axis("time_s").reset_index()


def steps(step_s, offset_s=0.0):
    return np.round(np.arange(offset_s, END_S, step_s), 6)


TABLES = {
    "three rates": [5.0, 60.0, 1.0, 2.0],
    "stamps that never coincide": [(2.0, 0.3), (10.0, 0.7), (2.0, 0.0), (2.0, 0.9)],
    "the room between the stamps of all others": [1.0, (7.0, 0.45), 1.0, 1.0],
    "the winding between the stamps of its load": [(4.0, 0.5), 4.0, 2.0, 2.0],
}


@pytest.mark.parametrize("ending", ["csv", "parquet"])
@pytest.mark.parametrize("member", TABLES)
def test_a_channel_of_its_own_rate_is_no_gap(tmp_path, member, ending):
    rates = [one if isinstance(one, tuple) else (one,) for one in TABLES[member]]
    stamps = {name: steps(*rate) for name, rate in zip(SIGNALS, rates, strict=True)}
    table = union(stamps)
    path = tmp_path / f"test.{ending}"
    table.to_csv(path, index=False) if ending == "csv" else table.to_parquet(path)
    record = read_record(path)
    time_s = record.time_s + table["time_s"].iloc[0]
    for name, truth in SIGNALS.items():
        values = record[name]
        if name == "winding_degC":
            known = np.isfinite(values)
            assert known.sum() == stamps[name].size
            np.testing.assert_allclose(values[known], truth(time_s[known]), atol=1e-9)
            continue
        inside = (time_s >= stamps[name][0]) & (time_s <= stamps[name][-1])
        smooth = inside & (np.abs(time_s - 1500.0) > 15.0)
        np.testing.assert_allclose(values[smooth], truth(time_s[smooth]), rtol=1e-6, err_msg=name)
    assert {finding.id for finding in record.findings} == {"raster_joined"}
    found = check_record(record, COIL)
    assert not [finding for finding in found if finding.severity == "error"]
    assert "nan_block" not in {one.id for one in found if one.values.get("num_missing", 0) > 10}


def test_what_is_joined_is_told_in_the_order_of_the_columns():
    every_third = np.where(np.arange(300) % 3, np.nan, 1.0)
    names = ["losses_W", "torque_Nm", "ambient_degC", "speed_rpm", "phase_current_A", "fan"]
    channels = {"time_s": np.arange(300.0), "winding_degC": np.ones(300)}
    _, findings = at_own_rates(channels | dict.fromkeys(names, every_third), "a.csv")
    assert [one.where for one in findings] == [f"a.csv, {name}" for name in names]


def test_rows_of_one_stamp_are_one_sample(tmp_path):
    tables = [union({name: steps(2.0)}) for name in SIGNALS]
    table = pd.concat(tables).sort_values("time_s", kind="stable")
    path = tmp_path / "test.csv"
    table.to_csv(path, index=False)
    record = read_record(path)
    np.testing.assert_array_equal(record.time_s, steps(2.0))
    for name, truth in SIGNALS.items():
        np.testing.assert_allclose(record[name], truth(record.time_s))


def test_a_sensor_that_fails_for_a_while_still_does(tmp_path):
    table = union({name: steps(2.0) for name in SIGNALS})
    table.loc[300:420, "ambient_degC"] = np.nan
    table.loc[500:560, "winding_degC"] = np.nan
    path = tmp_path / "test.csv"
    table.to_csv(path, index=False)
    record = read_record(path)
    assert record.findings == ()
    gaps = [one for one in check_record(record, COIL) if one.id == "nan_block"]
    missing = {one.where.split(", ")[1] for one in gaps}
    assert missing == {"ambient_degC", "winding_degC"}


def test_a_slow_channel_that_fails_is_not_joined_over_its_gap(tmp_path):
    room = steps(10.0)
    table = union(
        {name: steps(2.0) for name in SIGNALS} | {"ambient_degC": room[(room < 600) | (room > 900)]}
    )
    path = tmp_path / "test.csv"
    table.to_csv(path, index=False)
    (finding,) = [one for one in check_record(read_record(path), COIL) if one.id == "nan_block"]
    assert finding.severity == "error"
    assert 140 <= finding.values["num_missing"] <= 160


FAST = np.arange(1001) * 0.1
AT = np.arange(101) * 1.0


def test_a_ramp_keeps_its_place():
    # The sample nearest to the left, or a mean over the interval that follows, would move it.
    inner = means_around(FAST + 0.03, 5.0 * (FAST + 0.03), AT)[1:-1]
    np.testing.assert_allclose(inner, 5.0 * AT[1:-1], atol=1e-9)


def test_energy_is_conserved():
    power = np.where((FAST > 20.25) & (FAST < 61.4), 800.0, 30.0)
    means = means_around(FAST, power, AT)
    weights = np.concatenate([[0.5], np.ones(AT.size - 2), [0.5]])
    # The half intervals at both ends hold the record's first and last half second.
    assert weights @ means == pytest.approx(np.trapezoid(power, FAST), rel=1e-12)


def test_the_square_of_a_current_is_averaged():
    current = np.where(np.arange(FAST.size) % 2 == 0, 100.0, 0.0)
    rms = means_around(FAST, current, AT, is_rms=True)
    np.testing.assert_allclose(rms, np.sqrt(5000.0), rtol=1e-12)
    np.testing.assert_allclose(means_around(FAST, current, AT), 50.0, rtol=1e-12)


def test_gaps_and_missing_samples_are_not_bridged():
    is_there = (FAST < 30.2) | (FAST > 45.1)
    values = np.full(FAST.size, 7.0)
    by_gap = means_around(FAST[is_there], values[is_there], AT)
    by_nan = means_around(FAST, np.where(is_there, values, np.nan), AT)
    assert np.array_equal(by_gap, by_nan, equal_nan=True)
    # 30 s has samples over 0.6 s of its interval, 31 s none, 45 s over 0.3 s
    assert np.flatnonzero(np.isnan(by_gap)).tolist() == list(range(31, 46))
    np.testing.assert_allclose(by_gap[~np.isnan(by_gap)], 7.0, rtol=1e-12)
    assert np.isnan(means_around(FAST[:1], values[:1], AT)).all()


def test_a_raster_spans_the_times():
    assert raster(FAST, 30.0).tolist() == [0.0, 30.0, 60.0, 90.0]
    assert raster(FAST, 0.1).size == FAST.size


@pytest.mark.parametrize(
    ("times", "problem"),
    [([0.0, np.nan, 2.0], "sample 2 has none"), ([0.0, 1.0, 1.0], "after 1 s comes 1 s")],
)
def test_times_must_increase(times, problem):
    with pytest.raises(InputError, match=problem):
        require_increasing(np.array(times), "run.mf4")


DATA = Path(__file__).parents[2] / "data" / "synthetic"


@pytest.mark.slow
def test_a_10_Hz_and_a_2_s_file_are_calibrated_together(tmp_path):
    with gzip.open(DATA / "duty_30min.csv.gz", "rt") as file:
        lines = file.read().splitlines()
    (tmp_path / "fast.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "slow.csv").write_text("\n".join([lines[0], *lines[1::20]]) + "\n")
    run = tmp_path / "run"
    code = main([
        "calibrate", str(DATA / "motor.toml"), str(tmp_path / "fast.csv"),
        str(tmp_path / "slow.csv"), "--model", "first", "--quick", "--out", str(run),
    ])  # fmt: skip
    assert code == 0
    draws = arviz.from_netcdf(run / "posterior_first.nc").posterior
    assert list(draws["Tw_start"]["test"].values) == ["fast", "slow"]
    assert list(draws["load_timing"]["test_of_load_timing"].values) == ["slow"]
    assert np.isfinite(draws["load_timing"]).all()
    read = heatrun.open_run(run)
    told = {row.sample_s: row.tests for row in read.result.models["first"].noise.loggers}
    assert told == {0.1: ("fast",), 2.0: ("slow",)}
    scales = read.draws("first").loggers
    assert {logger.sample_s for logger in scales} == {0.1, 2.0}
    assert 1.0 in scales.values()
