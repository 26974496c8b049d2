"""HDF5, netCDF, Parquet, MATLAB, MDF and TDMS, and what they state beside their numbers."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pyarrow as pa
import scipy.io

from .case import Case, Truth
from .headers import subject
from .table import STEMS, THESIS, Sheet, sheet
from .units import SEVEN
from .writers import SPELLED, Attributes, hdf, mdf, netcdf3, parquet, tdms

HDF, PARQUET, OTHER = "HDF5 and netCDF", "Parquet", "MATLAB, MDF and TDMS"
READ, ASK, PLAIN, CONFLICT = Truth.READ, Truth.ASK, Truth.PLAIN, Truth.CONFLICT
UNIT, AGAINST, FACTOR = subject(), "says|conflict|contradict|unit", subject("factor")
CLEAR = {"losses_W": "kW"}


def named(number: int, units: dict[str, str] | None = None, rows: int = 240, **more: Any) -> Sheet:
    """Return a heat run under names that say nothing of units."""
    more.setdefault("headers", STEMS)
    return sheet(number, rows=rows, units=units, **more)


def stated(made: Sheet, key: str = "units", **more: Mapping[str, Any]) -> Attributes:
    """Return the units of all columns as attributes; other attributes of some channels."""
    return {c.channel: {key: SPELLED.get(c.unit, c.unit)} for c in made.columns} | more


def of_hdf(
    name: str, truth: Truth, made: Sheet, attributes: Attributes | None = None, *,
    suffix: str = ".h5", about: str = UNIT, faults: frozenset[str] = frozenset(), **more: Any,
) -> Case:  # fmt: skip
    """Return the case of an HDF5 file; `more` is for its writer."""
    content = hdf(made, attributes, **more)
    return made.case(HDF, name, truth, content, suffix=suffix, subject=about, true_faults=faults)


def of_parquet(
    name: str, truth: Truth, made: Sheet, fields: Attributes | None = None, *, about: str = "",
    **more: Any,
) -> Case:  # fmt: skip
    """Return the case of a Parquet file; `more` is for its writer."""
    content = parquet(made, fields, **more)
    return made.case(PARQUET, name, truth, content, suffix=".parquet", subject=about)


KINDS: tuple[dict[str, str], ...] = (
    {}, {"losses_W": "kW"}, {"winding_degC": "K", "ambient_degC": "K"}, {"time_s": "min"},
    {"time_s": "ms", "phase_current_A": "mA"}, {"winding_degC": "degF"}, {"losses_W": "mW"},
    {"time_s": "h", "losses_W": "MW"},
)  # fmt: skip


def hdf_files() -> Iterator[Case]:
    """Attributes of HDF5 and netCDF are statements of the file."""
    n = count()
    for units in KINDS:
        for suffix in (".h5", ".mat", ".nc"):
            made = named(next(n), units)
            yield of_hdf(f"units {units or 'plain'}, {suffix}", READ, made, stated(made),
                         suffix=suffix, row=suffix == ".mat", netcdf=suffix == ".nc")  # fmt: skip
    for key in ("unit", "Units", "Unit", "UNITS", "unit_string"):
        made = named(next(n), CLEAR)
        yield of_hdf(f"attribute {key}", READ, made, stated(made, key))
    made = named(1, CLEAR)
    yield of_hdf("attributes as bytes", READ, made, stated(made), text=bytes)
    yield of_hdf("in a group", ASK, made, stated(made), group="bench")
    for word, unit in (("minutes", "min"), ("hours", "h"), ("seconds", "s"), ("milliseconds", "ms"),
                       ("days", "d")):  # fmt: skip
        made = named(next(n), {"time_s": unit})
        since = {"units": f"{word} since 2024-05-17 10:00:00", "calendar": "standard"}
        for suffix in (".nc", ".h5"):
            yield of_hdf(f"{word} since, {suffix}", READ, made, stated(made, time_s=since),
                         suffix=suffix, netcdf=suffix == ".nc")  # fmt: skip
    for name, kind, scale, offset in (
        ("int16", "i2", 0.01, 0.0), ("int16 with offset", "i2", 0.005, 60.0),
        ("uint16", "u2", 0.01, 0.0), ("int32", "i4", 1e-4, 0.0), ("uint8", "u1", 0.5, 0.0),
    ):  # fmt: skip
        made = named(next(n), {})
        made.tolerance["winding_degC"] = 0.51 * scale
        said = {"units": "degC", "scale_factor": scale, "add_offset": offset}
        for suffix in (".nc", ".h5"):
            yield of_hdf(f"packed as {name}, {suffix}", READ, made, stated(made, winding_degC=said),
                         suffix=suffix, about=subject("scale"),
                         packed={"winding_degC": (kind, scale, offset)})  # fmt: skip
    for place, (key, value) in enumerate((
        ("scale_factor", 0.001), ("add_offset", -273.15), ("scale_factor", np.float32(0.5)),
        ("scale_factor", np.array([0.001])),
    )):  # fmt: skip
        factor = float(np.ravel(value)[0])
        made = named(place).with_numbers(
            "winding_degC", lambda v, f=factor, k=key: v / f if k == "scale_factor" else v - f
        )
        said = {"units": "degC", key: value}
        yield of_hdf(f"float with {key} {value}", READ, made, stated(made, winding_degC=said),
                     about=subject("scale", "offset"))  # fmt: skip
    for key, fill in (("_FillValue", -32768), ("missing_value", -9999)):
        made = named(next(n))
        lost = made.truth["winding_degC"].copy()
        lost[[50, 51, 120]] = np.nan
        holes = replace(made, truth={**made.truth, "winding_degC": lost})
        holes = holes.with_numbers("winding_degC", lambda _, lost=lost: np.round(lost, 4))
        holes.tolerance["winding_degC"] = 0.006
        said = {"units": "degC", "scale_factor": 0.01, "add_offset": 0.0, key: np.int16(fill)}
        yield of_hdf(key, READ, holes, stated(made, winding_degC=said), suffix=".nc",
                     packed={"winding_degC": ("i2", 0.01, 0.0, fill)},
                     faults=frozenset({"nan_block"}),
                     about=subject("fill", "missing", "winding"))  # fmt: skip
    made = named(2, CLEAR, headers={"losses_W": "losses [W]"})
    yield of_hdf("name says W, attribute kW", CONFLICT, made, {"losses_W": {"units": "kW"}},
                 about=AGAINST)  # fmt: skip
    made = sheet(3, rows=240, units={"winding_degC": "K"}, headers={"winding_degC": "winding_degC"})
    yield of_hdf("canonical name, attribute K", CONFLICT, made, {"winding_degC": {"units": "K"}},
                 about=AGAINST)  # fmt: skip
    for text in ("x1000 W", "arbitrary", "kVA"):
        made = named(next(n), CLEAR)
        yield of_hdf(f"attribute {text}", ASK, made, stated(made, losses_W={"units": text}))
    said = {"units": "", "long_name": "losses", "valid_range": [0, 1e6]}
    yield of_hdf("attributes that say nothing", PLAIN, named(1, {}), {"losses_W": said}, about="")
    yield of_hdf("kW, not stated", ASK, named(4, CLEAR), about=FACTOR)
    made = named(5, CLEAR)
    content = netcdf3(made, [column.unit for column in made.columns])
    yield made.case(HDF, "netCDF 3", ASK, content, suffix=".nc")


def parquet_files() -> Iterator[Case]:
    """Metadata of Parquet's fields."""
    n = count()
    for units in KINDS:
        for key in ("units", "unit"):
            made = named(next(n), units)
            yield of_parquet(f"{key} {units or 'plain'}", READ, made, stated(made, key), about=UNIT)
    for units in KINDS[1:5]:
        made = sheet(next(n), rows=240, units=units)
        yield of_parquet(f"units in the names {units}", READ, made, about=UNIT)
    made = named(1, CLEAR)
    yield of_parquet("unknown unit", ASK, made, stated(made, losses_W={"units": "x1000 W"}),
                     about="unit")  # fmt: skip
    made = named(2, CLEAR, headers={"losses_W": "losses [W]"})
    yield of_parquet("name says W, metadata kW", CONFLICT, made, {"losses_W": {"units": "kW"}},
                     about=AGAINST)  # fmt: skip
    scaled = {"winding_degC": {"units": "K", "scale_factor": "1.0"}}
    yield of_parquet("scale_factor and add_offset", ASK, named(3, {"winding_degC": "K"}), scaled,
                     about=subject("scale"))  # fmt: skip
    divided = named(3, {"losses_W": "mW"}).with_numbers("losses_W", lambda v: v / 10)
    yield of_parquet("scale_factor 10", ASK, divided,
                     {"losses_W": {"units": "mW", "scale_factor": "10"}},
                     about=subject("scale"))  # fmt: skip
    made = named(0, CLEAR)
    described = {"units": json.dumps({c.header: c.unit for c in made.columns})}
    yield of_parquet("units in the metadata of the table", ASK, made, table=described, about=FACTOR)
    made = named(3, decimals={"time_s": 0, "losses_W": 0})
    yield of_parquet("integers", PLAIN, made, types={"time_s": pa.int32(), "losses_W": pa.int64()})
    made = named(4, decimals={"winding_degC": 1})
    made.tolerance["winding_degC"] = 0.051
    yield of_parquet("float32", PLAIN, made, types={"winding_degC": pa.float32()})
    made = named(5, decimals={"losses_W": 3})
    text = pa.array([f"{v:.3f}" for v in made.columns[2].numbers])
    for name, array in (("decimals", text.cast(pa.decimal128(12, 3))), ("numbers as text", text)):
        yield of_parquet(name, ASK, made, arrays={"losses_W": array}, about="losses")
    start = np.datetime64("2024-05-17T23:55:00", "us")
    for place, precision in enumerate(("s", "ms", "us", "ns")):
        for zone in (None, "Europe/Rome"):
            made = named(place, headers={**STEMS, "time_s": "timestamp"})
            moments = start + np.round(made.truth["time_s"] * 1e6).astype("timedelta64[us]")
            array = pa.array(moments).cast(pa.timestamp(precision))
            stamps = {"time_s": array.cast(pa.timestamp(precision, tz=zone))}
            name = f"timestamps in {precision}, zone {zone}"
            yield of_parquet(name, READ, made, arrays=stamps)
    made = named(1)
    spans = pa.array(np.round(made.truth["time_s"] * 1e3).astype("timedelta64[ms]"))
    yield of_parquet("durations", READ, made, arrays={"time_s": spans}, about="time")


