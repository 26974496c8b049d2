"""Reader of classic netCDF files (CDF 1 and 2); netCDF 4 is HDF5."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np

from ..io.open_file import LARGEST_NUMBERS
from ..record.table import Table
from .foreign import BrokenFileError, reading
from .mat import table_of
from .stored import Stored, as_stated, wanted

WHAT = "a classic netCDF file"


def read_netcdf3(data: bytes, where: str) -> Table:
    """Read a classic netCDF file.

    Returns:
        As `heatrun.readers.mat.read_hdf5`.

    Raises:
        InputError: If the file is damaged or holds no numeric vector.
    """
    from scipy.io import netcdf_file

    with reading(WHAT, where):
        file: Any = netcdf_file(io.BytesIO(data), "r", mmap=False, maskandscale=False)
        size = sum(math.prod(item.shape) for item in file.variables.values())
        if size > LARGEST_NUMBERS:
            raise BrokenFileError(f"{size} numbers, more than the {LARGEST_NUMBERS} that are read")
        variables = {name: _value(item) for name, item in file.variables.items()}
    return table_of(variables, "netCDF 3", where)


def _value(item: Any) -> Stored | str:
    """Return the numbers of a variable, or what it is instead."""
    raw = np.asarray(item.data)
    if raw.dtype.kind not in "fiu":
        return "text"
    raw = raw.astype(raw.dtype.newbyteorder("="))
    attributes = vars(item)["_attributes"]
    return as_stated(raw, {name: attributes[name] for name in wanted(list(attributes))})
