"""Tables that are written otherwise: as JSON, or with the unit behind the number in each cell."""

import csv
import io
import json
import re
from collections.abc import Sequence

import pandas as pd

from ...record.units import QUANTITIES, find_unit, is_unit
from .values import NUMBER

WITH_UNIT = re.compile(rf"(?P<number>{NUMBER['.']}|{NUMBER[',']})\s*(?P<unit>[^\s\d.,:+-].*)")
DELIMITERS = "\t;,|"
LEAST_COLUMNS, SHOWN = 2, 50
"""Columns with a unit in each cell that such a table has at least, and lines that show it."""


def from_json(text: str) -> str:
    """Return JSON as CSV, any other text as it is.

    It is an object a line, a list of them, or one object with a list for each column.
    """
    if not text.lstrip().startswith(("{", "[")):
        return text
    try:
        try:
            read = json.loads(text)
        except json.JSONDecodeError:
            read = [json.loads(line) for line in io.StringIO(text) if line.strip()]
        is_columns = isinstance(read, dict) and any(isinstance(one, list) for one in read.values())
        frame = pd.DataFrame(read) if is_columns else pd.json_normalize(read)
    except (ValueError, TypeError, AttributeError, RecursionError):
        return text
    return frame.to_csv(index=False) if len(frame.columns) > 1 else text


def units_over_columns(text: str) -> str:
    """Return a table that has its units in the cells, as in "1.2 kW", with them in the names.

    A display changes the unit with the size of a number: then the column has that of its first
    cell. A text of other cells is returned as it is.
    """
    shown = text[-SHOWN * 200 :].split("\n")[-SHOWN:]
    count = {sign: max(sum(_unit(c) is not None for c in line) for line in _rows(shown, sign))
             for sign in DELIMITERS if sign in text}  # fmt: skip
    delimiter = max(count, key=lambda sign: count[sign], default="")
    if not delimiter or count[delimiter] < LEAST_COLUMNS:
        return text
    rows = _rows(text.split("\n"), delimiter)
    first = next(
        i for i, row in enumerate(rows) if sum(map(bool, map(_unit, row))) >= LEAST_COLUMNS
    )
    header = next((i for i in range(first - 1, -1, -1) if len(rows[i]) == len(rows[first])), None)
    if header is None:
        return text
    for k, name in enumerate(rows[header]):
        cells = [row[k] for row in rows[first:] if k < len(row)]
        unit = next(filter(None, map(_unit, cells)), None)
        kind = next((one for one in QUANTITIES if unit and find_unit(unit, one)), None)
        if unit is None or kind is None:
            continue
        rows[header][k] = f"{name} [{unit}]"
        sign = "," if any("," in cell for cell in cells) else "."
        for row in rows[first:]:
            if k < len(row):
                row[k] = _in_unit(row[k], unit, kind).replace(".", sign)
    told = io.StringIO()
    csv.writer(told, delimiter=delimiter, lineterminator="\n").writerows(rows)
    return told.getvalue()


def _rows(lines: Sequence[str], delimiter: str) -> list[list[str]]:
    return list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True))


def _unit(cell: str) -> str | None:
    found = WITH_UNIT.fullmatch(cell.strip())
    return found["unit"] if found and is_unit(found["unit"]) else None


def _in_unit(cell: str, unit: str, kind: str) -> str:
    """Return the number of a cell in a unit; the cell as it is where its own is of another kind."""
    found = WITH_UNIT.fullmatch(cell.strip())
    if found is None or not is_unit(found["unit"]):
        return cell
    number = found["number"]
    if found["unit"] == unit:
        return number
    its, common = find_unit(found["unit"], kind), find_unit(unit, kind)
    if its is None or common is None:
        return cell
    value = its.factor * float(number.replace(",", ".")) + its.offset
    return repr((value - common.offset) / common.factor)
