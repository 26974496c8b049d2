"""Reader of CSV and other text tables, whatever delimiter, decimal sign and encoding they have."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pandas as pd

from ..errors import InputError
from .header import split_name
from .remarks import units_of_remarks
from .table import Column, Stated, Table
from .text_encoding import decode
from .text_layout import MISSING, Layout, find_layout
from .text_lines import data_lines, ragged_lines
from .text_values import read_values, unreadable_cells

PARSED_AS_MISSING = sorted({mark for word in MISSING for mark in (word, word.upper(), "NaN")})

# The last bit counts: what a bench wrote is what is read. From 3.1 on that is pandas' only way.
EXACT: dict[str, Any] = (
    {}
    if tuple(int(part) for part in pd.__version__.split(".")[:2]) >= (3, 1)
    else {"float_precision": "round_trip"}
)


def read_text(data: bytes, where: str) -> Table:
    """Read a text table.

    Args:
        data: The bytes of the file.
        where: The file, for messages.

    Returns:
        The columns under their names in the file. Cells that are no numbers are NaN and lines
        with another number of cells are left out, both with a finding. Clock times and dates are
        seconds.

    Raises:
        InputError: If the file holds no table with a header and at least one line of numbers.
    """
    text, encoding = decode(data, where)
    layout = find_layout(text, where)
    body = data_lines(text, layout, where)
    del text  # a gigabyte of it would be held while the cells are read
    frame = _parse(body.text, layout, where)
    columns: list[Column] = []
    texts: dict[str, str] = {}
    notes = [f"Preamble: {line}" for line in layout.preamble]
    findings = ragged_lines(body, layout, where)
    remarks = units_of_remarks(layout.preamble, layout.names)
    for index in range(layout.width):
        name = layout.names[index] if index < len(layout.names) else ""
        values = read_values(frame.iloc[:, index], layout.decimal)
        if isinstance(values, str):
            if values or name:
                texts[name or f"column {index + 1}"] = values
            continue
        if values.unreadable is None and not np.isfinite(values.numbers).any():
            if name:
                texts[name] = ""
            continue
        if index >= len(layout.names):
            raise InputError(
                f"The header names {len(layout.names)} columns, the lines of data have "
                f"{index + 1} or more.",
                where=where,
                remedy="Give each column one name, in the order of the data.",
            )
        name = name or f"column {index + 1}"
        label, unit = split_name(name, f"{where}, column {index + 1}")
        cells = [cell for row in layout.units if (cell := row[index])]
        beside = (
            *(Stated(cell, "the row of units") for cell in cells),
            *(remarks[index] if index < len(remarks) else ()),
        )
        own = [one.text for one in beside if one.scope == "column"]
        unit = unit or (own[0] if own else None)
        if values.is_time:
            unit = "s"
        columns.append(Column(name, label, unit, values.numbers, values.note, beside))
        finding = unreadable_cells(values, name, body.numbers, where)
        findings += [finding] if finding else []
    if not columns or not any(np.isfinite(column.values).any() for column in columns):
        raise InputError(
            "Expected at least one line of numbers, found none.",
            where=where,
            remedy="Check that the export contains the samples.",
        )
    reader = f"text, {layout.description}, {encoding}"
    return Table(tuple(columns), texts, {}, tuple(notes), tuple(findings), reader)


def _parse(body: bytes, layout: Layout, where: str) -> pd.DataFrame:
    """Return the cells of the body; columns that are not all numbers stay texts."""
    try:
        return pd.read_csv(
            io.BytesIO(body),
            sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
            decimal=layout.decimal,
            header=None,
            names=list(range(layout.width)),
            index_col=False,
            keep_default_na=False,
            na_values=PARSED_AS_MISSING,
            skipinitialspace=True,
            low_memory=False,  # one type for a column, not one for each piece of it
            **EXACT,
        )
    except (pd.errors.ParserError, pd.errors.EmptyDataError, ValueError, OverflowError) as error:
        raise InputError(
            f"The lines of data could not be split into cells ({error}).",
            where=where,
            remedy="Look for a quotation mark that is not closed.",
        ) from error
