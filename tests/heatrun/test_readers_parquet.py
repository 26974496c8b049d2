"""Parquet tables, with and without the library that reads them."""

from __future__ import annotations

import sys

import numpy as np
import pandas as pd
import pytest

from heatrun.errors import InputError
from heatrun.readers.read import read_raw, read_record
from heatrun.record.motor import Motor

pyarrow = pytest.importorskip("pyarrow")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.parquet"


def test_columns_and_types(path):
    frame = pd.DataFrame(
        {
            "time_s": [0.0, 0.5, 1.0],
            "winding_degC": np.array([20.0, np.nan, 21.0], dtype=np.float32),
            "fan": [True, False, True],
            "count": pd.array([1, None, 3], dtype="Int64"),
            "state": ["RUN", "RUN", "STOP"],
        }
    )
    frame.to_parquet(path)
    table = read_raw(path)
    assert table.text_columns.keys() == {"state"}
    record = read_record(path)
    assert np.isnan(record["winding_degC"]).tolist() == [False, True, False]
    assert record["fan"].tolist() == [1.0, 0.0, 1.0]
    assert record.unused == ("count", "state")


@pytest.mark.parametrize("name", [None, "time", "timestamp"])
def test_an_index_of_dates_is_the_time(path, name):
    index = pd.date_range("2025-11-20 18:02:33", periods=4, freq="100ms", name=name, tz="UTC")
    pd.DataFrame({"winding_degC": np.arange(4.0)}, index=index).to_parquet(path)
    record = read_record(path)
    # 100 ms in nanoseconds is whole, so only the last product rounds
    np.testing.assert_allclose(record.time_s, [0.0, 0.1, 0.2, 0.3], atol=1e-15)
    assert any("2025-11-20T18:02:33" in note for note in record.notes)


def test_durations_and_regular_indices(path):
    frame = pd.DataFrame({"winding_degC": np.arange(3.0)})
    frame.index = pd.to_timedelta([1.0, 1.5, 2.5], unit="s")
    frame.to_parquet(path)
    assert read_record(path).time_s.tolist() == [0.0, 0.5, 1.5]
    frame.index = pd.RangeIndex(0, 6, 2, name="time [ms]")
    frame.to_parquet(path)
    np.testing.assert_allclose(read_record(path).time_s, [0.0, 0.002, 0.004], atol=1e-15)


def test_unit_in_the_metadata(path):
    import pyarrow.parquet

    field = pyarrow.field("winding", pyarrow.float64(), metadata={"unit": "K"})
    schema = pyarrow.schema([pyarrow.field("time_s", pyarrow.float64()), field])
    pyarrow.parquet.write_table(pyarrow.table([[0.0, 1.0], [293.15, 294.15]], schema=schema), path)
    np.testing.assert_allclose(read_record(path)["winding_degC"], [20.0, 21.0], atol=1e-12)


def test_metadata_and_name_must_agree(path):
    import pyarrow.parquet

    def write(name: str) -> None:
        field = pyarrow.field(name, pyarrow.float64(), metadata={"unit": "kW"})
        schema = pyarrow.schema([pyarrow.field("time_s", pyarrow.float64()), field])
        table = pyarrow.table([[0.0, 1.0], [2.0, 3.0]], schema=schema)
        pyarrow.parquet.write_table(table, path)

    for name in ("losses [W]", "losses_W"):
        write(name)
        with pytest.raises(InputError, match="The name says W, the field's metadata kW"):
            read_record(path)
        motor = Motor("M", columns={"losses_W": f"{name} [kW]"})
        record = read_record(path, motor)
        assert record["losses_W"].tolist() == [2000.0, 3000.0]
        assert [finding.id for finding in record.findings] == ["unit_overridden"]
    write("losses_kW_mean")
    record = read_record(path)
    assert record["losses_W"].tolist() == [2000.0, 3000.0]
    assert record.mapping[1].unit_from == "stated"


def test_damaged_and_empty_files(path):
    pd.DataFrame({"a": [1.0, 2.0]}).to_parquet(path)
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(InputError, match="could not be read"):
        read_raw(path)
    pd.DataFrame({"a": np.empty(0)}).to_parquet(path)
    with pytest.raises(InputError, match="at least one row"):
        read_raw(path)


def test_without_pyarrow_the_remedy_is_named(path, monkeypatch):
    pd.DataFrame({"a": [1.0]}).to_parquet(path)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(InputError, match=r"heatrun\[parquet\]"):
        read_raw(path)
