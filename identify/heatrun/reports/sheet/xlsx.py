"""The parameter sheet as XLSX, with the worksheet that the bench is used to, in live formulas."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any

import numpy as np
import pandas as pd
import xlsxwriter
from msgspec import UNSET

from ...bench.channels.column_mapping import HEAD, KNOWN_BY
from ...io.moment import NO_DATE, stated_moment
from ...io.whole_files import write_whole
from ...results import FitResult
from ...results.values import known

CONSTANTS = ("B", "Ro_rif", "To_rif", "Rs", "Ts", "phases", "Tamb_med")
FIRST_ROW = 12
"""Row of the first sample, as in the published worksheet (counted from 1)."""


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
        bold = book.add_format({"bold": True})
        _parameters(book, bold, result, content)
        _correlation(book, bold, result)
        _rows(book, "Tests", bold,
              ["test", "role", "length", "current [A]", "speed [rpm]", "winding [degC]",
               "sink [degC]", "SHA-256"],
              [[*row[:-1], test.sha256]
               for row, test in zip(content["tests"], result.tests, strict=True)])  # fmt: skip
        _rows(book, "Columns", bold, ["test", *HEAD, "file"],
              [[test.name, row.channel, row.column, row.unit, KNOWN_BY[row.unit_from],
                row.found_by, PurePath(row.file).name]
               for test in result.tests for row in test.mapping])  # fmt: skip
        _residuals(book, bold, result)
        _derived(book, bold, result)
        _rows(book, "Findings", bold, ["severity", "finding"], content["findings"])
        name, _, table = tables[0]
        _worksheet(book, bold, result, name, table)
    write_whole(path, buffer.getvalue())
    return path


def _parameters(book: Any, bold: Any, result: FitResult, content: Mapping) -> None:
    sheet = book.add_worksheet("Parameters")
    sheet.write_string(0, 0, content["title"], bold)
    sheet.write_string(1, 0, content["verdict"])
    head = ["network", "parameter", "value", "unit", "standard uncertainty", "expanded (k = 2)",
            "95 % low", "95 % high", "type A", "type B", "identifiability", "reason"]  # fmt: skip
    sheet.write_row(3, 0, head, bold)
    row = 4
    for order, model in result.models.items():
        for name, entry in {**model.parameters, **model.nuisances}.items():
            sheet.write_string(row, 0, order)
            sheet.write_string(row, 1, name)
            low, high = entry.interval_95
            numbers = (entry.value, entry.unit, entry.sd, 2 * entry.sd, low, high,
                       entry.sd_type_a, entry.sd_type_b)  # fmt: skip
            for column, value in enumerate(numbers, start=2):
                _write(sheet, row, column, value)
            sheet.write_string(row, 10, entry.identifiability or "")
            sheet.write_string(row, 11, entry.why or "")
            row += 1
    sheet.set_column(0, 1, 18)
    sheet.set_column(2, 9, 14)
    sheet.set_column(10, 11, 40)


def _correlation(book: Any, bold: Any, result: FitResult) -> None:
    sheet = book.add_worksheet("Correlation")
    row = 0
    for model in result.models.values():
        names = model.correlation.names
        sheet.write_string(row, 0, model.title, bold)
        for position, name in enumerate(names):
            sheet.write_string(row, position + 1, name, bold)
            sheet.write_string(row + position + 1, 0, name, bold)
            for other, value in enumerate(model.correlation.matrix[position]):
                _write(sheet, row + position + 1, other + 1, value)
        row += len(names) + 2


def _residuals(book: Any, bold: Any, result: FitResult) -> None:
    keys = ["test", "role", "rmse_K", "mae_K", "max_K", "end_K", "coverage_95", "log_score",
            "log_score_se", "whiteness_p"]  # fmt: skip
    rows = [
        [order, row.test, row.role, row.rmse_K, row.mae_K, row.max_K, row.end_K, row.coverage_95,
         row.log_score, None if row.log_score_se is UNSET else row.log_score_se,
         row.whiteness_p]
        for order, model in result.models.items()
        for row in model.residuals
    ]  # fmt: skip
    _rows(book, "Residuals", bold, ["network", *keys], rows)
    names = ["test", "role", "body", "node", "fitted", "rmse_K", "mean_K", "max_K", "coverage_95"]
    bodies = [
        [order, *(getattr(row, name) for name in names)]
        for order, model in result.models.items()
        for row in known(model.bodies) or ()
    ]
    if bodies:
        _rows(book, "Measured bodies", bold, ["network", *names], bodies)


def _derived(book: Any, bold: Any, result: FitResult) -> None:
    """Write the derived figures and the ratings, those that are refused with the reason."""
    head = ["network", "figure", "value", "unit", "95 % low", "95 % high", "condition or refusal"]
    rows = []
    for network, model in result.models.items():
        for name, entry in model.derived.items():
            low, high = known(entry.interval_95) or (None, None)
            why = known(entry.refused) or known(entry.condition) or ""
            unit = known(entry.unit) or ""
            rows.append([network, name, known(entry.value), unit, low, high, why])
    _rows(book, "Derived", bold, head, rows)


def _rows(book: Any, name: str, bold: Any, head: Sequence[str], rows: Sequence[Sequence]) -> None:
    sheet = book.add_worksheet(name)
    sheet.write_row(0, 0, head, bold)
    for number, row in enumerate(rows, start=1):
        for column, value in enumerate(row):
            _write(sheet, number, column, value)
    sheet.set_column(0, len(head) - 1, 22)


def _worksheet(book: Any, bold: Any, result: FitResult, name: str, table: pd.DataFrame) -> None:
    """Write the worksheet of the published identification over the blocks of one test."""
    sheet = book.add_worksheet("Worksheet")
    motor = result.motor
    order = list(result.models)[-1]
    fitted = result.models[order].parameters
    Rs0 = fitted["Rs0"].value if "Rs0" in fitted else motor.phase_resistance_ohm
    sheet.write_string(0, 0, "Data for the estimate of the thermal parameters", bold)
    sheet.write_string(1, 0, f"Block means of {name}; Rs0 as identified.")
    constants = {
        "B3": ("Tamb med [degC]", float(table["sink_degC"].mean())),
        "B4": ("Ro rif [ohm]", 1.0),
        "B5": ("To rif [degC]", 20.0),
        "B6": ("B [degC]", motor.resistance_coefficient_degC),
        "E4": ("Rs [ohm]", Rs0),
        "E5": ("Ts [degC]", motor.reference_temperature_degC),
        "E6": ("phases", motor.phases),
    }
    for cell, (label, value) in constants.items():
        column, row = ord(cell[0]) - ord("A"), int(cell[1:]) - 1
        sheet.write_string(row, column - 1, label, bold)
        _write(sheet, row, column, value)
    for number, (label, entry) in enumerate(fitted.items()):
        sheet.write_string(2 + number, 10, f"{label} [{entry.unit}]", bold)
        _write(sheet, 2 + number, 11, entry.value)
    head = ["t [s]", "Tw [degC]", "Tw mod [degC]", "Req DC [ohm]", "P [W]", "Ieq DC [A]",
            "Veq DC [V]", "Is [A]", "Rs [ohm]", "Pjs [W]", "Pol [W]", "Ieq DC (Pjs) [A]",
            "Veq DC (Pjs) [V]"]  # fmt: skip
    sheet.write_row(FIRST_ROW - 2, 0, head, bold)
    model = table[f"{order}_winding_degC"].to_numpy()
    B, To = motor.resistance_coefficient_degC, 20.0
    columns = (table["time_s"], table["measured_degC"], table["losses_W"], table["phase_current_A"])
    for offset, (t, Tw, P, current) in enumerate(zip(*map(np.asarray, columns), strict=True)):
        row, line = FIRST_ROW - 1 + offset, FIRST_ROW + offset
        for column, value in ((0, t), (1, Tw), (2, model[offset]), (4, P), (7, current)):
            _write(sheet, row, column, float(value))
        if not np.isfinite(Tw) or Rs0 is None:
            continue
        Req = (B + Tw) / (B + To)
        Rs = Rs0 * (B + Tw) / (B + motor.reference_temperature_degC)
        Pjs = motor.phases * current**2 * Rs
        formulas = [
            (3, f"=$B$4*($B$6+B{line})/($B$6+$B$5)", Req),
            (8, f"=$E$4*($B$6+B{line})/($B$6+$E$5)", Rs),
            (9, f"=$E$6*H{line}^2*I{line}", Pjs),
            (10, f"=E{line}-J{line}", P - Pjs),
            (11, f"=SQRT(J{line}/D{line})", np.sqrt(Pjs / Req)),
            (12, f"=SQRT(J{line}*D{line})", np.sqrt(Pjs * Req)),
        ]
        if P >= 0:  # noise can make the losses of a motor at rest negative: no root then
            formulas += [
                (5, f"=SQRT(E{line}/D{line})", np.sqrt(P / Req)),
                (6, f"=SQRT(E{line}*D{line})", np.sqrt(P * Req)),
            ]
        for column, formula, value in formulas:
            sheet.write_formula(row, column, formula, None, float(value))
    sheet.set_column(0, 12, 13)
    sheet.freeze_panes(FIRST_ROW - 1, 0)


def _write(sheet: Any, row: int, column: int, value: Any) -> None:
    if isinstance(value, str):
        sheet.write_string(row, column, value)
    elif value is not None and np.isfinite(value):
        sheet.write_number(row, column, float(value))
