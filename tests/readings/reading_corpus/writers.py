"""Writers of HDF5, Parquet, MDF and TDMS files."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io

from .table import Column, Sheet

Attributes = Mapping[str, Mapping[str, Any]]
SPELLED = {"degC": "°C", "degF": "°F"}
"""How a unit is spelled where it is not its own symbol."""


def hdf(
    made: Sheet, attributes: Attributes | None = None, *, packed: Mapping[str, tuple] | None = None,
    group: str = "", text: type = str, row: bool = False, netcdf: bool = False,
) -> Callable[[Path], None]:  # fmt: skip
    """Return a function that writes an HDF5 file, its data sets named after the headers.

    By channel stand the attributes, and type, scale and offset of integers. Texts are `str`, or
    `bytes` for attributes of fixed length as older programs write them; values are a row of a
    matrix, as MATLAB has them; netCDF 4 has a dimension scale.
    """
    attributes, packed = attributes or {}, packed or {}

    def write(path: Path) -> None:
        with h5py.File(path, "w") as file:
            place = file.require_group(group) if group else file
            for column in made.columns:
                values: np.ndarray = column.numbers
                if column.channel in packed:
                    kind, scale, offset, *fill = packed[column.channel]
                    whole = np.round((values - offset) / scale)
                    if fill:
                        whole = np.where(np.isnan(whole), fill[0], whole)
                    values = whole.astype(kind)
                data = place.create_dataset(column.header, data=values[None, :] if row else values)
                for key, value in attributes.get(column.channel, {}).items():
                    is_bytes = text is bytes and isinstance(value, str)
                    data.attrs[key] = np.bytes_(value.encode()) if is_bytes else value
            if netcdf:
                time = place[made.columns[0].header]
                time.make_scale("time")
                for column in made.columns[1:]:
                    place[column.header].dims[0].attach_scale(time)

    return write


def netcdf3(made: Sheet, units: Sequence[str]) -> Callable[[Path], None]:
    """Return a function that writes a classic netCDF file."""

    def write(path: Path) -> None:
        with scipy.io.netcdf_file(path, "w") as file:
            file.createDimension("time", len(made.columns[0].numbers))
            for column, unit in zip(made.columns, units, strict=True):
                variable = file.createVariable(column.header, "f8", ("time",))
                variable[:], variable.units = column.numbers, unit

    return write


def parquet(
    made: Sheet, fields: Attributes | None = None, table: Mapping[str, str] | None = None,
    types: Mapping[str, pa.DataType] | None = None, arrays: Mapping[str, pa.Array] | None = None,
) -> Callable[[Path], None]:  # fmt: skip
    """Return a function that writes a Parquet file with metadata of fields and table."""
    fields, types, arrays = fields or {}, types or {}, arrays or {}

    def write(path: Path) -> None:
        columns, schema = [], []
        for column in made.columns:
            array = arrays.get(column.channel)
            if array is None:
                values = column.numbers
                if (kind := types.get(column.channel)) is not None and pa.types.is_integer(kind):
                    values = np.round(values).astype(np.int64)
                array = pa.array(values).cast(types.get(column.channel, pa.float64()))
            columns.append(array)
            metadata = {k: str(v) for k, v in fields.get(column.channel, {}).items()}
            schema.append(pa.field(column.header, array.type, metadata=metadata or None))
        pq.write_table(
            pa.table(columns, schema=pa.schema(schema, metadata=dict(table or {}))), path
        )

    return write


def units_of(made: Sheet, losses_unit: str | None) -> tuple[np.ndarray, list[tuple[Column, str]]]:
    """Return the times, and the other columns each with its unit as it is spelled."""
    (time_s,) = (c.numbers for c in made.columns if c.channel == "time_s")
    others = [c for c in made.columns if c.channel != "time_s"]
    return time_s, [
        (c, losses_unit if losses_unit and c.channel == "losses_W" else SPELLED.get(c.unit, c.unit))
        for c in others
    ]


def mdf(made: Sheet, losses_unit: str | None = None) -> Callable[[Path], None]:
    """Return a function that writes an MDF 4 file."""

    def write(path: Path) -> None:
        import asammdf

        time_s, columns = units_of(made, losses_unit)
        with asammdf.MDF(version="4.10") as file:
            file.append([asammdf.Signal(c.numbers, time_s, name=c.header, unit=unit)
                         for c, unit in columns])  # fmt: skip
            file.save(path, overwrite=True)

    return write


def tdms(made: Sheet, key: str, losses_unit: str | None = None) -> Callable[[Path], None]:
    """Return a function that writes a TDMS file."""

    def write(path: Path) -> None:
        from nptdms import ChannelObject, TdmsWriter

        time_s, columns = units_of(made, losses_unit)
        wave = {"wf_increment": float(time_s[1]), "wf_start_offset": 0.0}
        with TdmsWriter(path) as writer:
            writer.write_segment([ChannelObject("Bench", c.header, c.numbers, {key: unit, **wave})
                                  for c, unit in columns])  # fmt: skip

    return write
