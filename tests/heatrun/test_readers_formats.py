"""What MDF, TDMS, Excel and Parquet are held to alike: a record of CSV, few channels of many."""

import gzip
import json
import sys
import tracemalloc
from pathlib import Path

import mdf_files
import numpy as np
import pandas as pd
import pytest

from heatrun import cli
from heatrun.calibration import load_tests
from heatrun.errors import InputError
from heatrun.motor.file import load_motor
from heatrun.readers.read import read_raw, read_record

nptdms = pytest.importorskip("nptdms")
DATA = Path(__file__).parents[2] / "data" / "synthetic"
STEP = DATA / "step_30min.csv.gz"


def mdf(path, columns, **options):
    time_s, *others = columns.items()
    signals = [mdf_files.signal(name, values, time_s[1]) for name, values in others]
    mdf_files.written(path, ("Bench", signals), **options)


def tdms(path, columns, parts=1, **properties):
    with nptdms.TdmsWriter(path) as writer:
        for part in range(parts):
            writer.write_segment([
                nptdms.ChannelObject("Bench", name, np.array_split(values, parts)[part], properties)
                for name, values in columns.items()
            ])  # fmt: skip


def excel(path, columns):
    pd.DataFrame(columns).to_excel(path, index=False, engine="xlsxwriter")


def parquet(path, columns):
    pd.DataFrame(columns).to_parquet(path)


NAMES = {mdf: "run.mf4", tdms: "run.tdms", excel: "run.xlsx", parquet: "run.parquet"}
WRITERS = {
    "MDF 4.10": (mdf, {"version": "4.10", "compression": 0}),
    "MDF 4.10, packed": (mdf, {"version": "4.10", "compression": 2}),
    "MDF 4.20": (mdf, {"version": "4.20", "compression": 1}),
    "TDMS": (tdms, {}),
    "Excel, sheet 'Sheet1'": (excel, {}),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_the_bundled_record_is_the_same_as_from_csv(tmp_path, capsys, kind):
    write, options = WRITERS[kind]
    path = tmp_path / NAMES[write]
    with gzip.open(STEP, "rt") as file:
        columns = {name: v.to_numpy() for name, v in pd.read_csv(file).items()}
    write(path, columns, **options)
    from_csv, record = read_record(STEP), read_record(path)
    assert record.channels.keys() == from_csv.channels.keys()
    for channel in from_csv.channels:
        np.testing.assert_array_equal(record[channel], from_csv[channel])
    assert record.sources[0].reader == kind.removesuffix(", packed")
    assert any("2025-11-20T18:02:33" in note for note in record.notes) == (write is mdf)
    assert cli.main(["check", str(DATA / "motor.toml"), str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["findings"] is not None
    motor = load_motor(DATA / "motor.toml")
    (one,), (other,) = load_tests(motor, [path]), load_tests(motor, [STEP])  # what is fitted
    assert np.array_equal(one.blocks.measured, other.blocks.measured)


WAVES = {"wf_increment": 0.01, "wf_start_offset": 0.0}


@pytest.mark.parametrize(
    ("write", "num", "options", "most"),
    [
        # 4 arrays of 200 are 2 %; the fragments in which the library reads are the rest
        (mdf, 50_000, {}, 0.4),
        # and here names and segments
        (tdms, 10_000, {"parts": 2, **WAVES}, 0.2),
    ],
)
def test_few_channels_of_many_need_a_fraction_of_the_file(tmp_path, write, num, options, most):
    path, rng = tmp_path / NAMES[write], np.random.default_rng(7)
    names = [f"c{number}" for number in range(197)] + ["winding_degC", "ambient_degC", "losses_W"]
    times = {"time_s": np.arange(num) * 0.01} if write is mdf else {}
    write(path, times | {name: rng.normal(size=num) for name in names}, **options)
    tracemalloc.start()
    record = read_record(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert record.time_s.size == num
    assert len(record.unused) == 197
    assert peak < most * path.stat().st_size


@pytest.mark.parametrize(
    ("write", "library", "said"),
    [
        (mdf, "asammdf", r"heatrun\[mdf\]"),
        (tdms, "nptdms", r"heatrun\[tdms\]"),
        (excel, "openpyxl", r"needs openpyxl.*heatrun\[excel\]"),
        (parquet, "pyarrow.parquet", r"heatrun\[parquet\]"),
    ],
)
def test_without_the_library_the_remedy_is_named(tmp_path, monkeypatch, write, library, said):
    path = tmp_path / NAMES[write]
    write(path, {"time_s": np.arange(3.0), "a": np.arange(3.0)})
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=said):
        read_raw(path)
