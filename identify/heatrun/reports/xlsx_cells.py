"""Cells of the workbook with the digits of the sheet, and its first sheet, the certificate."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..io.quantities import printed_unit
from ..io.texts import Texts
from ..results import FitResult
from ..results.model import DerivedFigure, FittedParameter
from ..results.values import BudgetRow, combined, known, number
from ..runs.verdict import favoured
from .certificate import ENGLISH, figure_lines, stated_lines
from .printed import format_value, interval_ends, places_of, printed

AS_TEXT = {
    "strings_to_formulas": False,
    "strings_to_urls": False,
    "strings_to_numbers": False,
    "nan_inf_to_errors": False,
    "in_memory": True,
}
"""Options of a workbook: text from outside is never a formula, a link or a number."""


class Cells:
    """Formats of a workbook, each made once.

    Attributes:
        bold: For headings.
    """

    def __init__(self, book: Any) -> None:
        self._book = book
        self._numbers: dict[int, Any] = {}
        self.bold = book.add_format({"bold": True})
        self.percent = book.add_format({"num_format": "0.0%"})
        self.wrapped = book.add_format({"text_wrap": True, "valign": "top"})

    def digits(self, places: int) -> Any:
        """Return the format of numbers with so many decimal places; none for tens and hundreds."""
        shown = max(places, 0)
        if shown not in self._numbers:
            pattern = f"0.{'0' * shown}" if shown else "0"
            self._numbers[shown] = self._book.add_format({"num_format": pattern})
        return self._numbers[shown]

    def of(self, uncertainty: float | None) -> Any:
        """Return the format of numbers with this uncertainty; None where there is none."""
        if uncertainty is None or not np.isfinite(uncertainty) or uncertainty <= 0:
            return None
        return self.digits(places_of(uncertainty))


def write(sheet: Any, row: int, column: int, value: Any, form: Any = None) -> None:
    """Write a text as text, a finite number as a number, and nothing else.

    Args:
        sheet: The sheet of the workbook.
        row: From 0.
        column: From 0.
        value: What stands there.
        form: Format of a number, or None.
    """
    if isinstance(value, str):
        sheet.write_string(row, column, value)
    elif value is not None and np.isfinite(value):
        sheet.write_number(row, column, float(value), form)


def add_budget(
    sheet: Any,
    cells: Cells,
    row: int,
    rows: Sequence[BudgetRow],
    sd: float,
    unit: str,
    say: Texts = ENGLISH,
) -> int:
    """Write a budget; contributions, shares and their sum follow from its cells.

    Args:
        sheet: The sheet of the workbook.
        cells: Its formats.
        row: From 0, of the heads.
        rows: The budget.
        sd: Standard uncertainty by draws [unit].
        unit: Of the answer.
        say: The texts in the language of the workbook.

    Returns:
        The row below it.
    """
    unit = printed_unit(unit)
    head = [say(key) for key in ("source", "type", "standard_uncertainty", "unit")]
    head += [say("sensitivity", unit=unit).strip(), f"{say('contribution')} [{unit}]", say("share")]
    sheet.write_row(row, 0, head, cells.bold)
    first, last, total = row + 2, row + 1 + len(rows), combined(rows)
    form = cells.digits(places_of(total) + 1)
    for at, one in enumerate(rows, start=first):
        for column, value in enumerate((say.again(one.source), one.type, one.standard_uncertainty,
                                        printed_unit(one.unit), one.sensitivity)):  # fmt: skip
            write(sheet, at - 1, column, value)
        if one.standard_uncertainty is None:
            write(sheet, at - 1, 5, one.contribution, form)
        else:
            product = f"=ABS(C{at}*E{at})"
            sheet.write_formula(at - 1, 5, product, form, one.contribution)
        part = f"=F{at}^2/SUMSQ(F${first}:F${last})"
        sheet.write_formula(at - 1, 6, part, cells.percent, one.share)
    sheet.write_string(last, 0, say("combined_first_order"), cells.bold)
    sheet.write_formula(last, 5, f"=SQRT(SUMSQ(F{first}:F{last}))", form, total)
    sheet.write_string(last + 1, 0, say("by_draws"), cells.bold)
    write(sheet, last + 1, 5, sd, form)
    sheet.set_column(0, 0, 40)
    sheet.set_column(1, 6, 18)
    return last + 2


INSTRUMENTS = ("instrument_quantity", "instrument", "instrument_class", "instrument_calibration",
               "instrument_valid")  # fmt: skip
PARAMETERS = ("parameter", "meaning", "value", "expanded", "low_95", "high_95", "unit",
              "judgement")  # fmt: skip
"""Keys of the heads of the tables."""


def add_certificate(
    book: Any, cells: Cells, result: FitResult, content: Mapping[str, Any], say: Texts
) -> None:
    """Write the sheet."""
    said = content["certificate"]
    sheet = book.add_worksheet(say("sheet_certificate"))
    sheet.write_string(0, 0, f"{said['title']}: {content['title']}", cells.bold)
    sheet.write_string(1, 0, said["headline"], cells.bold)
    row = 2
    for reason in said["reasons"]:
        sheet.write_string(row, 0, reason)
        row += 1
    row += 1
    for label, value in [*said["identification"], *said["signatures"], *said["statement"],
                         [say("remarks"), said["remarks"]]]:  # fmt: skip
        sheet.write_string(row, 0, label, cells.bold)
        sheet.write_string(row, 1, value)
        row += 1
    row = _table(sheet, cells, row + 1, [say(key) for key in PARAMETERS])
    model = result.models[favoured(result)]
    lines = [(line.unit, line.figure, _numbers(line.entry) if line.entry else ())
             for line in (*stated_lines(model), *figure_lines(model))]  # fmt: skip
    printed_lines = [*said["parameters"], *said["figures"]]
    for (unit, figure, numbers), words in zip(lines, printed_lines, strict=True):
        for column, value in enumerate(numbers if figure is None else _of_figure(figure), start=2):
            _number(sheet, cells, row, column, value)
        for column, text in {0: words[0], 1: words[1], 6: printed_unit(unit), 7: words[3]}.items():
            write(sheet, row, column, text)
        row += 1
    sheet.write_string(row, 0, said["rule"])
    if said["instruments"]:
        row = _table(sheet, cells, row + 2, [say(key) for key in INSTRUMENTS])
        for one in said["instruments"]:
            for column, text in enumerate(one):
                write(sheet, row, column, text)
            row += 1
    sheet.set_column(0, 0, 20)
    sheet.set_column(1, 1, 44)
    sheet.set_column(2, 7, 16)


def _table(sheet: Any, cells: Cells, row: int, head: list[str]) -> int:
    """Write the heads of a table and return the row below them."""
    sheet.write_row(row, 0, head, cells.bold)
    return row + 1


def _numbers(entry: FittedParameter) -> tuple[str, str, str, str]:
    """Return value, U and both ends of the interval as they are printed; empty where none is."""
    form = printed(entry).form
    if form == "given":
        return format_value(entry.value, None)[0], "", "", ""
    low, high = interval_ends(entry.interval_95, entry.sd)
    if form == "expanded":
        return (*format_value(entry.value, 2 * entry.sd), low, high)
    return format_value(entry.value, entry.sd)[0], "", low, high


def _of_figure(figure: DerivedFigure) -> tuple[str, str, str, str]:
    """Return the numbers of a derived figure, as `_numbers` does; empty where it is refused."""
    sd = number(known(figure.sd))
    if not math.isfinite(figure.median) or not sd > 0:
        return "", "", "", ""
    return (format_value(figure.median, sd)[0], "", *interval_ends(figure.ends, sd))


def _number(sheet: Any, cells: Cells, row: int, column: int, text: str) -> None:
    """Write a printed number as a number that looks the same."""
    if text:
        write(sheet, row, column, float(text), cells.digits(len(text.partition(".")[2])))
