"""HDF5, netCDF, Parquet, MATLAB, MDF and TDMS, and what they state beside their numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import scipy.io

from .case import Case, Truth
from .headers import subject
from .statements import NAMES
from .table import Sheet, sheet
from .units import SEVEN
from .writers import SPELLED, Attributes, hdf, mdf, parquet, tdms

HDF, PARQUET, OTHER = "HDF5 and netCDF", "Parquet", "MATLAB, MDF and TDMS"
READ, ASK, PLAIN, CONFLICT = Truth.READ, Truth.ASK, Truth.PLAIN, Truth.CONFLICT


def named(number: int, units: dict[str, str] | None = None, rows: int = 240, **more: Any) -> Sheet:
    """Return a heat run under names that say nothing of units."""
    stems = {"time_s": "time", "phase_current_A": "phase_current", "losses_W": "losses",
             "ambient_degC": "ambient", "winding_degC": "winding"}  # fmt: skip
    more.setdefault("headers", stems)
    return sheet(number, rows=rows, units=units, **more)


def stated(made: Sheet, key: str = "units", spell: Mapping[str, str] | None = None) -> Attributes:
    """Return the units of all columns as attributes."""
    spell = {**SPELLED, **(spell or {})}
    return {c.channel: {key: spell.get(c.unit, c.unit)} for c in made.columns}


KINDS: tuple[dict[str, str], ...] = (
    {}, {"losses_W": "kW"}, {"winding_degC": "K", "ambient_degC": "K"}, {"time_s": "min"},
    {"time_s": "ms", "phase_current_A": "mA"}, {"winding_degC": "degF"}, {"losses_W": "mW"},
    {"time_s": "h", "losses_W": "MW"},
)  # fmt: skip


def hdf_files() -> Iterator[Case]:
    """Attributes of HDF5 and netCDF are statements of the file."""
    number = 0
    for units in KINDS:
        for suffix in (".h5", ".mat", ".nc"):
            made = named(number, units)
            content = hdf(made, stated(made), row=suffix == ".mat", netcdf=suffix == ".nc")
            yield made.case(HDF, f"units {units or 'plain'}, {suffix}", READ, content,
                            suffix=suffix, subject=subject())  # fmt: skip
            number += 1
    for key in ("unit", "Units", "Unit", "UNITS", "unit_string"):
        made = named(number, {"losses_W": "kW"})
        yield made.case(HDF, f"attribute {key}", READ, hdf(made, stated(made, key)), suffix=".h5",
                        subject=subject())  # fmt: skip
        number += 1
    made = named(1, {"losses_W": "kW"})
    yield made.case(HDF, "attributes as bytes", READ, hdf(made, stated(made), text=bytes),
                    suffix=".h5", subject=subject())  # fmt: skip
    yield made.case(HDF, "in a group", ASK, hdf(made, stated(made), group="bench"), suffix=".h5",
                    subject=subject())  # fmt: skip
    for word, unit in (("minutes", "min"), ("hours", "h"), ("seconds", "s"), ("milliseconds", "ms"),
                       ("days", "d")):  # fmt: skip
        for suffix in (".nc", ".h5"):
            made = named(number, {"time_s": unit})
            attributes = {**stated(made), "time_s": {
                "units": f"{word} since 2024-05-17 10:00:00", "calendar": "standard"}}  # fmt: skip
            yield made.case(HDF, f"{word} since, {suffix}", READ,
                            hdf(made, attributes, netcdf=suffix == ".nc"), suffix=suffix,
                            subject=subject())  # fmt: skip
        number += 1
    for name, kind, scale, offset in (
        ("int16", "i2", 0.01, 0.0), ("int16 with offset", "i2", 0.005, 60.0),
        ("uint16", "u2", 0.01, 0.0), ("int32", "i4", 1e-4, 0.0), ("uint8", "u1", 0.5, 0.0),
    ):  # fmt: skip
        for suffix in (".nc", ".h5"):
            made = named(number, {})
            tolerance = {**made.tolerance, "winding_degC": 0.51 * scale}
            made = Sheet(made.number, made.columns, made.truth, tolerance)
            attributes = {**stated(made), "winding_degC": {
                "units": "degC", "scale_factor": scale, "add_offset": offset}}  # fmt: skip
            content = hdf(made, attributes, packed={"winding_degC": (kind, scale, offset)})
            yield made.case(HDF, f"packed as {name}, {suffix}", READ, content, suffix=suffix,
                            subject=subject("scale"))  # fmt: skip
        number += 1
    for place, (key, value) in enumerate((
        ("scale_factor", 0.001), ("add_offset", -273.15), ("scale_factor", np.float32(0.5)),
        ("scale_factor", np.array([0.001])),
    )):  # fmt: skip
        made = named(place)
        factor = float(np.ravel(value)[0])
        values = {
            "winding_degC": (lambda v, f=factor, k=key: v / f if k == "scale_factor" else v - f)
        }
        columns = tuple(
            type(c)(
                c.channel, c.header, c.cells, values.get(c.channel, lambda v: v)(c.numbers), c.unit
            )
            for c in made.columns
        )
        scaled = Sheet(made.number, columns, made.truth, made.tolerance)
        attributes = {**stated(made), "winding_degC": {"units": "degC", key: value}}
        yield scaled.case(HDF, f"float with {key} {value}", READ, hdf(scaled, attributes),
                          suffix=".h5", subject=subject("scale", "offset"))  # fmt: skip
    for name, key, fill in (
        ("_FillValue", "_FillValue", -32768),
        ("missing_value", "missing_value", -9999),
    ):
        made = named(number)
        truth = {channel: values.copy() for channel, values in made.truth.items()}
        truth["winding_degC"][[50, 51, 120]] = np.nan
        columns = tuple(
            type(c)(c.channel, c.header, c.cells, np.round(truth["winding_degC"], 4), c.unit)
            if c.channel == "winding_degC" else c for c in made.columns
        )  # fmt: skip
        tolerance = {**made.tolerance, "winding_degC": 0.006}
        holes = Sheet(made.number, columns, truth, tolerance)
        attributes = {
            **stated(made),
            "winding_degC": {
                "units": "degC",
                "scale_factor": 0.01,
                "add_offset": 0.0,
                key: np.int16(fill),
            },
        }
        content = hdf(holes, attributes, packed={"winding_degC": ("i2", 0.01, 0.0, fill)})
        yield holes.case(
            HDF,
            name,
            READ,
            content,
            suffix=".nc",
            true_faults=frozenset({"nan_block"}),
            subject=subject("fill", "missing", "winding"),
        )
        number += 1
    made = named(2, {"losses_W": "kW"}, headers={"losses_W": "losses [W]"})
    yield made.case(
        HDF,
        "name says W, attribute kW",
        CONFLICT,
        hdf(made, {"losses_W": {"units": "kW"}}),
        suffix=".h5",
        subject="says|conflict|contradict|unit",
    )
    made = sheet(3, rows=240, units={"winding_degC": "K"}, headers={"winding_degC": "winding_degC"})
    yield made.case(HDF, "canonical name, attribute K", CONFLICT,
                    hdf(made, {"winding_degC": {"units": "K"}}), suffix=".h5",
                    subject="says|conflict|contradict|unit")  # fmt: skip
    for text in ("x1000 W", "arbitrary", "kVA"):
        made = named(number, {"losses_W": "kW"})
        yield made.case(HDF, f"attribute {text}", ASK,
                        hdf(made, {**stated(made), "losses_W": {"units": text}}), suffix=".h5",
                        subject="unit")  # fmt: skip
        number += 1
    made = named(1, {})
    yield made.case(
        HDF,
        "attributes that say nothing",
        PLAIN,
        hdf(made, {"losses_W": {"units": "", "long_name": "losses", "valid_range": [0, 1e6]}}),
        suffix=".h5",
    )
    made = named(4, {"losses_W": "kW"})
    yield made.case(HDF, "kW, not stated", ASK, hdf(made), suffix=".h5", subject=subject("factor"))

    def netcdf3(path: Path) -> None:
        made = named(5, {"losses_W": "kW"})
        with scipy.io.netcdf_file(path, "w") as file:
            file.createDimension("time", len(made.truth["time_s"]))
            for column in made.columns:
                variable = file.createVariable(column.header, "f8", ("time",))
                variable[:] = column.numbers
                variable.units = column.unit

    made = named(5, {"losses_W": "kW"})
    yield made.case(HDF, "netCDF 3", ASK, netcdf3, suffix=".nc")


def parquet_files() -> Iterator[Case]:
    """Metadata of Parquet's fields."""
    number = 0
    for units in KINDS:
        for key in ("units", "unit"):
            made = named(number, units)
            yield made.case(PARQUET, f"{key} {units or 'plain'}", READ,
                            parquet(made, stated(made, key)), suffix=".parquet",
                            subject=subject())  # fmt: skip
            number += 1
    for units in KINDS[1:5]:
        made = sheet(number, rows=240, units=units)
        yield made.case(PARQUET, f"units in the names {units}", READ, parquet(made),
                        suffix=".parquet", subject=subject())  # fmt: skip
        number += 1
    made = named(1, {"losses_W": "kW"})
    yield made.case(PARQUET, "unknown unit", ASK,
                    parquet(made, {**stated(made), "losses_W": {"units": "x1000 W"}}),
                    suffix=".parquet", subject="unit")  # fmt: skip
    made = named(2, {"losses_W": "kW"}, headers={"losses_W": "losses [W]"})
    yield made.case(PARQUET, "name says W, metadata kW", CONFLICT,
                    parquet(made, {"losses_W": {"units": "kW"}}), suffix=".parquet",
                    subject="says|conflict|contradict|unit")  # fmt: skip
    made = named(3, {"winding_degC": "K"})
    yield made.case(PARQUET, "scale_factor and add_offset", ASK,
                    parquet(made, {"winding_degC": {"units": "K", "scale_factor": "1.0"}}),
                    suffix=".parquet", subject=subject("scale"))  # fmt: skip
    made = named(3, {"losses_W": "mW"})
    divided = Sheet(
        made.number,
        tuple(
            type(c)(
                c.channel,
                c.header,
                c.cells,
                c.numbers / (10 if c.channel == "losses_W" else 1),
                c.unit,
            )
            for c in made.columns
        ),
        made.truth,
        made.tolerance,
    )
    yield divided.case(PARQUET, "scale_factor 10", ASK,
                       parquet(divided, {"losses_W": {"units": "mW", "scale_factor": "10"}}),
                       suffix=".parquet", subject=subject("scale"))  # fmt: skip
    made = named(0, {"losses_W": "kW"})
    described = {"units": json.dumps({c.header: c.unit for c in made.columns})}
    yield made.case(
        PARQUET,
        "units in the metadata of the table",
        ASK,
        parquet(made, None, described),
        suffix=".parquet",
        subject=subject("factor"),
    )
    integers = {"time_s": pa.int32(), "losses_W": pa.int64()}
    made = named(3, decimals={"time_s": 0, "losses_W": 0})
    yield made.case(PARQUET, "integers", PLAIN, parquet(made, types=integers), suffix=".parquet")
    made = named(4, decimals={"winding_degC": 1})
    tolerance = {**made.tolerance, "winding_degC": 0.051}
    made = Sheet(made.number, made.columns, made.truth, tolerance)
    single = {"winding_degC": pa.float32()}
    yield made.case(PARQUET, "float32", PLAIN, parquet(made, types=single), suffix=".parquet")
    decimal = {"losses_W": pa.decimal128(12, 3)}
    made = named(5, decimals={"losses_W": 3})
    yield made.case(
        PARQUET,
        "decimals",
        ASK,
        parquet(
            made,
            arrays={
                "losses_W": pa.array([f"{v:.3f}" for v in made.columns[2].numbers]).cast(
                    decimal["losses_W"]
                )
            },
        ),
        suffix=".parquet",
        subject="losses",
    )
    text = parquet(
        made, arrays={"losses_W": pa.array([f"{v:.3f}" for v in made.columns[2].numbers])}
    )
    yield made.case(PARQUET, "numbers as text", ASK, text, suffix=".parquet", subject="losses")
    start = np.datetime64("2024-05-17T23:55:00", "us")
    for place, precision in enumerate(("s", "ms", "us", "ns")):
        for zone in (None, "Europe/Rome"):
            made = named(place, headers={**NAMES, "time_s": "timestamp", "phase_current_A":
                         "phase_current", "losses_W": "losses", "ambient_degC": "ambient",
                         "winding_degC": "winding"})  # fmt: skip
            moments = start + np.round(made.truth["time_s"] * 1e6).astype("timedelta64[us]")
            array = (
                pa.array(moments)
                .cast(pa.timestamp(precision))
                .cast(pa.timestamp(precision, tz=zone))
            )
            yield made.case(PARQUET, f"timestamps in {precision}, zone {zone}", READ,
                            parquet(made, arrays={"time_s": array}), suffix=".parquet")  # fmt: skip
    made = named(1)
    spans = pa.array(np.round(made.truth["time_s"] * 1e3).astype("timedelta64[ms]"))
    yield made.case(PARQUET, "durations", READ, parquet(made, arrays={"time_s": spans}),
                    suffix=".parquet", subject="time")  # fmt: skip


