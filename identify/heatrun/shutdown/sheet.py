"""The winding at switch-off on paper, as a workbook, and as a Digital Calibration Certificate."""

import io
import tempfile
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import xlsxwriter

from ..errors import InputError
from ..io.quantities import clean, quantity
from ..io.texts import LANGUAGES, Texts
from ..io.whole_files import (
    NO_DATE,
    is_other,
    refuse_replacing,
    stated_moment,
    writable,
    write_whole,
)
from ..record.motor import Certificate
from ..reports.certificate import joined
from ..reports.dcc import (
    add,
    add_budget,
    add_condition,
    add_method,
    add_named,
    add_result,
    add_statements,
    add_text,
    add_uncertain,
    as_bytes,
    begun,
)
from ..reports.pdf import typeset
from ..reports.printed import TestDays, told
from ..reports.xlsx_cells import AS_TEXT, Cells, write
from ..reports.xlsx_cells import add_budget as add_budget_rows
from ..results import to_json
from ..version import __version__
from .printed import answer_lines, budget_cells, budget_sum, figure, hand_cells, table
from .result import ShutdownResult, as_content

TEMPLATE = resources.files("heatrun.shutdown") / "shutdown.typ"


HEADINGS = (
    "Winding temperature at switch-off",
    "By hand from the same readings",
    "Where the uncertainty comes from (GUM)",
    "What was read",
)
HAND = ("method", "winding [°C]", "difference [K]", "clause or source")
BUDGET = (
    "source", "standard uncertainty u", "sensitivity [K per unit]", "contribution [K]", "share",
)  # fmt: skip


def content(
    result: ShutdownResult, stated: Certificate | None = None, say: Texts | None = None
) -> dict[str, Any]:
    """Return the words of the sheet.

    Args:
        result: The result.
        stated: What the laboratory states.
        say: The texts in the language of the sheet; None for English.
    """
    say = say or Texts()

    def again(rows: Sequence[str]) -> list[str]:
        return [say.again(text) for text in rows]

    answer, *lines = answer_lines(result, say)
    said = {
        "title": clean(result.motor),
        "version": f"heatrun {__version__}",
        "headings": again(HEADINGS),
        "identification": _identification(stated or Certificate(), say),
        "answer": answer,
        "lines": lines,
        "hand_head": again(HAND),
        "hand": [again(row) for row in hand_cells(result)],
        "budget_head": again(BUDGET),
        "budget": [
            [say.again(source), *map(say.number, cells)] for source, *cells in budget_cells(result)
        ],
        "sum": say.again(budget_sum(result)),
        "notes": [
            *again([clean(note) for note in result.notes]),
            f"{clean(result.readings)}, SHA-256 {result.sha256}",
        ],
        "page": say("page"),
        "of": say("of"),
    }
    is_whole = say.is_whole and all(told(one, say)[1] for one in result.findings)
    return {**said, "remark": "" if is_whole else say("rest_in_english")}


def _identification(stated: Certificate, say: Texts) -> list[list[str]]:
    """Return label and value of each line that the laboratory states."""
    rows = [
        ("laboratory", joined([stated.laboratory, stated.laboratory_address])),
        ("customer", joined([stated.customer, stated.customer_address])),
        ("manufacturer", stated.manufacturer),
        ("serial_number", stated.serial_number),
        ("bench", stated.bench),
        ("operator", stated.operator),
        ("approved_by", stated.approved_by),
    ]
    return [[say(key), value] for key, value in rows if value]


def pdf(
    result: ShutdownResult,
    drawn: bytes,
    stated: Certificate | None = None,
    say: Texts | None = None,
) -> bytes:
    """Return the sheet as PDF.

    Args:
        result: The result.
        drawn: Its figure.
        stated: As `content`.
        say: As `content`.
    """
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "figure.png"
        path.write_bytes(drawn)
        return typeset(
            TEMPLATE, content(result, stated, say), [path], Path(name) / "sheet.pdf"
        ).read_bytes()


