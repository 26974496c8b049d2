"""Tables on the time stamps of all channels: each channel has its own rate."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from heatrun.checks import check_record
from heatrun.readers.read import read_record
from heatrun.record.motor import Motor

END_S = 2400.0
MOTOR = Motor("M", phase_resistance_ohm=0.04)


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
    "the room at a fifth of the rate": [2.0, 10.0, 2.0, 2.0],
    "the winding slower than its load": [30.0, 60.0, 1.0, 1.0],
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
    found = check_record(record, MOTOR)
    assert not [finding for finding in found if finding.severity == "error"]
    assert "nan_block" not in {one.id for one in found if one.values.get("num_missing", 0) > 10}


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
    gaps = [one for one in check_record(record, MOTOR) if one.id == "nan_block"]
    missing = {one.where.split(", ")[1] for one in gaps}
    assert missing == {"ambient_degC", "winding_degC"}


def test_a_slow_channel_that_fails_is_not_joined_over_its_gap(tmp_path):
    room = steps(10.0)
    table = union(
        {name: steps(2.0) for name in SIGNALS} | {"ambient_degC": room[(room < 600) | (room > 900)]}
    )
    path = tmp_path / "test.csv"
    table.to_csv(path, index=False)
    (finding,) = [one for one in check_record(read_record(path), MOTOR) if one.id == "nan_block"]
    assert finding.severity == "error"
    assert 140 <= finding.values["num_missing"] <= 160
