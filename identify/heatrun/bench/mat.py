"""Reader of MATLAB files: version 5 and earlier by SciPy, version 7.3 (HDF5) by h5py."""

from __future__ import annotations

import io
import warnings
from collections import Counter
from collections.abc import Iterator

import numpy as np

from ..errors import InputError
from .header import split_name
from .record import Finding
from .table import Column, Table

REMEDY = "Save the signals as numeric vectors of one length: save('test.mat', 't', 'Is', …)."


def read_mat(data: bytes, where: str) -> Table:
    """Read a MAT file up to version 7.

    Args:
        data: The bytes of the file.
        where: The file, for messages.

    Returns:
        Numeric vectors of one common length as columns, scalars as constants. What is neither
        (structs, cells, timeseries, matrices) is left out with a finding.

    Raises:
        InputError: If the file is damaged or holds no numeric vector.
    """
    import scipy.io

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            content = scipy.io.loadmat(io.BytesIO(data), squeeze_me=False)
        except Exception as error:  # a damaged file raises nearly anything in there
            raise _damaged(where, error) from error
    variables = {
        name: np.asarray(value) for name, value in content.items() if not name.startswith("__")
    }
    notes = tuple(f"MAT file: {warning.message}" for warning in caught)
    return _table(variables, notes, "MAT 5", where)


def read_hdf5(data: bytes, where: str) -> Table:
    """Read a MAT file of version 7.3, or another HDF5 file with vectors at its top level.

    Args:
        data: As `read_mat`.
        where: As `read_mat`.

    Returns:
        As `read_mat`.

    Raises:
        InputError: As `read_mat`.
    """
    import h5py

    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            variables = dict(_datasets(file))
    except Exception as error:  # a damaged file raises nearly anything in there
        raise _damaged(where, error) from error
    return _table(variables, (), "MAT 7.3 (HDF5)", where)


def _datasets(file) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the variables; what is no numeric array comes as an empty object array."""
    import h5py

    unreadable = np.empty(0, dtype=object)
    for name, item in file.items():
        if name.startswith("#"):  # MATLAB's own tables of references
            continue
        is_numeric = isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub"
        kind = item.attrs.get("MATLAB_class", b"double")
        is_text = kind in (b"char", b"cell", b"struct") or "MATLAB_empty" in item.attrs
        yield name, item[()] if is_numeric and not is_text else unreadable


def _table(
    variables: dict[str, np.ndarray], notes: tuple[str, ...], reader: str, where: str
) -> Table:
    numeric = {
        name: value
        for name, value in variables.items()
        if value.dtype.kind in "fiub" and value.size
    }
    vectors = {name: value.ravel() for name, value in numeric.items() if _is_vector(value)}
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
        if name in vectors and vectors[name].size == length:
            label, unit = split_name(name)
            columns.append(Column(name, label, unit, vectors[name].astype(np.float64)))
        elif name in numeric and value.size == 1:
            constants[name] = float(value.ravel()[0])
        else:
            left_out.append(f"{name} ({_kind(value)})")
    return Table(tuple(columns), {}, constants, notes, _left_out(left_out, length, where), reader)


def _is_vector(value: np.ndarray) -> bool:
    return value.size > 1 and value.size == max(value.shape)


def _kind(value: np.ndarray) -> str:
    """Return in words what a variable is that is no column."""
    if value.dtype.kind in "US":
        return "text"
    if value.dtype.kind == "c":
        return "complex"
    if value.dtype.kind not in "fiub":
        return "struct, cell or object"
    return f"{'x'.join(str(size) for size in value.shape)} numbers"


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


def _damaged(where: str, error: Exception) -> InputError:
    return InputError(
        f"Expected a MAT file, it could not be read ({type(error).__name__}: {error}).",
        where=where,
        remedy="Copy the file again from the bench; it may have been cut.",
    )
