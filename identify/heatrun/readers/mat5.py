"""The numeric variables of a MATLAB 5 file (versions 5 to 7 of `save`).

SciPy reads these files too, but a damaged one can end the process in its compiled part, where no
error can be caught. What a bench stores is real numeric arrays, alone or in structs and cells, and
those take few lines.

Reference: The MathWorks, MAT-File Format, chapter 1, "Level 5 MAT-file format".
"""

import struct
import zlib
from collections.abc import Iterator

import numpy as np

from ..io.open_file import LARGEST_BYTES
from .foreign import BrokenFileError

HEADER_BYTES = 128
TAG_BYTES = 8
COMPRESSED, MATRIX = 15, 14
STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8",
          13: "u8"}  # fmt: skip
"""Number types on disk; a column of whole numbers may be stored in fewer bytes than it has."""

NUMERIC_CLASSES = range(6, 16)  # double, single and the integers
OPAQUE_CLASS = 17
CELL, STRUCT, TEXT = 1, 2, 4
CLASSES = {3: "object", 5: "sparse", 16: "function", OPAQUE_CLASS: "object such as a timeseries"}
LETTERS = {16: "utf-8", 17: "utf-16", 18: "utf-32"}
DEEPEST = 8  # structs within structs; what lies deeper is left out
COMPLEX_FLAG = 0x0800


class Text(str):
    """What a variable of letters says."""


Value = np.ndarray | str | list["Value"] | dict[str, "Value"]
"""A variable: real numbers, `Text`, the elements of an array of structs or of cells, the fields of
a struct; for all others a plain string says of what kind they are."""


def read_variables(data: bytes) -> dict[str, Value]:
    """Return the variables of a MATLAB 5 file by name, numbers as float64 in MATLAB's shape.

    Raises:
        BrokenFileError: If the file is cut or damaged.
    """
    if len(data) < HEADER_BYTES:
        raise BrokenFileError("it ends within its header")
    order = {b"IM": "<", b"MI": ">"}.get(data[HEADER_BYTES - 2 : HEADER_BYTES])
    if order is None:
        raise BrokenFileError("its header names no byte order")
    variables: dict[str, Value] = {}
    room = LARGEST_BYTES
    for kind, content in _elements(memoryview(data)[HEADER_BYTES:], order):
        if kind == COMPRESSED:
            content = _unpacked(content, room)
            room -= len(content)
            kind, content = next(_elements(content, order), (0, content))
        if kind == MATRIX and len(content):
            name, value = _variable(content, order)
            if name:  # MATLAB keeps what objects refer to in an array without a name
                variables[name] = value
    return variables


