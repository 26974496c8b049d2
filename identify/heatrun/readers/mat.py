"""Reader of MATLAB files: versions 5 to 7, and 7.3, which is HDF5.

Variables within structs, groups, cells and matrices are brought to one name each. A struct that
holds one signal, as Simulink ("structure with time": `signals(k).values`, `.label`) and dSPACE
(`Y(k).Data`, `.Name`, `.Unit`) write them, gives the signal its name and its unit.
"""

import io
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..io.open_file import LARGEST_BYTES, LARGEST_NUMBERS
from ..record.record import Finding
from ..record.table import Table, on_all_times
from .foreign import BrokenFileError, reading
from .historian import LONGEST_MARK, Variable, is_time, without_bad
from .labels import names_time
from .mat5 import DEEPEST, Text, Value, read_variables
from .stored import Stored, as_stated, wanted

Nested = Stored | str | Sequence["Nested"] | Mapping[str, "Nested"]
"""Numbers, `Text`, the kind of what is neither, elements, or fields."""

VALUES = frozenset(("values", "value", "data", "signal"))
NAMES = ("label", "name", "signalname", "title")
UNITS = ("unit", "units", "unitstring")
"""Fields of a struct of one signal, in lower case."""

TIME = "time"
"""What dSPACE calls X beside Y, whatever name it gives it."""

MOST_COLUMNS = 200
"""A matrix with more columns holds no channels."""


@dataclass(frozen=True)
class Leaf:
    """One variable."""

    name: str  # How MATLAB calls it, such as `log.signals(2).values`.
    heading: str  # What it is called in words, such as its label; mostly its own field.
    value: Stored | str  # Its numbers, or what it is instead.
    texts: tuple[str, ...] = ()  # The elements of a cell of texts.


def leaves(variables: Mapping[str, Nested], joint: str = ".") -> list[Leaf]:
    """Return every variable; a struct without any number is one itself.

    The joint stands between the names of a struct and of its field.
    """
    return [leaf for name, value in variables.items() for leaf in _leaves(name, name, value, joint)]


def _leaves(name: str, heading: str, value: Nested, joint: str) -> list[Leaf]:
    if isinstance(value, Stored | str):
        return [Leaf(name, heading, value)]
    if isinstance(value, Mapping):
        found = list(_of_struct(name, heading, value, joint))
        kind = f"struct with the fields {', '.join(value)}"
    else:
        found = []
        for number, one in enumerate(value, 1):
            called = f"{heading} {number}" if len(value) > 1 else heading
            found += _leaves(f"{name}({number})", called, one, joint)
        kind = "cell"
    if any(isinstance(one.value, Stored) for one in found):
        return found
    is_texts = not isinstance(value, Mapping) and all(isinstance(one, Text) for one in value)
    texts = tuple(str(one) for one in value) if is_texts else ()
    return [Leaf(name, heading, "texts" if texts else kind, texts)]


def _of_struct(name: str, heading: str, fields: Mapping[str, Nested], joint: str) -> Iterator[Leaf]:
    texts = {key.casefold(): one.strip() for key, one in fields.items() if isinstance(one, Text)}
    is_signal = any(key.casefold() in VALUES and _is_course(one) for key, one in fields.items())
    named = None if heading == TIME else next(filter(None, map(texts.get, NAMES)), None)
    unit = next(filter(None, (texts.get(key) for key in UNITS)), None) if is_signal else None
    for key, one in fields.items():
        path = f"{name}{joint}{key}"
        if key.casefold() in VALUES and isinstance(one, Stored) and is_signal:
            yield Leaf(path, named or heading, replace(one, unit=one.unit or unit))
        elif isinstance(one, Text) or (
            is_signal and isinstance(one, Stored | str) and not _is_course(one)
        ):
            continue  # what is said of the signal beside its values
        else:
            word = TIME if key == "X" and "Y" in fields else key
            yield from _leaves(path, word, one, joint)


def _is_course(value: Nested) -> bool:
    return isinstance(value, Stored) and value.values.size > 1


