"""Unseen HDF5, netCDF, MATLAB and Parquet files."""

from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io

from .case import Case, Truth
from .table import Sheet
from .units import FIVE
from .unseen_doubts import UNIT
from .unseen_file import made, unseen
from .writers import hdf, netcdf3, parquet

READ, PLAIN, ASK, CONFLICT = Truth.READ, Truth.PLAIN, Truth.ASK, Truth.CONFLICT
NAMES = "time|I|P|Ta|Tw"
CLEAR = {"phase_current_A": {"units": "A"}, "losses_W": {"units": "kW"},
         "ambient_degC": {"units": "degC"}, "winding_degC": {"units": "degC"}}  # fmt: skip


def attributes(key: str, *units: str) -> dict[str, dict[str, Any]]:
    """Return one attribute for each channel."""
    return {channel: {key: unit} for channel, unit in zip(FIVE, units, strict=True)}


def in_kilowatts(**more: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the units of a file whose losses are in kilowatts, and more attributes."""
    said = attributes("units", "s", "A", "kW", "degC", "degC")
    return said | {channel: said[channel] | extra for channel, extra in more.items()}


def of_hdf(name: str, truth: Truth, sheet: Sheet, said: dict[str, Any], **more: Any) -> Case:
    """Return the case of an HDF5 file; a doubt is one of units."""
    if truth in (ASK, CONFLICT):
        more["subject"] = UNIT
    return unseen(name, truth, sheet, hdf(sheet, said), suffix=".h5", **more)


def hdf_files() -> Iterator[Case]:
    """Make HDF5 and netCDF 4 files."""
    n = count(1140)
    for name, key, text in (
        ("Unit", "Unit", str),
        ("UNITS of fixed length", "UNITS", bytes),
        ("unit", "unit", str),
    ):
        sheet = made(next(n), NAMES, "min - kW K K")
        content = hdf(sheet, attributes(key, "min", "A", "kW", "K", "K"), text=text)
        yield unseen(f"HDF5 with {name}", READ, sheet, content, suffix=".h5")
    for name, units, time in (
        ("minutes since", "min", "minutes since 2024-05-03 10:12:00"),
        ("hours since", "h", "hours since 2024-05-03T10:12:00Z"),
        ("days since 1900", "d", "days since 1900-01-01"),
        ("milliseconds since", "ms", "milliseconds since 1970-01-01 00:00:00 UTC"),
        ("seconds in words", "-", "seconds"),
    ):
        sheet = made(next(n), NAMES, f"{units} - kW - -")
        more = {"time_s": {"units": time, "calendar": "proleptic_gregorian"}, **CLEAR}
        yield unseen(f"netCDF 4, {name}", READ, sheet, hdf(sheet, more, netcdf=True), suffix=".nc")
    for spelled in ("degree_Celsius", "degreesC", "celsius", "°C"):
        said = attributes("units", "s", "ampere", "watt", spelled, spelled)
        yield of_hdf(f"HDF5, {spelled}", READ, made(next(n), NAMES), said)
    sheet = made(next(n), NAMES, "- - kW K K")
    more = attributes("units", "s", "A", "kW", "kelvin", "K")
    more["winding_degC"] |= {"scale_factor": 0.01, "add_offset": 273.15, "_FillValue": -32768}
    sheet.tolerance["winding_degC"] = 0.00551
    yield unseen("packed kelvins", READ, sheet, hdf(
        sheet, more, packed={"winding_degC": ("i2", 0.01, 273.15)}), suffix=".nc")  # fmt: skip
    for name, extra in (("Gain and Offset", {"Gain": 0.1, "Offset": 5.0}),
                        ("slope and intercept", {"slope": 0.1, "intercept": 5.0}),
                        ("scale and offset", {"scale": 0.1, "offset": 5.0})):  # fmt: skip
        sheet = made(next(n), NAMES)
        sheet.tolerance["winding_degC"] = 0.0501
        more = attributes("units", "s", "A", "W", "degC", "degC")
        more["winding_degC"] |= extra
        yield unseen(f"HDF5 with {name}", ASK, sheet, hdf(
            sheet, more, packed={"winding_degC": ("i2", 0.1, 5.0)}), suffix=".h5",
            subject=UNIT)  # fmt: skip
    heads, units = "time|I|P_W|Ta|Tw", "- - kW - -"
    yield of_hdf(
        "name in W, attribute in kW", CONFLICT, made(next(n), heads, units), in_kilowatts()
    )
    yield of_hdf("two attributes disagree", CONFLICT, made(next(n), NAMES, units),
                 in_kilowatts(losses_W={"long_name": "loss in W"}))  # fmt: skip
    yield of_hdf("a unit in the description", ASK, made(next(n), NAMES, units),
                 {"losses_W": {"description": "mean power loss [kW]"}})  # fmt: skip
    sheet = made(next(n), NAMES, units)
    grouped = hdf(sheet, in_kilowatts(), group="run1/data")
    yield unseen("a group below a group", READ, sheet, grouped, suffix=".h5")
    for name, row in (("canonical", False), ("canonical as rows", True)):
        sheet = made(next(n))
        yield unseen(f"HDF5, {name}", PLAIN, sheet, hdf(sheet, row=row), suffix=".h5", mapped=False)
    sheet = made(next(n))
    yield unseen("HDF5, a compound", ASK, sheet, compound(sheet), suffix=".h5", mapped=False)


def compound(sheet: Sheet) -> Callable[[Path], None]:
    """Return what writes one data set of records, as PyTables does."""

    def write(path: Path) -> None:
        fields = np.zeros(160, dtype=[(column.header, "f8") for column in sheet.columns])
        for column in sheet.columns:
            fields[column.header] = column.numbers
        with h5py.File(path, "w") as file:
            file.create_dataset("table", data=fields)

    return write


def matlab(content: dict[str, Any]) -> Callable[[Path], None]:
    """Return what writes a MATLAB 5 file."""
    return lambda path: scipy.io.savemat(path, content, do_compression=True)


def matlab_files() -> Iterator[Case]:
    """Make MATLAB files and a classic netCDF."""
    n = count(1180)

    def vectors(sheet: Sheet) -> dict[str, np.ndarray]:
        return {column.header: column.numbers for column in sheet.columns}

    sheet = made(next(n), "t|Is|Pd|Te|Tw_m")
    yield unseen(
        "MATLAB, thesis", PLAIN, sheet, matlab(vectors(sheet)), suffix=".mat", mapped=False
    )
    sheet = made(next(n), "t|Is|Pd|Te|Tw_m")
    more = {**vectors(sheet), "Ts": 5.0, "note": "bench 4", "fs": 0.2}
    yield unseen("MATLAB with scalars and text", PLAIN, sheet, matlab(more), suffix=".mat",
                 mapped=False)  # fmt: skip
    sheet = made(next(n), "time_min|I_A|P_kW|Ta_degC|Tw_K", "min - kW - K")
    content = matlab({name: values[:, None] for name, values in vectors(sheet).items()})
    yield unseen("MATLAB, units in names", READ, sheet, content, suffix=".mat")
    sheet = made(next(n), "t|Is|Pd|Te|Tw_m")
    yield unseen("MATLAB, a struct", ASK, sheet, matlab({"run": vectors(sheet)}), suffix=".mat",
                 mapped=False)  # fmt: skip
    sheet = made(next(n), NAMES, "min - kW - -")
    cells = np.array(["min", "A", "kW", "degC", "degC"], dtype=object)
    yield unseen("MATLAB with a cell of units", ASK, sheet, matlab(
        {**vectors(sheet), "units": cells}), suffix=".mat", subject=UNIT)  # fmt: skip
    sheet = made(next(n), NAMES, "min - kW - -")
    content = netcdf3(sheet, ("min", "A", "kW", "degC", "degC"))
    yield unseen("netCDF 3", ASK, sheet, content, suffix=".nc")


def parquet_files() -> Iterator[Case]:
    """Make Parquet files."""
    n = count(1200)
    sheet = made(next(n))
    yield unseen(
        "Parquet, canonical", PLAIN, sheet, parquet(sheet), suffix=".parquet", mapped=False
    )
    sheet = made(next(n), digits={channel: 2 for channel in FIVE})
    types = {channel: pa.float32() for channel in FIVE}
    sheet.tolerance.update({channel: 0.006 for channel in FIVE})
    yield unseen("Parquet, float32", PLAIN, sheet, parquet(sheet, types=types), suffix=".parquet",
                 mapped=False)  # fmt: skip
    for key in ("unit", "Units", "UNIT"):
        sheet = made(next(n), NAMES, "min - kW K K")
        content = parquet(sheet, attributes(key, "min", "A", "kW", "K", "K"))
        yield unseen(f"Parquet with {key}", READ, sheet, content, suffix=".parquet")
    sheet = made(next(n), NAMES, "- - kW - -")
    content = parquet(sheet, {"losses_W": {"description": "losses in kW"}})
    yield unseen("Parquet, a unit in the description", ASK, sheet, content, suffix=".parquet",
                 subject=UNIT)  # fmt: skip
    sheet = made(next(n), NAMES, "- - dW - -", digits={"losses_W": 0})
    content = parquet(sheet, {"losses_W": {"unit": "W", "scale": "0.1"}},
                      types={"losses_W": pa.int64()})  # fmt: skip
    yield unseen("Parquet, a scale", ASK, sheet, content, suffix=".parquet", subject=UNIT)
    sheet = made(next(n), "time|I|P_W|Ta|Tw", "- - kW - -")
    content = parquet(sheet, {"losses_W": {"unit": "kW"}})
    yield unseen("Parquet, name in W, field in kW", CONFLICT, sheet, content, suffix=".parquet",
                 subject=UNIT)  # fmt: skip
    whole = (made(1, NAMES).truth["time_s"]).astype(np.int64)
    for name, array in (
        ("durations in us", pa.array(whole * 1_000_000).cast(pa.duration("us"))),
        ("durations in s", pa.array(whole).cast(pa.duration("s"))),
        ("dates in ms with a zone", pa.array(whole * 1000 + 1_714_730_000_000).cast(
            pa.timestamp("ms", tz="Europe/Berlin"))),
        ("dates in ns", pa.array(whole * 10**9 + 1_714_730_000 * 10**9).cast(pa.timestamp("ns"))),
        ("clocks in ms", pa.array((whole + 36000) * 1000).cast(pa.int32()).cast(pa.time32("ms"))),
    ):  # fmt: skip
        sheet = made(next(n))
        truth = READ if "clocks" not in name else ASK
        yield unseen(f"Parquet, {name}", truth, sheet, parquet(sheet, arrays={"time_s": array}),
                     suffix=".parquet", columns={"time_s": "time_s"})  # fmt: skip
    sheet = made(next(n), "t|Is|Pd|Te|Tw_m")

    def indexed(path: Path) -> None:
        table = pa.table({c.header: c.numbers for c in sheet.columns})
        frame = table.to_pandas().set_index("t")
        frame.attrs = {"bench": 4}
        pq.write_table(pa.Table.from_pandas(frame), path)

    yield unseen("Parquet, the time as index of pandas", PLAIN, sheet, indexed, suffix=".parquet",
                 mapped=False)  # fmt: skip


SOURCES = (hdf_files, matlab_files, parquet_files)
