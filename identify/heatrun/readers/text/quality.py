"""Columns that say of readings whether they are good, as historians and OPC servers write them.

A reading that is not marked as good counts as missing, as do those that a measurement file
invalidates.
"""

from __future__ import annotations

import re
from collections.abc import Container, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ...io.quantities import printable
from ...record.record import Finding
from ...record.table import Column
from ...record.units import find_unit
from ..labels import names_time

GOOD = r"(?:good|ok|valid|gut|gültig|buon[oa]|valid[oaei]|bonn?e?)\b.*"
NOT_GOOD = (
    r"(?:bad|uncertain|questionable|invalid|not (?:good|valid)|schlecht|ungültig|unsicher|"
    r"non (?:valid|buon)[oae]|cattiv[oa]|incert[oaei]|mauvaise?|invalide|douteu(?:x|se))\b.*"
)
"""Cells of a column of marks, in lower case: each is one of them, and few are empty."""

IS_QUALITY = re.compile(r"quality|statuscode|qualität|qualità|qualité")
IS_VALID = re.compile(r"validity|valid|gültig|valido")
IS_STATE = re.compile(rf"{IS_QUALITY.pattern}|{IS_VALID.pattern}|status|state")
"""Words of the names of such columns: of codes of the quality, of 1 for valid, and of both."""

UA_NOT_GOOD, DA_GOOD, DA_MOST = 2**30, 192, 255
"""Codes of OPC: UA marks good as 0 and what is not from the first on, DA what is below the second.
"""


def without_bad(
    columns: Sequence[Column],
    places: Sequence[int],
    frame: pd.DataFrame,
    names: Sequence[str],
    lines: np.ndarray,
    where: str,
) -> tuple[list[Column], list[Finding]]:
    """Return the columns of a table without the readings that it does not mark as good.

    Args:
        columns: As read.
        places: The place of each in the file.
        frame: The cells of the file.
        names: What stands above them.
        lines: Numbers of their lines, from 1, shape (time,).
        where: The file, for messages.
    """
    found = {place: _not_good(frame.iloc[:, place], name) for place, name in enumerate(names)}
    marks = {place: bad for place, bad in found.items() if bad is not None}
    kept, findings = list(columns), []
    read = {
        place: i
        for i, place in enumerate(places)
        if place not in marks and not _is_time(columns[i], is_first=i == 0)
    }
    for place, bad in marks.items():
        is_lost, lost = np.zeros_like(bad), []
        for i in _marked(place, len(marks), names, read):
            column = kept[read[i]]
            is_its = bad & np.isfinite(column.values)
            if is_its.any():
                kept[read[i]] = replace(column, values=np.where(bad, np.nan, column.values))
                is_lost, lost = is_lost | is_its, [*lost, column.name]
        if not lost:
            continue
        first, line = frame.iloc[:, place][is_lost].iloc[0], int(lines[is_lost][0])
        count = int(is_lost.sum())
        findings.append(
            Finding(
                id="unreadable_cells",
                severity="warning",
                message=f"{count} of {bad.size} readings are marked as not good by "
                f"'{names[place]}'; the first mark is '{printable(str(first)[:40])}' in line "
                f"{line}. They count as missing.",
                where=f"{where}, column{'s' * (len(lost) > 1)} {', '.join(lost)}",
                remedy=f"If they are good after all, export without '{names[place]}'.",
                values={"count": count, "first_line": line},
            )
        )
    return kept, findings


def _is_time(column: Column, *, is_first: bool) -> bool:
    return (
        column.is_seconds
        or find_unit(column.unit or "", "time") is not None
        or names_time(column.name)
        or (is_first and bool(np.all(np.diff(column.values) > 0.0)))
    )


def _not_good(cells: pd.Series, name: str) -> np.ndarray | None:
    """Return which samples a column marks as not good, None for a column of no marks."""
    if pd.api.types.is_bool_dtype(cells.dtype):
        return ~cells.to_numpy() if IS_VALID.search(name.casefold()) else None
    if pd.api.types.is_numeric_dtype(cells.dtype):
        return _not_good_codes(cells.to_numpy(dtype=float), name.casefold())
    texts = cells.astype(object).where(cells.notna(), "").astype(str).str.strip().str.lower()
    if 2 * np.sum(texts != "") < texts.size:  # remarks
        return None
    known = texts.drop_duplicates()
    bad = known[known.str.fullmatch(NOT_GOOD)]
    others = known[~known.isin(bad)]
    is_marks = (others.str.fullmatch(GOOD) | (others == "")).all()
    return texts.isin(bad).to_numpy() if is_marks else None


def _not_good_codes(codes: np.ndarray, name: str) -> np.ndarray | None:
    is_valid = IS_VALID.search(name)
    if not is_valid and not IS_QUALITY.search(name):
        return None
    values = set(codes[np.isfinite(codes)].tolist())
    if is_valid:
        return codes == 0.0 if values <= {0.0, 1.0} else None
    if not values or min(values) < 0.0:
        return None
    if min(values) == 0.0 and all(value >= UA_NOT_GOOD for value in values - {0.0}):
        return codes >= UA_NOT_GOOD
    return codes < DA_GOOD if DA_GOOD <= max(values) <= DA_MOST else None


def _marked(place: int, num_marks: int, names: Sequence[str], read: Container[int]) -> list[int]:
    """Return the places of the columns that a column marks."""
    stem = letters(IS_STATE.sub("", names[place].casefold()))
    called = [i for i, name in enumerate(names) if i in read and stem and stem in letters(name)]
    if len(called) == 1:
        return called
    if num_marks == 1:
        return [i for i, _ in enumerate(names) if i in read]
    return [place - 1] if place - 1 in read else []


def letters(name: str) -> str:
    """Return the letters and digits of a name alone, in lower case."""
    return re.sub(r"[\W_]", "", name.casefold())
