"""Further rows of a text table whose layout is known: those that a bench has written since."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ..hints import Hints
from .encoding import CODECS, decode
from .layout import Layout, find_layout
from .lines import count_by_pieces, header_again, is_whole, joined
from .reader import ColumnHead, column_heads, parsed_cells
from .values import read_values


@dataclass(frozen=True)
class TextForm:
    """How the rows of a text table are read, as its beginning has shown.

    Attributes:
        layout: Delimiter, decimal sign, number of cells.
        heads: What stands over each column.
        codec: Python's name of the encoding.
        has_thousands: As `heatrun.bench.readers.text.values.read_values`.
    """

    layout: Layout
    heads: tuple[ColumnHead, ...]
    codec: str
    has_thousands: bool


@dataclass(frozen=True)
class Rows:
    """Rows of a text table.

    Attributes:
        values: By the name of the column, in the unit of the file, shape (time,); a column without
            a number in these rows is not there.
        num_rows: How many they are.
        num_lost: Lines with another number of cells, which hold no sample.
        odd: Columns with a cell that is neither a number nor the mark of none.
        last: The last of the lines, with its line end.
    """

    values: Mapping[str, np.ndarray]
    num_rows: int
    num_lost: int
    odd: frozenset[str]
    last: bytes


def form_of(data: bytes, where: str, hints: Hints) -> TextForm | None:
    """Return how a text table is laid out, or None if its encoding does not let it be cut.

    Args:
        data: The file from its start.
        where: The file, for messages.
        hints: What the motor file says about reading.

    Raises:
        InputError: If there is no table with a header and a line of numbers.
    """
    text, encoding = decode(data, where)
    codec = CODECS.get(encoding.partition(" ")[0])
    if codec is None:
        return None
    layout = find_layout(text, where, hints.decimal)
    heads = tuple(column_heads(layout, hints, where))
    return TextForm(replace(layout, first_line=0), heads, codec, hints.decimal is not None)


def further_rows(data: bytes, form: TextForm, where: str) -> Rows:
    """Return the rows of some lines.

    Args:
        data: Whole lines of data, each with its line end.
        form: What `form_of` returned for the beginning of the file.
        where: The file, for messages.

    Raises:
        InputError: If the lines cannot be split into cells.
    """
    text = data.decode(form.codec, "replace").replace("\r\n", "\n").replace("\r", "\n")
    body = text.encode()
    ends, num_cells, is_empty, is_blank = count_by_pieces(body, form.layout.delimiter)
    is_data = ~is_empty & ~header_again(body, ends, is_blank, form.layout)
    good = is_whole(num_cells, form.layout) & is_data
    num_lost = int(np.count_nonzero(~good & is_data))
    if not good.any():
        return Rows({}, 0, num_lost, frozenset(), b"")
    lines = joined(body, ends, good)
    cells = parsed_cells(lines, form.layout, where)
    values, odd = _values(cells, form)
    last = lines[lines.rfind(b"\n", 0, -1) + 1 :]
    return Rows(values, int(good.sum()), num_lost, odd, last)


def _values(cells: pd.DataFrame, form: TextForm) -> tuple[dict[str, np.ndarray], frozenset[str]]:
    found: dict[str, np.ndarray] = {}
    odd = set()
    for index, head in enumerate(form.heads):
        read = read_values(
            cells.iloc[:, index], form.layout.decimal, name=head.name, stated=head.stated,
            has_thousands=form.has_thousands,
        )  # fmt: skip
        if isinstance(read, str):
            odd |= {head.name} if read else set()
            continue
        if read.unreadable is not None and read.unreadable.any():
            odd.add(head.name)
        found.setdefault(head.name, read.numbers)
    return found, frozenset(odd)
