"""The parameter sheet as XLSX: courses with charts, and the bench's worksheet in live formulas."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any

import numpy as np
import pandas as pd
import xlsxwriter

from ..io.quantities import printed_unit, rounded
from ..io.texts import SENTENCES, Texts
from ..io.whole_files import NO_DATE, stated_moment, write_whole
from ..readers.mapping import KNOWN_BY
from ..results import FitResult
from ..results.model import FittedModel
from ..results.values import known
from ..runs.verdict import favoured
from .certificate import figure_lines, judged, parameter_lines
from .figures import COLOURS
from .printed import COVERAGE_FACTOR
from .xlsx_cells import AS_TEXT, Cells, add_budget, add_certificate, write

FIRST = 3
"""Row of the first sample (counted from 0)."""


def add_courses(
    book: Any,
    cells: Cells,
    network: str,
    tables: Sequence[tuple[str, str, pd.DataFrame]],
    say: Texts,
) -> None:
    """Write a sheet for each test; the residual is a formula, the chart follows the cells."""
    head = [say(key) for key in ("time_min", "chart_measured", "chart_model", "chart_residual")]
    for number, (name, role, table) in enumerate(tables, start=1):
        title = say("sheet_chart", number=number)
        sheet = book.add_worksheet(title)
        sheet.write_string(0, 0, f"{name} ({say(role)})", cells.bold)
        sheet.write_row(FIRST - 1, 0, head, cells.bold)
        columns = (table["time_s"] / 60.0, table["measured_degC"], table[f"{network}_winding_degC"])
        for row, values in enumerate(zip(*columns, strict=True), start=FIRST):
            for column, value in enumerate(values):
                write(sheet, row, column, value, cells.digits(2))
            if pd.notna(values[1]):
                formula, residual = f"=B{row + 1}-C{row + 1}", values[1] - values[2]
                sheet.write_formula(row, 3, formula, cells.digits(2), float(residual))
        sheet.set_column(0, 3, 20)
        sheet.freeze_panes(FIRST, 0)
        largest = float(np.max(np.nan_to_num(np.abs(columns[1] - columns[2])), initial=0.1))
        last = FIRST + len(table) - 1
        sheet.insert_chart("F3", _chart(book, title, last, head, float(rounded(largest, 1))))


def _chart(book: Any, sheet: str, last: int, head: Sequence[str], largest: float) -> Any:
    """Return the chart of the cells of a sheet.

    The residual goes with the axis on the right, whose scale has it below the courses.

    Args:
        book: The workbook.
        sheet: Name of the sheet.
        last: Row of the last sample (counted from 0).
        head: Names of the columns.
        largest: Residual that the scale is made for [K].
    """
    chart = book.add_chart({"type": "scatter", "subtype": "straight"})
    looks = (
        (1, {"none": True}, {"type": "circle", "size": 3, "fill": {"none": True},
                             "border": {"color": COLOURS["measured"]}}),
        (2, {"color": COLOURS["second"], "width": 1.5}, {"type": "none"}),
        (3, {"color": COLOURS["first"], "width": 1.0}, {"type": "none"}),
    )  # fmt: skip
    for column, line, marker in looks:
        chart.add_series(
            {
                "name": [sheet, FIRST - 1, column],
                "categories": [sheet, FIRST, 0, last, 0],
                "values": [sheet, FIRST, column, last, column],
                "line": line,
                "marker": marker,
                "y2_axis": column == 3,
            }
        )
    # the title is that of a cell: no name acts as a formula
    chart.set_title({"name": [sheet, 0, 0], "name_font": {"size": 12}})
    chart.set_x_axis({"name": head[0], "major_gridlines": {"visible": False}})
    chart.set_y_axis({"name": f"{head[1]}, {head[2]}"})
    chart.set_y2_axis({"name": head[3], "min": -1.5 * largest, "max": 10.5 * largest})
    chart.set_legend({"position": "bottom"})
    chart.set_size({"width": 900, "height": 480})
    return chart


FIRST_ROW = 12
"""Row of the first sample, as in the published worksheet (counted from 1)."""


PLACES = (1, 2, 2, 4, 1, 2, 2, 2, 6, 1, 1, 2, 2)
"""Decimal places of the columns: readings as the bench logs them, resistances to a thousandth."""


def add_worksheet(
    book: Any, cells: Cells, result: FitResult, name: str, table: pd.DataFrame, say: Texts
) -> None:
    """Write the worksheet of the published identification over the blocks of one test.

    Its estimator was made for DC tests: the losses of an AC test stand there as the current and the
    voltage that would put the same power into a fictitious winding of 1 ohm at 20 degC, once the
    total, once its copper part.

    Reference: G. Agostino, Powertrain Retrofit kit testing and thermal modeling, Politecnico di
        Torino, 2022/2023, Figure 7.
    """
    sheet = book.add_worksheet(say("sheet_worksheet"))
    bold = cells.bold
    forms = [cells.digits(places) for places in PLACES]
    motor = result.motor
    order = favoured(result)
    fitted = result.models[order].parameters
    Rs0 = fitted["Rs0"].value if "Rs0" in fitted else motor.phase_resistance_ohm
    sheet.write_string(0, 0, say("worksheet_title"), bold)
    sheet.write_string(1, 0, say("worksheet_note", test=name))
    constants = {
        "B3": ("Tamb med [degC]", float(table["sink_degC"].mean())),
        "B4": ("Ro rif [ohm]", 1.0),
        "B5": ("To rif [degC]", 20.0),
        "B6": ("B [degC]", motor.resistance_coefficient_degC),
        "E4": ("Rs [ohm]", Rs0),
        "E5": ("Ts [degC]", motor.reference_temperature_degC),
        "E6": ("phases", motor.phases),
    }
    digits = {"B3": cells.digits(2), "E4": cells.digits(6)}
    for cell, (label, value) in constants.items():
        column, row = ord(cell[0]) - ord("A"), int(cell[1:]) - 1
        sheet.write_string(row, column - 1, label, bold)
        write(sheet, row, column, value, digits.get(cell))
    for number, (label, entry) in enumerate(fitted.items()):
        sheet.write_string(2 + number, 10, f"{label} [{entry.unit}]", bold)
        write(sheet, 2 + number, 11, entry.value, cells.of(COVERAGE_FACTOR * entry.sd))
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
            write(sheet, row, column, float(value), forms[column])
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
            sheet.write_formula(row, column, formula, forms[column], float(value))
    sheet.set_column(0, 12, 13)
    sheet.freeze_panes(FIRST_ROW - 1, 0)


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
    say = say or Texts()
    network = favoured(result)
    model = result.models[network]
    buffer = io.BytesIO()
    with xlsxwriter.Workbook(buffer, AS_TEXT) as book:
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
              [[test.name, row.channel, row.column, row.unit, say.again(KNOWN_BY[row.unit_from]),
                say.again(row.found_by), PurePath(row.file).name]
               for test in result.tests for row in test.mapping], say)  # fmt: skip
        _residuals(book, cells, model, say)
        _derived(book, cells, model, say)
        _budgets(book, cells, model, say)
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
                  judged(entry, say), " ".join(map(say.again, SENTENCES.split(entry.why or ""))),
                  *((end, cells.of(abs(end) / 3)) for end in entry.prior_95),
                  say.again(entry.prior_basis), say.again(entry.meaning))  # fmt: skip
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


def _budgets(book: Any, cells: Cells, model: FittedModel, say: Texts) -> None:
    """Write where the uncertainty of each parameter comes from, one below the other."""
    lines = (*parameter_lines(model, say), *figure_lines(model, say))
    lines = [line for line in lines if line.budget]
    if not lines:
        return
    sheet, row = book.add_worksheet(say("sheet_budget")), 0
    for line in lines:
        sheet.write_string(row, 0, f"{line.name}: {line.meaning}", cells.bold)
        row = 1 + add_budget(sheet, cells, row + 1, line.budget, line.sd, line.unit, say)


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
