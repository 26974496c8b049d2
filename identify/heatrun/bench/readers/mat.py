"""Reader of MATLAB files: versions 5 to 7, and 7.3, which is HDF5."""

from __future__ import annotations

import io
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import InputError
from ..record import Finding
from .mat5 import DamagedFileError, read_variables
from .open_file import LARGEST_NUMBERS
from .stored import Stored, as_stated, wanted
from .table import Table

DIMENSION_ALONE = "This is a netCDF dimension but not a netCDF variable"
"""What netCDF 4 writes beside the zeros that stand for a dimension in HDF5."""

REMEDY = "Save the signals as numeric vectors of one length: save('test.mat', 't', 'Is', …)."


def read_mat(data: bytes, where: str) -> Table:
    """Read a MAT file of versions 5 to 7.

    Args:
        data: The bytes of the file.
        where: The file, for messages.

    Returns:
        Numeric vectors of one common length as columns, scalars as constants. What is neither
        (structs, cells, timeseries, matrices) is left out with a finding.

    Raises:
        InputError: If the file is damaged, of another version or holds no numeric vector.
    """
    if not data.startswith(b"MATLAB 5.0"):
        raise InputError(
            "Expected a MAT file of version 5, 7 or 7.3, got something else.",
            where=where,
            remedy="In MATLAB: save('test.mat', …, '-v7'). If it is text, name it .csv.",
        )
    try:
        variables = read_variables(data)
    except DamagedFileError as error:
        raise _damaged(where, str(error)) from error
    plain = {
        name: Stored(value) if isinstance(value, np.ndarray) else value
        for name, value in variables.items()
    }
    return table_of(plain, "MAT 5", where)


def read_hdf5(data: bytes, where: str) -> Table:
    """Read a MAT file of version 7.3, or another HDF5 file with vectors at its top level.

    Args:
        data: As `read_mat`.
        where: As `read_mat`.

    Returns:
        As `read_mat`; units, scaling and marks of missing values that stand as attributes beside
        the numbers are followed, also those of netCDF 4.

    Raises:
        InputError: As `read_mat`.
    """
    import h5py

    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            # names that begin so are MATLAB's own tables of references
            names = [name for name in map(str, file) if not name.startswith("#")]
            _check_size(file, names)
            variables = {name: _value(file, name) for name in names}
    except Exception as error:  # a damaged file raises nearly anything in there
        raise _damaged(where, f"{type(error).__name__}: {error}") from error
    return table_of(variables, "MAT 7.3 (HDF5)", where)


def _own(file: Any, name: str) -> Any:
    """Return the item of a name if all of it lies in this file, else None.

    Links, virtual and external data sets name other files, which whoever wrote this one may not
    have a right to.
    """
    import h5py

    if not isinstance(file.get(name, getlink=True), h5py.HardLink):
        return None
    item = file[name]
    is_elsewhere = isinstance(item, h5py.Dataset) and (item.is_virtual or item.external)
    return None if is_elsewhere else item


def _check_size(file: Any, names: Sequence[str]) -> None:
    """Refuse data sets that are larger unpacked than memory is meant to hold."""
    import h5py

    items = [_own(file, name) for name in names]
    size = sum(math.prod(item.shape or (0,)) for item in items if isinstance(item, h5py.Dataset))
    if size > LARGEST_NUMBERS:
        raise ValueError(f"{size} numbers, more than the {LARGEST_NUMBERS} that are read")


def _value(file: Any, name: str) -> Stored | str:
    """Return the numbers of an HDF5 item, or what it is instead."""
    import h5py

    item = _own(file, name)
    if item is None:
        return "link to another file"
    if not isinstance(item, h5py.Dataset):
        return "struct or object"
    kind = item.attrs.get("MATLAB_class", b"double")
    kind = kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)
    if kind in ("char", "cell", "struct") or "MATLAB_empty" in item.attrs:
        return {"char": "text"}.get(kind, kind)
    if str(_text(item.attrs.get("NAME", ""))).startswith(DIMENSION_ALONE):
        return "dimension without values"
    if item.dtype.kind not in "fiub":
        return "complex or other"
    return as_stated(item[()], {key: item.attrs[key] for key in wanted(list(item.attrs))})


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def table_of(variables: Mapping[str, Stored | str], reader: str, where: str) -> Table:
    """Return the vectors of one common length as columns, and scalars as constants.

    Args:
        variables: Name to numbers, or to what the variable is instead.
        reader: Format, for the record.
        where: The file, for messages.

    Raises:
        InputError: If there is no numeric vector.
    """
    numeric = {name: value for name, value in variables.items() if isinstance(value, Stored)}
    vectors = {name: one.values.ravel() for name, one in numeric.items() if _is_vector(one.values)}
    lengths = Counter(value.size for value in vectors.values())
    if not lengths:
        held = ", ".join(variables) or "nothing"
        raise InputError(
            f"Expected numeric vectors, found none; the file holds {held}.",
            where=where,
            remedy=REMEDY,
        )
    # The length that most vectors have; of two, the longer one.
    length = max(lengths, key=lambda size: (lengths[size], size))
    columns, constants, left_out = [], {}, []
    for name, value in variables.items():
        if isinstance(value, Stored) and name in vectors and vectors[name].size == length:
            columns.append(value.column(name, vectors[name]))
        elif isinstance(value, Stored) and value.values.size == 1:
            number = float(value.values.ravel()[0])
            if value.is_plain:
                constants[name] = number
            else:  # a constant has no unit of its own
                columns.append(value.column(name, np.full(length, number)))
        else:
            left_out.append(f"{name} ({_kind(value)})")
    findings = _left_out(left_out, length, where)
    return Table(tuple(columns), {}, constants, (), findings, reader)


def _is_vector(value: np.ndarray) -> bool:
    return value.size > 1 and value.size == max(value.shape)


def _kind(value: Stored | str) -> str:
    if isinstance(value, str):
        return value
    return f"{'x'.join(str(size) for size in value.values.shape)} numbers"


def _left_out(names: list[str], length: int, where: str) -> tuple[Finding, ...]:
    if not names:
        return ()
    return (
        Finding(
            id="variables_left_out",
            severity="warning",
            message=f"Not vectors of {length} numbers and left out: {', '.join(names)}.",
            where=where,
            remedy=REMEDY,
            values={"count": len(names), "length": length},
        ),
    )


def _damaged(where: str, problem: str) -> InputError:
    return InputError(
        f"Expected a MAT file, it could not be read ({problem}).",
        where=where,
        remedy="Copy the file again from the bench; it may have been cut.",
    )