def other_files() -> Iterator[Case]:
    """MATLAB 5, MDF and TDMS."""
    number = 0
    for units in ({}, {"losses_W": "kW"}, {"winding_degC": "K"}, {"time_s": "min"}):
        headers = {"time_s": "t", "phase_current_A": "Is", "losses_W": "Pd", "ambient_degC": "Te",
                   "winding_degC": "Tw_m"}  # fmt: skip
        made = sheet(number, rows=240, units=units, headers=headers)
        spec = {}
        for channel, unit in units.items():
            spec[channel] = f"{headers[channel]} [{unit}]"

        def mat(path: Path, made: Sheet = made) -> None:
            scipy.io.savemat(path, {c.header: c.numbers for c in made.columns})

        yield made.case(OTHER, f"MATLAB 5, [columns] {spec}", READ if spec else PLAIN, mat,
                        suffix=".mat", columns=spec)  # fmt: skip
        if spec:
            yield made.case(OTHER, f"MATLAB 5, {units}, not stated", ASK, mat, suffix=".mat",
                            subject=subject("factor", "minutes", "kelvin"))  # fmt: skip
        suffixed = sheet(number, rows=240, units=units, headers={
            channel: f"{headers[channel]}_{unit}" for channel, unit in units.items()})  # fmt: skip
        if units:
            columns = {channel: f"{headers[channel]}_{unit}" for channel, unit in units.items()}

            def suffixed_mat(path: Path, made: Sheet = suffixed) -> None:
                scipy.io.savemat(path, {c.header: c.numbers for c in made.columns})

            yield suffixed.case(OTHER, f"MATLAB 5, {units} in the names", READ, suffixed_mat,
                                suffix=".mat", columns=columns, subject=subject())  # fmt: skip
        number += 1
    for units in KINDS:
        made = named(number, {c: u for c, u in units.items() if c != "time_s"}, channels=SEVEN)
        yield made.case(OTHER, f"MDF 4, {units or 'plain'}", READ, mdf(made), suffix=".mf4",
                        subject=subject())  # fmt: skip
        yield made.case(OTHER, f"TDMS, {units or 'plain'}", READ, tdms(made, "unit_string"),
                        suffix=".tdms", subject=subject())  # fmt: skip
        number += 1
    made = named(1, {"losses_W": "kW"})
    yield made.case(OTHER, "TDMS, unit as a property of another name", ASK, tdms(made, "Unit"),
                    suffix=".tdms", subject=subject("factor"))  # fmt: skip
    yield made.case(OTHER, "TDMS, unknown unit", ASK, tdms(made, "unit_string", "x1000 W"),
                    suffix=".tdms", subject="unit")  # fmt: skip
    yield made.case(OTHER, "MDF 4, unknown unit", ASK, mdf(made, "x1000 W"), suffix=".mf4",
                    subject="unit")  # fmt: skip
    conflict = named(2, {"losses_W": "kW"}, headers={"losses_W": "losses_W"})
    yield conflict.case(
        OTHER,
        "MDF 4, name says W, unit kW",
        CONFLICT,
        mdf(conflict),
        suffix=".mf4",
        subject="says|conflict|contradict|unit",
    )
    yield conflict.case(
        OTHER,
        "TDMS, name says W, unit kW",
        CONFLICT,
        tdms(conflict, "unit_string"),
        suffix=".tdms",
        subject="says|conflict|contradict|unit",
    )
