"""The worksheet of the published identification, in live formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ....results import FitResult
from ....runs.verdict import favoured
from ...texts import Texts
from ..printed import COVERAGE_FACTOR
from .cells import Cells, write

FIRST_ROW = 12
"""Row of the first sample, as in the published worksheet (counted from 1)."""


PLACES = (1, 2, 2, 4, 1, 2, 2, 2, 6, 1, 1, 2, 2)
"""Decimal places of the columns: readings as the bench logs them, resistances to a thousandth."""


def add_worksheet(
    book: Any, cells: Cells, result: FitResult, name: str, table: pd.DataFrame, say: Texts
) -> None:
    """Write the worksheet of the published identification over the blocks of one test."""
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