def courses(leaf: Leaf, length: int) -> list[tuple[str, str, np.ndarray]] | None:
    """Return name, heading and values of each column of so many samples, None without one."""
    if isinstance(leaf.value, str):
        return None
    values = leaf.value.values
    if is_vector(values):
        return [(leaf.name, leaf.heading, values.ravel())] if values.size == length else None
    values = values.squeeze()
    is_table = values.ndim == 2 and min(values.shape) <= MOST_COLUMNS and length in values.shape
    if not is_table or values.shape[0] == values.shape[1]:
        return None
    is_by_row = values.shape[0] == length
    return [
        (f"{leaf.name}({f':,{k}' if is_by_row else f'{k},:'})", f"{leaf.heading} {k}", one)
        for k, one in enumerate(values.T if is_by_row else values, 1)
    ]


def is_vector(values: np.ndarray) -> bool:
    """Return whether an array has one dimension that counts, and several numbers."""
    return values.size > 1 and values.size == max(values.shape)


DIMENSION_ALONE = "This is a netCDF dimension but not a netCDF variable"
"""What netCDF 4 writes beside the zeros that stand for a dimension in HDF5."""

WHAT = "a MAT file"
REMEDY = "Save the signals as numeric vectors of one length: save('test.mat', 't', 'Is', …)."
OF_OBJECTS = (
    "Save times and values of an object as vectors: t = run.Time; T = run.Data; "
    "save('test.mat', 't', 'T', …)."
)
OF_GROUPS = (
    "Save vectors of another length, with their time, as a file of their own: A.h5+B.h5 joins."
)


def read_mat(data: bytes, where: str) -> Table:
    """Read a MAT file of versions 5 to 7.

    Numeric vectors of one common length are columns, also those in structs (`log.winding_degC`) and
    cells, and the columns of matrices (`T(:,2)`); scalars are constants. What is neither
    (timeseries and other objects) is left out with a finding.

    Raises:
        InputError: If the file is damaged, of another version or holds no numeric vector.
    """
    if not data.startswith(b"MATLAB 5.0"):
        raise InputError(
            "Expected a MAT file of version 5, 7 or 7.3, got something else.",
            where=where,
            remedy="In MATLAB: save('test.mat', …, '-v7'). If it is text, name it .csv.",
        )
    with reading(WHAT, where):
        variables = read_variables(data)
    return table_of({name: _plain(value) for name, value in variables.items()}, "MAT 5", where)


def _plain(value: Value) -> Nested:
    """Return a variable of MATLAB 5, beside whose numbers nothing stands."""
    if isinstance(value, np.ndarray):
        return Stored(value)
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, list) else value


def read_hdf5(data: bytes, where: str) -> Table:
    """Read a MAT file of version 7.3, or another HDF5 file with vectors in it or in its groups.

    Units, scaling and marks of missing values that stand as attributes beside the numbers are
    followed, also those of netCDF 4.

    Raises:
        InputError: As `read_mat`.
    """
    import h5py

    with reading(WHAT, where), h5py.File(io.BytesIO(data), "r") as file:
        room = _Room(LARGEST_NUMBERS)
        # names that begin so are MATLAB's own tables of references
        names = [name for name in map(str, file) if not name.startswith("#")]
        items = {name: _own(file, name) for name in names}
        variables = {name: _value(file, item, room) for name, item in items.items()}
        is_matlab = any("MATLAB_class" in one.attrs for one in items.values() if one)
    return table_of(variables, "MAT 7.3 (HDF5)", where, joint="." if is_matlab else "/")


def _own(group: Any, name: str) -> Any:
    """Return the item of a name if all of it lies in this file, else None.

    Links, virtual and external data sets name other files, which whoever wrote this one may not
    have a right to.
    """
    import h5py

    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        return None
    item = group[name]
    return None if _is_elsewhere(item) else item


def _is_elsewhere(item: Any) -> bool:
    import h5py

    return isinstance(item, h5py.Dataset) and bool(item.is_virtual or item.external)


@dataclass
class _Room:
    """How many numbers may still be read; data sets may be larger unpacked than memory."""

    numbers: int

    def take(self, item: Any) -> None:
        """Take the room of a data set, or refuse it."""
        size = math.prod(item.shape or (0,))
        self.numbers -= size + 1
        if self.numbers < 0:
            raise ValueError(f"{size} numbers, with which it is more than {LARGEST_NUMBERS} in all")


