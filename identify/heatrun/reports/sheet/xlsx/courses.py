"""The courses of the tests: measured, model and residual, each test with a chart of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from ....io.quantities import rounded
from ...texts import Texts
from ..figures import COLOURS
from .cells import Cells, write

FIRST = 3
"""Row of the first sample (counted from 0)."""


def add_courses(
    book: Any,
    cells: Cells,
    network: str,
    tables: Sequence[tuple[str, str, pd.DataFrame]],
    say: Texts,
) -> None:
    """Write a sheet for each test; the residual is a formula, the chart follows the cells.

    Args:
        book: The workbook.
        cells: Its formats.
        network: The network that is certified.
        tables: Name, role and courses of each test.
        say: The texts in the language of the workbook.
    """
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
