"""The parameter sheet as XLSX, with the worksheet that the bench is used to, in live formulas."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any

import pandas as pd
import xlsxwriter
from msgspec import UNSET

from ....bench.channels.column_mapping import HEAD, KNOWN_BY
from ....io.moment import NO_DATE, stated_moment
from ....io.quantities import printed_unit
from ....io.whole_files import write_whole
from ....results import FitResult
from ....results.values import known
from .cells import Cells, write
from .certificate import add_certificate
from .worksheet import add_worksheet


def write_xlsx(
    result: FitResult,
    content: Mapping[str, Any],
    tables: Sequence[tuple[str, str, pd.DataFrame]],
    path: Path,
) -> Path:
    """Write the sheet as XLSX.

    Args:
        result: What stands in `fit.json`.
        content: The same from `sheet_content`.
        tables: Name, role and courses of each test; the first fills the worksheet.
        path: Where it goes; written whole or not at all.
    """
    # text from outside is never a formula, a link or a number
    options = {
        "strings_to_formulas": False,
        "strings_to_urls": False,
        "strings_to_numbers": False,
        "nan_inf_to_errors": False,
        "in_memory": True,
    }
    buffer = io.BytesIO()
    with xlsxwriter.Workbook(buffer, options) as book:
        book.set_properties({"created": stated_moment() or NO_DATE})
        cells = Cells(book)
        bold = cells.bold
        add_certificate(book, cells, result, content)
        _parameters(book, cells, result, content)
        _correlation(book, cells, result)
        _rows(book, "Tests", bold,
              ["test", "role", "length", "current [A]", "speed [rpm]", "winding [°C]",
               "sink [°C]", "SHA-256", "date"],
              [[*row[:-1], test.sha256, known(test.start) or "not in the record"]
               for row, test in zip(content["tests"], result.tests, strict=True)])  # fmt: skip
        _rows(book, "Columns", bold, ["test", *HEAD, "file"],
              [[test.name, row.channel, row.column, row.unit, KNOWN_BY[row.unit_from],
                row.found_by, PurePath(row.file).name]
               for test in result.tests for row in test.mapping])  # fmt: skip
        _residuals(book, cells, result)
        _derived(book, cells, result)
        _rows(book, "Findings", bold, ["severity", "finding"], content["findings"])
        name, _, table = tables[0]
        add_worksheet(book, cells, result, name, table)
    write_whole(path, buffer.getvalue())
    return path


def _parameters(book: Any, cells: Cells, result: FitResult, content: Mapping) -> None:
    """Write all parameters with full numbers, shown to the digits of their uncertainty."""
    sheet = book.add_worksheet("Parameters")
    sheet.write_string(0, 0, content["title"], cells.bold)
    sheet.write_string(1, 0, content["verdict"])
    head = ["network", "parameter", "value", "unit", "standard uncertainty", "expanded (k = 2)",
            "95 % low", "95 % high", "type A", "type B", "identifiability", "reason",
            "prior 95 % low", "prior 95 % high", "prior from", "meaning"]  # fmt: skip
    sheet.write_row(3, 0, head, cells.bold)
    row = 4
    for order, model in result.models.items():
        for name, entry in {**model.parameters, **model.nuisances}.items():
            expanded = 2 * entry.sd
            low, high = entry.interval_95
            by_sd, by_expanded = cells.of(entry.sd), cells.of(expanded)
            values = (order, name, (entry.value, by_expanded), printed_unit(entry.unit),
                      (entry.sd, by_sd), (expanded, by_expanded), (low, by_sd), (high, by_sd),
                      (entry.sd_type_a, cells.of(entry.sd_type_a)),
                      (entry.sd_type_b, cells.of(entry.sd_type_b)),
                      entry.identifiability or "", entry.why or "",
                      *((end, cells.of(abs(end) / 3)) for end in entry.prior_95),
                      entry.prior_basis, entry.meaning)  # fmt: skip
            for column, value in enumerate(values):
                write(sheet, row, column, *(value if isinstance(value, tuple) else (value,)))
            row += 1
    sheet.set_column(0, 1, 18)
    sheet.set_column(2, 9, 14)
    sheet.set_column(10, 11, 40)
    sheet.set_column(12, 13, 14)
    sheet.set_column(14, 15, 40)
    sheet.freeze_panes(4, 2)


def _correlation(book: Any, cells: Cells, result: FitResult) -> None:
    bold, form = cells.bold, cells.digits(2)
    sheet = book.add_worksheet("Correlation")
    row = 0
    for model in result.models.values():
        names = model.correlation.names
        sheet.write_string(row, 0, model.title, bold)
        for position, name in enumerate(names):
            sheet.write_string(row, position + 1, name, bold)
            sheet.write_string(row + position + 1, 0, name, bold)
            for other, value in enumerate(model.correlation.matrix[position]):
                write(sheet, row + position + 1, other + 1, value, form)
        row += len(names) + 2


def _residuals(book: Any, cells: Cells, result: FitResult) -> None:
    keys = ["test", "role", "rmse_K", "mae_K", "max_K", "end_K", "coverage_95", "log_score",
            "log_score_se", "whiteness_p"]  # fmt: skip
    rows = [
        [order, row.test, row.role, row.rmse_K, row.mae_K, row.max_K, row.end_K, row.coverage_95,
         row.log_score, None if row.log_score_se is UNSET else row.log_score_se,
         row.whiteness_p]
        for order, model in result.models.items()
        for row in model.residuals
    ]  # fmt: skip
    _rows(book, "Residuals", cells.bold, ["network", *keys], rows, cells.digits(2))
    names = ["test", "role", "body", "node", "fitted", "rmse_K", "mean_K", "max_K", "coverage_95"]
    bodies = [
        [order, *(getattr(row, name) for name in names)]
        for order, model in result.models.items()
        for row in known(model.bodies) or ()
    ]
    if bodies:
        head = ["network", *names]
        _rows(book, "Measured bodies", cells.bold, head, bodies, cells.digits(2))


def _derived(book: Any, cells: Cells, result: FitResult) -> None:
    """Write the derived figures and the ratings, those that are refused with the reason."""
    head = ["network", "figure", "value", "unit", "95 % low", "95 % high", "condition or refusal"]
    rows = []
    for network, model in result.models.items():
        for name, entry in model.derived.items():
            low, high = known(entry.interval_95) or (None, None)
            why = known(entry.refused) or known(entry.condition) or ""
            unit = printed_unit(known(entry.unit) or "")
            form = cells.of(known(entry.sd))
            rows.append([network, name, (known(entry.value), form), unit, (low, form),
                         (high, form), why])  # fmt: skip
    _rows(book, "Derived", cells.bold, head, rows)


def _rows(
    book: Any,
    name: str,
    bold: Any,
    head: Sequence[str],
    rows: Sequence[Sequence],
    form: Any = None,
) -> None:
    """Write a sheet of rows below their heads; a cell may bring its own format."""
    sheet = book.add_worksheet(name)
    sheet.write_row(0, 0, head, bold)
    for number, row in enumerate(rows, start=1):
        for column, value in enumerate(row):
            cell = value if isinstance(value, tuple) else (value, form)
            write(sheet, number, column, *cell)
    sheet.set_column(0, len(head) - 1, 22)