def _value(file: Any, item: Any, room: _Room, depth: int = 0) -> Nested:
    """Return the numbers of an HDF5 item, what it holds, or what it is instead."""
    import h5py

    if item is None:
        return "link to another file"
    if isinstance(item, h5py.Group):
        return _fields(file, item, room, depth) if depth < DEEPEST else "struct or object"
    if not isinstance(item, h5py.Dataset):
        return "struct or object"
    kind = _text(item.attrs.get("MATLAB_class", b"double"))
    if "MATLAB_empty" in item.attrs:
        return {"char": "text"}.get(kind, kind)
    if "MATLAB_object_decode" in item.attrs:  # numbers that point into a table of objects
        return f"{kind} object"
    if str(_text(item.attrs.get("NAME", ""))).startswith(DIMENSION_ALONE):
        return "dimension without values"
    room.take(item)
    if h5py.check_ref_dtype(item.dtype) is h5py.Reference and depth < DEEPEST:
        found = [file[one] for one in item[()].ravel(order="F") if one]
        return [_value(file, None if _is_elsewhere(one) else one, room, depth + 1) for one in found]
    if kind == "char":
        return Text("".join(map(chr, item[()].ravel())))
    if item.dtype.names:
        rows = item[()]
        columns = {name: rows[name] for name in item.dtype.names}
        return {
            name: Stored(values.astype(float))
            if values.dtype.kind in "fiub"
            else _texts(values)
            if h5py.check_string_dtype(values.dtype)
            else "text"
            for name, values in columns.items()
        }
    if kind in ("cell", "struct"):
        return kind
    if h5py.check_string_dtype(item.dtype):
        return _texts(item)
    if item.dtype.kind not in "fiub":
        return "complex or other"
    raw = item[()]
    stated = {key: item.attrs[key] for key in wanted(list(item.attrs))}
    # MATLAB stores its columns one behind the other
    return as_stated(raw.T if "MATLAB_class" in item.attrs else raw, stated)