def xlsx(result: ShutdownResult, say: Texts | None = None) -> bytes:
    """Return the workbook: the answer, the budget in live formulas, the readings with a chart.

    Args:
        result: The result.
        say: As `content`.
    """
    say = say or Texts()
    stream = io.BytesIO()
    with xlsxwriter.Workbook(stream, AS_TEXT) as book:
        book.set_properties({"created": stated_moment() or NO_DATE})
        cells = Cells(book)
        _answer_cells(book, cells, result, say)
        sheet = book.add_worksheet(say("sheet_budget"))
        add_budget_rows(sheet, cells, 0, result.budget, result.standard_uncertainty_K, "K", say)
        _readings(book, cells, result, say)
    return stream.getvalue()


def write_results(
    result: ShutdownResult,
    folder: Path,
    *,
    stated: Certificate | None = None,
    certificate: bytes | None = None,
    is_replacing: bool = False,
) -> list[Path]:
    """Write `shutdown.json`, sheet and workbook, `readings.csv` and the figure.

    Args:
        result: The result.
        folder: Where to; it is made.
        stated: What the laboratory states, and the language; None for nothing, in English.
        certificate: Its Digital Calibration Certificate; None for none.
        is_replacing: Whether another result that stands there is replaced.

    Raises:
        InputError: If the folder cannot be written, or holds another result.
    """
    say = Texts((stated and stated.language) or LANGUAGES[0])
    drawn = figure(result, say)
    contents = {
        "shutdown.json": (to_json(as_content(result)) + "\n").encode(),
        "readings.csv": table(result),
        "shutdown.png": drawn,
        "shutdown.pdf": pdf(result, drawn, stated, say),
        "shutdown.xlsx": xlsx(result, say),
    }
    if certificate is not None:
        contents["dcc.xml"] = certificate
    if not is_replacing and is_other(folder / "shutdown.json", contents["shutdown.json"]):
        refuse_replacing(folder / "shutdown.json", "another result")
    with writable("the result", folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in contents.items():
            write_whole(folder / name, content)
    return [folder / name for name in contents]


MEDIAN = ("median", "2.5 %", "97.5 %")


def _answer_cells(book: Any, cells: Cells, result: ShutdownResult, say: Texts) -> None:
    sheet = book.add_worksheet(say.again("Switch-off"))
    said = content(result, None, say)
    for row, line in enumerate((said["title"], said["answer"], *said["lines"])):
        sheet.write_string(row, 0, line, cells.bold if row < 2 else None)
    row = 3 + len(said["lines"])
    rows = [
        ("winding", result.winding_degC, result.winding_95_degC, "°C"),
        ("rise", result.rise_K, result.rise_95_K, "K"),
        *((f"left to {one.name}", one.margin_K, one.margin_95_K, "K") for one in result.limits),
    ]
    sheet.write_row(row, 0, ("", *map(say.again, (*MEDIAN, "unit"))), cells.bold)
    for name, value, (low, high), unit in rows:
        row += 1
        for column, one in enumerate((say.again(name), value, low, high, unit)):
            write(sheet, row, column, one, cells.digits(1))
    sheet.write_row(row + 2, 0, said["hand_head"], cells.bold)
    for one in result.by_hand:
        off = one.degC - result.winding_degC
        for column, value in enumerate(
            (say.again(one.method), one.degC, off, say.again(one.source))
        ):
            write(sheet, row + 3, column, value, cells.digits(1))
        row += 1
    for note in said["notes"]:
        sheet.write_string(row + 4, 0, note)
        row += 1
    sheet.set_column(0, 0, 44)
    sheet.set_column(1, 4, 14)


def _readings(book: Any, cells: Cells, result: ShutdownResult, say: Texts) -> None:
    name_of_sheet = say.again("Readings")
    sheet = book.add_worksheet(name_of_sheet)
    english = ("time since switch-off [s]", "reading [°C]", "winding [°C]", *MEDIAN[1:])
    head = [say.again(text) for text in english]
    sheet.write_row(0, 0, head, cells.bold)
    time_s = np.union1d(result.time_s, result.reading_time_s)
    low, middle, high = (np.interp(time_s, result.time_s, one) for one in result.curve_degC)
    read = dict(zip(result.reading_time_s.tolist(), result.reading_degC.tolist(), strict=True))
    for row, values in enumerate(zip(time_s, middle, low, high, strict=True), start=1):
        for column, value in zip((0, 2, 3, 4), values, strict=True):
            write(sheet, row, column, float(value), cells.digits(2))
        write(sheet, row, 1, read.get(float(values[0])), cells.digits(2))
    sheet.set_column(0, 4, 22)
    chart, last = book.add_chart({"type": "scatter", "subtype": "straight"}), time_s.size
    dots = {"type": "circle", "size": 4}
    for column, line, marker in (
        (1, {"none": True}, dots),
        (2, {"width": 1.5}, {"type": "none"}),
        (3, {"width": 0.75, "dash_type": "dash"}, {"type": "none"}),
        (4, {"width": 0.75, "dash_type": "dash"}, {"type": "none"}),
    ):
        cells_of = {"categories": [name_of_sheet, 1, 0, last, 0],
                    "values": [name_of_sheet, 1, column, last, column]}  # fmt: skip
        name = [name_of_sheet, 0, column]
        chart.add_series({"name": name, **cells_of, "line": line, "marker": marker})
    chart.set_x_axis({"name": head[0], "major_gridlines": {"visible": False}, "min": 0})
    lowest = 10.0 * np.floor(float(np.min(low)) / 10.0)
    chart.set_y_axis({"name": "°C", "min": lowest})
    chart.set_legend({"position": "bottom"})
    chart.set_size({"width": 760, "height": 420})
    sheet.insert_chart("G2", chart)


METHOD = "Extrapolation of readings after switch-off to the instant of switch-off"

HOW = (
    "The winding cools by several exponentials whose time constants have wide physical priors or "
    "those of a calibrated run; the errors of the instruments and the moment of switch-off are "
    "sampled with them. The standard uncertainty is that of the draws, the budget of first order."
)


def dcc_text(result: ShutdownResult, certificate: Certificate) -> bytes:
    """Return the certificate of a temperature at switch-off.

    Args:
        result: The result.
        certificate: What the laboratory states; its days are those of the readings.

    Raises:
        InputError: If the temperature is not determinable, or something is not stated that such a
            certificate must say.
    """
    if not result.is_determinable:
        raise InputError(
            f"no certificate of a temperature that is not determinable: {result.reason}",
            remedy="Leave --dcc out.",
        )
    begin = certificate.test_from or certificate.test_until
    root, about = begun(
        certificate, TestDays(begin, certificate.test_until or begin), result.motor
    )  # fmt: skip
    use = f"Determinable: {budget_sum(result)}. {' '.join(map(clean, result.notes))}"
    add_statements(add(about, "statements"), use.strip(), certificate)
    measured = add(add(root, "measurementResults"), "measurementResult")
    add_text(measured, "name", "Temperature of the winding at switch-off")
    references = ("JCGM 100:2008", "JCGM 101:2008")
    add_method(measured, METHOD, HOW, references, __version__, certificate)
    held = add(measured, "influenceConditions")
    add_condition(held, "temperature of the sink", "degC", result.sink_degC)
    add_condition(held, "first reading after switch-off", "s", result.first_reading_s)
    found = add(measured, "results")
    _answer(found, result)
    add_budget(found, "the temperature", result.budget, "K", label="u_combined")
    held = add(add(measured, "measurementMetaData"), "metaData")
    add_text(held, "name", f"Readings {clean(result.readings)}")
    add_text(held, "declaration", f"SHA-256: {result.sha256}.")
    return as_bytes(root)


def _answer(parent: Element, result: ShutdownResult) -> None:
    data = add_result(parent, "Winding at switch-off")
    sd = result.standard_uncertainty_K
    winding = add_named(data, "temperature of the winding at switch-off")
    add_uncertain(winding, result.winding_degC, sd, result.winding_95_degC, "degC", label="winding")
    for name, value, (low, high), label in (
        (f"rise over the sink of {result.sink_degC:.1f} °C", result.rise_K, result.rise_95_K,
         "rise"),
        *((f"left to {one.name} {quantity(f'{one.value:g}', one.unit)}", one.margin_K,
           one.margin_95_K, "") for one in result.limits),
    ):  # fmt: skip
        # their draws are not kept: of a normal distribution the interval is 3.92 of it
        spread = (high - low) / 3.92
        add_uncertain(add_named(data, name), value, spread, (low, high), "K", label=label)