def mat(made: Sheet) -> Any:
    """Return what writes a MATLAB 5 file."""
    return lambda path: scipy.io.savemat(path, {c.header: c.numbers for c in made.columns})


def other_files() -> Iterator[Case]:
    """MATLAB 5, MDF and TDMS."""
    n = count()
    for units in ({}, {"losses_W": "kW"}, {"winding_degC": "K"}, {"time_s": "min"}):
        number = next(n)
        made = sheet(number, rows=240, units=units, headers=THESIS)
        spec = {channel: f"{THESIS[channel]} [{unit}]" for channel, unit in units.items()}
        yield made.case(OTHER, f"MATLAB 5, [columns] {spec}", READ if spec else PLAIN, mat(made),
                        suffix=".mat", columns=spec)  # fmt: skip
        if units:
            yield made.case(OTHER, f"MATLAB 5, {units}, not stated", ASK, mat(made), suffix=".mat",
                            subject=subject("factor", "minutes", "kelvin"))  # fmt: skip
            names = {channel: f"{THESIS[channel]}_{unit}" for channel, unit in units.items()}
            made = sheet(number, rows=240, units=units, headers=names)
            yield made.case(OTHER, f"MATLAB 5, {units} in the names", READ, mat(made),
                            suffix=".mat", columns=names, subject=UNIT)  # fmt: skip
    for units in KINDS:
        made = named(next(n), {c: u for c, u in units.items() if c != "time_s"}, channels=SEVEN)
        yield made.case(OTHER, f"MDF 4, {units or 'plain'}", READ, mdf(made), suffix=".mf4",
                        subject=UNIT)  # fmt: skip
        yield made.case(OTHER, f"TDMS, {units or 'plain'}", READ, tdms(made, "unit_string"),
                        suffix=".tdms", subject=UNIT)  # fmt: skip
    made = named(1, CLEAR)
    against = named(2, CLEAR, headers={"losses_W": "losses_W"})
    for name, truth, written, content, about in (
        ("TDMS, unit as a property of another name", ASK, made, tdms(made, "Unit"), FACTOR),
        ("TDMS, unknown unit", ASK, made, tdms(made, "unit_string", "x1000 W"), "unit"),
        ("MDF 4, unknown unit", ASK, made, mdf(made, "x1000 W"), "unit"),
        ("MDF 4, name says W, unit kW", CONFLICT, against, mdf(against), AGAINST),
        ("TDMS, name says W, unit kW", CONFLICT, against, tdms(against, "unit_string"), AGAINST),
    ):
        suffix = ".tdms" if name.startswith("TDMS") else ".mf4"
        yield written.case(OTHER, name, truth, content, suffix=suffix, subject=about)