def _unpacked(content: memoryview, room: int) -> memoryview:
    machine = zlib.decompressobj()
    try:
        unpacked = machine.decompress(content, room + 1)
    except zlib.error as error:
        raise BrokenFileError(f"a compressed variable is damaged ({error})") from error
    if len(unpacked) > room:
        raise BrokenFileError(f"its variables take more than {LARGEST_BYTES // 2**20} MB")
    if not machine.eof:
        raise BrokenFileError("a compressed variable is cut")
    return memoryview(unpacked)


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of the elements that follow each other."""
    position = 0
    while position + TAG_BYTES <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, position)
        if kind >> 16:  # a small element holds its content within the tag
            kind, size, start, following = kind & 0xFFFF, kind >> 16, position + 4, TAG_BYTES
            if size > 4:
                raise BrokenFileError("a small element is too long")
        else:
            start = position + TAG_BYTES
            padding = 0 if kind == COMPRESSED else -size % 8
            following = TAG_BYTES + size + padding
        if start + size > len(data):
            raise BrokenFileError(
                f"a variable of {size} bytes is announced where {len(data) - start} are left"
            )
        yield kind, data[start : start + size]
        position += following
    if position < len(data):
        raise BrokenFileError("it ends within the head of a variable")


def _variable(content: memoryview, order: str, depth: int = 0) -> tuple[str, Value]:
    """Return name and value of a matrix element."""
    parts = _elements(content, order)
    flags = _integers(parts, order, "flags")
    if flags.size == 0:
        raise BrokenFileError("a variable has no flags")
    array_class = int(flags[0]) & 0xFF
    opaque = array_class == OPAQUE_CLASS
    shape = np.empty(0) if opaque else _integers(parts, order, "shape")
    name = _integers(parts, order, "name").astype(np.uint8).tobytes().decode("ascii", "replace")
    if array_class in (STRUCT, CELL):
        return name, _nested(parts, order, array_class, depth)
    if array_class == TEXT:
        return name, _texts(_text(parts, order), shape)
    if array_class not in NUMERIC_CLASSES:
        return name, CLASSES.get(array_class, "object")
    if int(flags[0]) & COMPLEX_FLAG:
        return name, "complex"
    values = _numbers(parts, order).astype(np.float64)
    sizes = [int(size) for size in shape]
    if len(sizes) < 2 or min(sizes) < 0 or np.prod(sizes, dtype=float) != values.size:
        raise BrokenFileError(f"variable {name} has {values.size} numbers for a shape {sizes}")
    return name, values.reshape(sizes, order="F")


def _nested(
    parts: Iterator[tuple[int, memoryview]], order: str, array_class: int, depth: int
) -> Value:
    """Return the fields of a struct, or the elements of an array of structs or cells."""
    kind = "struct" if array_class == STRUCT else "cell"
    if depth == DEEPEST:
        return kind
    fields: list[str] = []
    if array_class == STRUCT:
        length = _integers(parts, order, "field names")
        names = _integers(parts, order, "field names").astype(np.uint8).tobytes()
        step = int(length[0]) if length.size else 0
        if step < 1 or len(names) % step:
            raise BrokenFileError("the names of the fields of a struct are damaged")
        fields = [
            names[i : i + step].partition(b"\0")[0].decode("utf-8", "replace")
            for i in range(0, len(names), step)
        ]
        if not fields:
            return kind
    values: list[Value] = []
    for element, content in parts:
        if element != MATRIX:
            raise BrokenFileError(
                f"expected a value of a {kind}, found an element of type {element}"
            )
        values.append(_variable(content, order, depth + 1)[1] if len(content) else "nothing")
    if not fields:
        return values
    if len(values) % len(fields):
        raise BrokenFileError("a struct does not hold a value for each of its fields")
    structs = [
        dict(zip(fields, values[i : i + len(fields)], strict=True))
        for i in range(0, len(values), len(fields))
    ]
    return structs[0] if len(structs) == 1 else [*structs]


def _text(parts: Iterator[tuple[int, memoryview]], order: str) -> Text:
    kind, content = next(parts, (0, memoryview(b"")))
    codec = LETTERS.get(kind) or {1: "latin-1", 2: "latin-1"}.get(kind, "utf-16")
    codec += {"<": "-le", ">": "-be"}[order] if codec in ("utf-16", "utf-32") else ""
    return Text(bytes(content).decode(codec, "replace"))


def _texts(letters: Text, shape: np.ndarray) -> Value:
    """Return the rows of an array of letters, each without the blanks that fill it."""
    num_rows = int(shape[0]) if shape.size == 2 else 1
    if num_rows < 2 or len(letters) % num_rows:
        return letters
    return [Text(letters[row::num_rows].rstrip()) for row in range(num_rows)]


def _integers(parts: Iterator[tuple[int, memoryview]], order: str, what: str) -> np.ndarray:
    """Return the numbers of the next element, `what` of a variable, which must be integers."""
    numbers = _numbers(parts, order)
    if numbers.dtype.kind == "f":
        raise BrokenFileError(f"the {what} of a variable are stored as floating-point numbers")
    return numbers


def _numbers(parts: Iterator[tuple[int, memoryview]], order: str) -> np.ndarray:
    kind, content = next(parts, (0, memoryview(b"")))
    stored = STORED.get(kind)
    if stored is None:
        raise BrokenFileError(f"expected numbers, found an element of type {kind}")
    item = np.dtype(order + stored)
    if len(content) % item.itemsize:
        raise BrokenFileError("an element ends within a number")
    return np.frombuffer(content, dtype=item)