def _texts(item: Any) -> Nested:
    """Return the texts of an HDF5 data set or of one of its fields, or what it is instead.

    They are read part by part: references of a few bytes may stand for one long text each.
    """
    if item.ndim == 0:
        return Text(_text(item[()]).strip("\0 "))
    file = getattr(item, "file", None)
    longest = max(item.dtype.itemsize, file.id.get_filesize() if file else 1)
    step = max(1, LARGEST_BYTES // longest)
    texts: list[Nested] = []
    num_letters = 0
    for start in range(0, item.shape[0] if item.ndim == 1 else 0, step):
        part = [_text(one).rstrip("\0 ") for one in item[start : start + step].tolist()]
        num_letters += sum(map(len, part))
        texts += map(Text, part)
        if num_letters > LONGEST_MARK * len(texts):
            return "text"
    return texts or "text"


def _fields(file: Any, group: Any, room: _Room, depth: int) -> Nested:
    """Return the fields of a group; of MATLAB's array of structs the elements."""
    room.numbers -= len(group)
    fields = {str(name): _value(file, _own(group, name), room, depth + 1) for name in group}
    lists = {name: one for name, one in fields.items() if isinstance(one, list)}
    is_array = _text(group.attrs.get("MATLAB_class", "")) == "struct" and len(lists) == len(fields)
    if not is_array or len({len(one) for one in lists.values()}) != 1:
        return fields
    rows = zip(*lists.values(), strict=True)
    return [dict(zip(lists, row, strict=True)) for row in rows]


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def table_of(
    variables: Mapping[str, Nested], reader: str, where: str, *, joint: str = "."
) -> Table:
    """Return the courses of one common length as columns, and scalars as constants.

    Variables are numbers, the fields of a struct or a group, or what a variable is instead; the
    joint stands between the names of a struct and of its field.

    Raises:
        InputError: If there is no numeric vector.
    """
    found, marks, bad = _without_bad(leaves(variables, joint), where)
    arrays = [one.value.values for one in found if isinstance(one.value, Stored)]
    lengths = Counter(max(one.shape) for one in arrays if one.size > 1)
    if not lengths:
        kinds = {one.name: one.value for one in found if isinstance(one.value, str)}
        held = ", ".join(
            f"{name} ({_kind(kinds[name])})" if name in kinds else name for name in variables
        )
        raise InputError(
            f"Expected numeric vectors, found none; the file holds {held or 'nothing'}.",
            where=where,
            remedy=_remedy(found),
        )
    groups = _own_times(found, joint)
    if len({_size(times) for times, _ in groups}) > 1:
        rest = [leaf for leaf in found if leaf.name not in marks or not leaf.texts]
        table = _joined(groups, rest, reader, where, is_grouped=joint == "/")
        return replace(table, findings=(*bad, *table.findings))
    # The length that most variables have; settings are short, so that a long one weighs more.
    length = max(lengths, key=lambda size: (lengths[size] * math.log(size), size))
    columns, constants, left_out = [], {}, []
    titles = _titles(variables, found, length)
    cells = {cell for cell, _ in titles.values()}
    for leaf in (one for one in found if one.name not in cells):
        value = leaf.value
        parts = courses(leaf, length)
        if parts is not None and leaf.name in titles:
            rows = zip(parts, titles[leaf.name][1], strict=True)
            parts = [(name, head, values) for (name, _, values), head in rows]
        if parts is not None and isinstance(value, Stored):
            columns += [value.column(name, part, heading=head) for name, head, part in parts]
        elif isinstance(value, Stored) and value.values.size == 1:
            number = float(value.values.ravel()[0])
            if value.is_plain:
                constants[leaf.name] = number
            else:  # a constant has no unit of its own
                columns.append(value.column(leaf.name, np.full(length, number)))
        elif leaf.name not in marks:
            left_out.append(leaf)
    findings = _left_out(left_out, length, where, is_grouped=joint == "/")
    return Table(tuple(columns), {}, constants, (), (*bad, *findings), reader)


def _without_bad(
    found: Sequence[Leaf], where: str
) -> tuple[list[Leaf], frozenset[str], list[Finding]]:
    """Return variables without the readings marked as not good, and the names of the marks."""
    variables = []
    for leaf in found:
        value = leaf.value
        if isinstance(value, Stored):
            numbers = value.values.squeeze()
            is_course = is_vector(numbers)
            column = value.column(leaf.heading, numbers.ravel())
            is_clock = is_course and is_time(column, is_first=False)
            cells = numbers if is_course else None
            variables.append(Variable(leaf.name, cells, numbers, is_clock))
        else:
            variables.append(Variable(leaf.name, np.array(leaf.texts) if leaf.texts else None))
    kept, marks, findings = without_bad(variables, where, is_ordered=False)
    masked = [
        replace(leaf, value=replace(leaf.value, values=kept[i]))
        if i in kept and isinstance(leaf.value, Stored)
        else leaf
        for i, leaf in enumerate(found)
    ]
    return masked, frozenset(found[i].name for i in marks), findings


Group = tuple[Leaf, list[Leaf]]
"""The times of a group or struct, and what it holds besides that is as long."""


def _own_times(found: Sequence[Leaf], joint: str) -> list[Group]:
    """Return the groups that have times of their own, all in one unit; none otherwise."""
    held: dict[str, list[Leaf]] = {}
    for leaf in found:
        if isinstance(leaf.value, Stored) and is_vector(leaf.value.values):
            held.setdefault(leaf.name.rpartition(joint)[0], []).append(leaf)
    groups = []
    for leaves_of in held.values():
        times = [leaf for leaf in leaves_of if names_time(leaf.heading)]
        others = [leaf for leaf in leaves_of if leaf not in times]
        alike = [one for one in others if _size(one) == _size(times[0])] if times else []
        if len(times) == 1 and alike and np.all(np.diff(_numbers(times[0])) > 0.0):
            groups.append((times[0], alike))
    return groups if len({getattr(one.value, "unit", None) for one, _ in groups}) == 1 else []


def _numbers(leaf: Leaf) -> np.ndarray:
    assert isinstance(leaf.value, Stored)
    return leaf.value.values.ravel()


def _size(leaf: Leaf) -> int:
    return _numbers(leaf).size


def _joined(
    groups: Sequence[Group], found: Sequence[Leaf], reader: str, where: str, *, is_grouped: bool
) -> Table:
    """Return a table on the times of all groups, whose columns are empty at those of others."""
    owned = [(times, leaf) for times, held in groups for leaf in held]
    moments, spread = on_all_times(
        [_numbers(times) for times, _ in owned], [_numbers(leaf) for _, leaf in owned]
    )
    used = {leaf.name for pair in owned for leaf in pair}
    columns = [
        leaf.value.column(name, values, heading=leaf.heading)
        for leaf, name, values in (
            (groups[0][0], groups[0][0].heading, moments),
            *((leaf, leaf.name, each) for (_, leaf), each in zip(owned, spread, strict=True)),
        )
        if isinstance(leaf.value, Stored)
    ]
    rest = [leaf for leaf in found if leaf.name not in used]
    scalars = [leaf for leaf in rest if isinstance(leaf.value, Stored) and _size(leaf) == 1]
    findings = _left_out(
        [leaf for leaf in rest if leaf not in scalars], moments.size, where, is_grouped=is_grouped
    )
    return Table(
        tuple(columns), {}, {leaf.name: float(_numbers(leaf)[0]) for leaf in scalars},
        (f"{len(groups)} groups, each with the times of its own.",), tuple(findings), reader,
        is_by_tag=True,
    )  # fmt: skip


def _titles(
    variables: Mapping[str, Nested], found: Sequence[Leaf], length: int
) -> dict[str, tuple[str, list[str]]]:
    """Return matrices with as many columns as a cell has texts, to its name and the texts."""
    widths = {leaf.name: len(parts) for leaf in found if (parts := courses(leaf, length))}
    named = {}
    for name, cell in variables.items():
        texts: list[str] = []
        if isinstance(cell, list) and all(isinstance(one, Text) for one in cell):
            texts = [str(one) for one in cell]
        alike = [matrix for matrix, width in widths.items() if width == len(texts) > 1]
        if len(alike) == 1:
            named[alike[0]] = name, texts
    return named


def _kind(value: Stored | str) -> str:
    if isinstance(value, str):
        return "text" if isinstance(value, Text) else value
    return f"{'x'.join(str(size) for size in value.values.shape)} numbers"


def _remedy(found: Sequence[Leaf]) -> str:
    is_object = any(isinstance(one.value, str) and "object" in one.value for one in found)
    return OF_OBJECTS if is_object else REMEDY


def _left_out(
    found: Sequence[Leaf], length: int, where: str, *, is_grouped: bool
) -> Iterator[Finding]:
    if found:
        names = [f"{one.name} ({_kind(one.value)})" for one in found]
        yield Finding(
            "variables_left_out",
            "warning",
            f"Not vectors of {length} numbers and left out: {', '.join(names)}.",
            where,
            OF_GROUPS if is_grouped else _remedy(found),
            values={"count": len(names), "length": length},
        )


CLASSIC = "a classic netCDF file"


def read_netcdf3(data: bytes, where: str) -> Table:
    """Read a classic netCDF file; as `read_hdf5`.

    Raises:
        InputError: If the file is damaged or holds no numeric vector.
    """
    from scipy.io import netcdf_file

    with reading(CLASSIC, where):
        file: Any = netcdf_file(io.BytesIO(data), "r", mmap=False, maskandscale=False)
        size = sum(math.prod(item.shape) for item in file.variables.values())
        if size > LARGEST_NUMBERS:
            raise BrokenFileError(f"{size} numbers, more than the {LARGEST_NUMBERS} that are read")
        variables = {name: _numbers_of(item) for name, item in file.variables.items()}
    return table_of(variables, "netCDF 3", where)


def _numbers_of(item: Any) -> Stored | str:
    """Return the numbers of a variable, or what it is instead."""
    raw = np.asarray(item.data)
    if raw.dtype.kind not in "fiu":
        return "text"
    raw = raw.astype(raw.dtype.newbyteorder("="))
    attributes = vars(item)["_attributes"]
    return as_stated(raw, {name: attributes[name] for name in wanted(list(attributes))})
