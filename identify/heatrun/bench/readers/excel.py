"""Reader of Excel workbooks: the sheet that is a test, read as the text reader reads a table."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from ...errors import InputError, did_you_mean
from ..channels.channel_map import map_columns
from ..channels.schema import CHANNEL, REQUIRED
from ..record import Finding
from .hints import NO_HINTS, Hints
from .table import Column, Table
from .text.reader import read_text
from .workbook import Lines, Sheet, open_workbook

PREVIEW_ROWS = 400
"""Rows of each sheet that say which one holds the test."""

PLAIN = re.compile(r"(?<![\w.,])-?[0-9]+e-?[0-9]+(?![\w.,])")


def read_excel(data: bytes, where: str, hints: Hints = NO_HINTS) -> Table:
    """Read a sheet of a workbook.

    The sheet is the one that the test names (`FILE.xlsx#SHEET`) or that `[columns]` names
    (`"SHEET/COLUMN"`), else the one with the most channels that a fit needs.

    Args:
        data: The bytes of the file, .xlsx or .xlsm.
        where: The file, for messages.
        hints: What the motor file and the command say about reading.

    Returns:
        As `heatrun.bench.readers.text.reader.read_text`; formulas with the values that the
        workbook keeps, dates and times in seconds.

    Raises:
        InputError: If the workbook is damaged, has no such sheet, no sheet or several with a test,
            or a formula without its value.
    """
    with open_workbook(data, where) as sheets:
        sheet, others = _chosen(sheets, where, hints)
        lines = sheet.lines()
    if lines.uncalculated:
        raise InputError(
            f"Cell {lines.uncalculated} of sheet '{sheet.name}' holds a formula whose value was "
            "never calculated.",
            where=where,
            remedy="Open the workbook in Excel or LibreOffice, save it there, and read it again.",
        )
    table = _table(lines, _at(where, sheet, sheets), hints)
    columns = tuple(_asked_with_sheet(column, sheet.name, hints) for column in table.columns)
    findings = (*table.findings, *_other_sheets(sheet, others, where))
    notes = tuple(_readable(note) for note in table.notes)
    reader = f"Excel, sheet '{sheet.name}'"
    return replace(table, columns=columns, findings=findings, notes=notes, reader=reader)


def _table(lines: Lines, where: str, hints: Hints) -> Table:
    # the mark in front settles the encoding
    return read_text(f"\ufeff{lines.text}".encode(), where, hints, delimiters=("\t",))


def _readable(note: str) -> str:
    """Return a note with its numbers and cells as a person writes them."""
    return " ".join(PLAIN.sub(lambda found: f"{float(found[0]):g}", note).split())


def _at(where: str, sheet: Sheet, sheets: Sequence[Sheet]) -> str:
    return where if len(sheets) == 1 else f"{where}, sheet '{sheet.name}'"


def _chosen(sheets: Sequence[Sheet], where: str, hints: Hints) -> tuple[Sheet, list[str]]:
    """Return the sheet of the test, and the names of others that could be one too."""
    asked = hints.sheet or next(
        (one.name for one in sheets for claim in hints.claims
         if claim.text.startswith(f"{one.name}/")), None
    )  # fmt: skip
    if asked is not None:
        for sheet in sheets:
            if sheet.name == asked:
                return sheet, []
        names = [sheet.name for sheet in sheets]
        raise InputError(
            f"The workbook has no sheet '{asked}'. {did_you_mean(asked, names)}".strip(),
            where=where,
            remedy=f"Its sheets are: {', '.join(names)}.",
        )
    visible = [sheet for sheet in sheets if not sheet.is_hidden] or list(sheets)
    if len(visible) == 1:
        return visible[0], []
    scores: dict[str, int] = {}
    reasons = []
    for sheet in visible:
        try:
            scores[sheet.name] = _num_needed(sheet, _at(where, sheet, sheets), hints)
        except InputError as error:
            reasons.append(f"{sheet.name}: {error.problem}")
    if not scores:
        raise InputError(
            f"None of the sheets holds a table of numbers below a row of names ({reasons[0]})"
            if reasons
            else "The workbook has no sheets.",
            where=where,
            remedy="Check that the workbook contains the samples.",
        )
    best = [name for name, score in scores.items() if score == max(scores.values())]
    if len(best) > 1:
        raise InputError(
            f"The sheets {' and '.join(repr(name) for name in best)} may each be the test.",
            where=where,
            remedy=f"Name the sheet behind the file: '{where}#{best[0]}'.",
        )
    sheet = next(sheet for sheet in visible if sheet.name == best[0])
    return sheet, [name for name in scores if name != sheet.name]


def _num_needed(sheet: Sheet, where: str, hints: Hints) -> int:
    """Return how many channels that a fit needs the first rows of a sheet have.

    Raises:
        InputError: If they are no table.
    """
    table = _table(sheet.lines(PREVIEW_ROWS), where, hints)
    columns = {claim.channel: claim.text for claim in hints.claims}
    try:
        found = map_columns(table, columns, where=where, is_part=True).channels
    except InputError as error:  # a question about a column that it has
        return sum(name in str(error) for name in REQUIRED)
    return sum(name in found for name in REQUIRED) * len(CHANNEL) + len(found)


def _asked_with_sheet(column: Column, sheet: str, hints: Hints) -> Column:
    """Return a column under the name `SHEET/COLUMN` where `[columns]` asks for it so."""
    asked = {text for claim in hints.claims for text in (claim.text, claim.base, claim.label)}
    if not {f"{sheet}/{column.name}", f"{sheet}/{column.label}"} & asked:
        return column
    return replace(
        column,
        name=f"{sheet}/{column.name}",
        label=f"{sheet}/{column.label}",
        heading=column.heading or column.name,
    )


def _other_sheets(sheet: Sheet, others: Sequence[str], where: str) -> tuple[Finding, ...]:
    if not others:
        return ()
    return (
        Finding(
            id="sheet_chosen",
            severity="note",
            message=f"Sheet '{sheet.name}' is read, which has the most of the channels needed; "
            f"tables stand in {', '.join(repr(name) for name in others)} too.",
            where=where,
            remedy=f"To read another one: '{where}#{others[0]}'.",
            values={"count": len(others)},
        ),
    )
