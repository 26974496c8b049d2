"""The parameter sheet as XLSX, with the worksheet that the bench is used to, in live formulas."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any

import pandas as pd
import xlsxwriter

from ....bench.channels.column_mapping import KNOWN_BY
from ....io.moment import NO_DATE, stated_moment
from ....io.quantities import printed_unit
from ....io.whole_files import write_whole
from ....results import FitResult
from ....results.model import FittedModel
from ....results.values import known
from ....runs.verdict import favoured
from ...texts import Texts
from ..certificate import judged
from .cells import Cells, write
from .certificate import add_certificate
from .courses import add_courses
from .worksheet import add_worksheet


def write_xlsx(
    result: FitResult,
    content: Mapping[str, Any],
    tables: Sequence[tuple[str, str, pd.DataFrame]],
    path: Path,
    say: Texts | None = None,
) -> Path:
    """Write the sheet as XLSX: the network that is certified, and the long tables behind it.

    Args:
        result: What stands in `fit.json`.
        content: The same from `sheet_content`.
        tables: Name, role and courses of each test; the first fills the worksheet.
        path: Where it goes; written whole or not at all.
        say: The texts in the language of the content; None for English.
    """
    # text from outside is never a formula, a link or a number
    options = {
        "strings_to_formulas": False,
        "strings_to_urls": False,
        "strings_to_numbers": False,
        "nan_inf_to_errors": False,
        "in_memory": True,
    }
    say = say or Texts()
    network = favoured(result)
    model = result.models[network]
    buffer = io.BytesIO()
    with xlsxwriter.Workbook(buffer, options) as book:
        book.set_properties({"created": stated_moment() or NO_DATE})
        cells = Cells(book)
        add_certificate(book, cells, result, content, say)
        add_courses(book, cells, network, tables, say)
        _parameters(book, cells, model, content, say)
        _correlation(book, cells, model, say)
        _rows(book, cells, "tests",
              [*map(say, ("test", "role", "length", "current_A", "speed_rpm", "winding_degC",
                          "sink_degC", "date", "sha256"))],
              [[*row[:-1], test.sha256 or row[-1]]
               for row, test in zip(content["tests"], result.tests, strict=True)], say)  # fmt: skip
        _rows(book, cells, "sheet_columns",
              [*map(say, ("test", "channel", "column", "unit", "unit_known_by", "column_known_by",
                          "file"))],
              [[test.name, row.channel, row.column, row.unit, KNOWN_BY[row.unit_from],
                row.found_by, PurePath(row.file).name]
               for test in result.tests for row in test.mapping], say)  # fmt: skip
        _residuals(book, cells, model, say)
        _derived(book, cells, model, say)
        findings = [[say(severity), text] for severity, text in content["findings"]]
        _rows(book, cells, "findings", [say("severity"), say("finding")], findings, say)
        name, _, table = tables[0]
        add_worksheet(book, cells, result, name, table, say)
    write_whole(path, buffer.getvalue())
    return path


def _parameters(
    book: Any, cells: Cells, model: FittedModel, content: Mapping[str, Any], say: Texts
) -> None:
    """Write all parameters with full numbers, shown to the digits of their uncertainty."""
    sheet = book.add_worksheet(say("sheet_parameters"))
    sheet.write_string(0, 0, content["title"], cells.bold)
    sheet.write_string(1, 0, content["certificate"]["headline"])
    sheet.write_string(2, 0, content["replica"])
    head = ["parameter", "value", "unit", "standard_uncertainty", "expanded", "low_95", "high_95",
            "type_a", "type_b", "judgement", "reason", "prior_low", "prior_high", "prior_from",
            "meaning"]  # fmt: skip
    sheet.write_row(3, 0, map(say, head), cells.bold)
    entries = {**model.parameters, **model.nuisances}
    for row, (name, entry) in enumerate(entries.items(), start=4):
        expanded = 2 * entry.sd
        low, high = entry.interval_95
        by_sd, by_expanded = cells.of(entry.sd), cells.of(expanded)
        values = (name, (entry.value, by_expanded), printed_unit(entry.unit),
                  (entry.sd, by_sd), (expanded, by_expanded), (low, by_sd), (high, by_sd),
                  (entry.sd_type_a, cells.of(entry.sd_type_a)),
                  (entry.sd_type_b, cells.of(entry.sd_type_b)),
                  judged(entry, say), entry.why or "",
                  *((end, cells.of(abs(end) / 3)) for end in entry.prior_95),
                  entry.prior_basis, say.again(entry.meaning))  # fmt: skip
        for column, value in enumerate(values):
            write(sheet, row, column, *(value if isinstance(value, tuple) else (value,)))
    sheet.set_column(0, 0, 18)
    sheet.set_column(1, 8, 14)
    sheet.set_column(9, 10, 40)
    sheet.set_column(11, 12, 14)
    sheet.set_column(13, 14, 40)
    sheet.freeze_panes(4, 1)


def _correlation(book: Any, cells: Cells, model: FittedModel, say: Texts) -> None:
    bold, form = cells.bold, cells.digits(2)
    sheet = book.add_worksheet(say("sheet_correlation"))
    for position, name in enumerate(model.correlation.names):
        sheet.write_string(0, position + 1, name, bold)
        sheet.write_string(position + 1, 0, name, bold)
        for other, value in enumerate(model.correlation.matrix[position]):
            write(sheet, position + 1, other + 1, value, form)


def _residuals(book: Any, cells: Cells, model: FittedModel, say: Texts) -> None:
    replica = known(model.replica)
    keys = ["test", "role", "rmse_K", "mae_K", "max_K", "end_K", "in_band", "log_score",
            "log_score_se", "whiteness", "replica_K"]  # fmt: skip
    rows = [
        [row.test, say(row.role), row.rmse_K, row.mae_K, row.max_K, row.end_K, row.coverage_95,
         row.log_score, known(row.log_score_se), row.whiteness_p,
         replica.rmse_K.get(row.test) if replica else None]
        for row in model.residuals
    ]  # fmt: skip
    form = cells.digits(2)
    _rows(book, cells, "sheet_residuals", [*map(say, keys)], rows, say, form)
    names = ["test", "role", "measured_body", "node", "rmse_K", "mean_K", "max_K", "in_band"]
    bodies = [
        [row.test, say(row.role), row.body,
         say("fitted_as" if row.fitted else "against", node=row.node.replace("_", " ")),
         row.rmse_K, row.mean_K, row.max_K, row.coverage_95]
        for row in known(model.bodies) or ()
    ]  # fmt: skip
    if bodies:
        _rows(book, cells, "sheet_bodies", [*map(say, names)], bodies, say, form)


def _derived(book: Any, cells: Cells, model: FittedModel, say: Texts) -> None:
    """Write the derived figures and the ratings, those that are refused with the reason."""
    head = ["figure", "value", "unit", "low_95", "high_95", "condition_or_refusal"]
    rows = []
    for name, entry in model.derived.items():
        low, high = known(entry.interval_95) or (None, None)
        why = known(entry.refused) or known(entry.condition) or ""
        form = cells.of(known(entry.sd))
        rows.append([name, (known(entry.value), form), printed_unit(known(entry.unit) or ""),
                     (low, form), (high, form), say.again(why)])  # fmt: skip
    _rows(book, cells, "sheet_derived", [*map(say, head)], rows, say)


def _rows(
    book: Any,
    cells: Cells,
    name: str,
    head: Sequence[str],
    rows: Sequence[Sequence],
    say: Texts,
    form: Any = None,
) -> None:
    """Write a sheet of rows below their heads; a cell may bring its own format."""
    sheet = book.add_worksheet(say(name))
    sheet.write_row(0, 0, head, cells.bold)
    for number, row in enumerate(rows, start=1):
        for column, value in enumerate(row):
            cell = value if isinstance(value, tuple) else (value, form)
            write(sheet, number, column, *cell)
    sheet.set_column(0, len(head) - 1, 22)
