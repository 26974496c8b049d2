"""Unseen files of every day that leave nothing open: they must simply be read."""

import gzip
from collections.abc import Iterator
from itertools import count
from typing import Any

from .case import Case, Truth
from .table import Layout, Sheet
from .units import DRIVE, FIVE, SEVEN
from .unseen_file import beside, comma, made, names_of, stamp, unseen

QUOTED = Layout(row=lambda row: ",".join(f'"{cell}"' for cell in row))
THESIS = "t|Is|Pd|Te|Tw_m"
LAYOUTS: tuple[tuple[str, Layout], ...] = (
    ("old Mac line ends", Layout(newline="\r")),
    ("CRLF and a BOM", Layout(newline="\r\n", bom=b"\xef\xbb\xbf")),
    ("UTF-16 big endian with tabs", Layout("\t", "utf-16-be", bom=b"\xfe\xff")),
    ("UTF-16 little endian", Layout(";", "utf-16-le", "\r\n", bom=b"\xff\xfe")),
    ("sep= of Excel", Layout(";", before=("sep=;",), newline="\r\n")),
    ("sep= with a tab", Layout("\t", before=("sep=\t",))),
    ("pipes with blanks", Layout(" | ")),
    ("comma and blank", Layout(", ")),
    ("everything quoted", QUOTED),
    ("quoted with semicolons", Layout(row=lambda row: ";".join(f'"{cell}"' for cell in row))),
    ("a delimiter after each row", Layout(row=lambda row: ",".join(row) + ",")),
    ("fixed width", Layout(row=lambda row: "".join(f"{cell:>18}" for cell in row))),
    ("fixed width to the left", Layout(row=lambda row: "".join(f"{cell:<18}" for cell in row))),
    ("indented tabs", Layout(row=lambda row: "  " + "\t".join(row))),
    ("no newline after the last row", Layout(after=(), newline="\n")),
    ("three empty lines at the end", Layout(after=("", "", ""))),
    ("comments with #", Layout(before=("# bench 4", "# operator: K. Maier", "#"))),
    ("comments with %", Layout(before=("% exported by save_ascii.m", "% 03-May-2024"))),
    ("comments with //", Layout(before=("// stand 2, heat run", "// file 7 of 9"))),
    ("a title and an empty line", Layout(before=("Heat run of motor 17", ""))),
    ("keys and values above", Layout(before=("Model,WT3000", "Serial,91K225", "Items,5"))),
    ("the rate of the instrument above", Layout(before=("# Sampling: 200 kS/s, filter 1 kHz",))),
    ("a file version above", Layout(before=("Version: 2.1;Build: 8832;Rev A",), delimiter=";")),
)


def plain(name: str, sheet: Sheet, content: Any = None, *, mapped: bool = False, **more) -> Case:
    """Return the case of a file that leaves nothing open."""
    return unseen(name, Truth.PLAIN, sheet, content, mapped=mapped, **more)


def layouts() -> Iterator[Case]:
    """Make canonical and thesis names in layouts of all kinds."""
    for number, (name, layout) in enumerate(LAYOUTS, 700):
        sheet = made(number, THESIS if number % 3 == 0 else "")
        content = sheet.text(layout)
        yield plain(name, sheet, content.rstrip() if name.startswith("no newline") else content)


def tables() -> Iterator[Case]:
    """Make plain tables with other columns, steps, orders and numbers."""
    n = count(740)
    for step_s in (0.05, 0.5, 1.0, 12.5, 60.0):
        rows = 160 if step_s >= 0.5 else 2400
        yield plain(f"a step of {step_s} s", made(next(n), rows=rows, step_s=step_s))
    for name, channels in (
        ("time in the last column", (*FIVE[1:], FIVE[0])),
        ("backwards", FIVE[::-1]),
        ("speed and torque", SEVEN),
        ("with DC link", DRIVE),
        ("with stator and coolant", (*FIVE, "stator_degC", "coolant_degC")),
    ):
        yield plain(name, made(next(n), channels=channels))
    for name, shift_s in (
        ("time from 1904", 3.7974e9), ("time from 1970", 1.71473e9), ("time from -120", -120.0),
        ("time from 86000", 86000.0),
    ):  # fmt: skip
        yield plain(name, made(next(n), shift_s=shift_s, digits={"time_s": 1}))
    whole = {"phase_current_A": 1, "losses_W": 0, "ambient_degC": 1, "winding_degC": 1, "time_s": 0}
    yield plain("a digit or none after the point", made(741, digits=whole))
    for name, channel, write in (
        ("exponents", "*", lambda cell: f"{float(cell):.9E}"),
        ("plus signs", "winding_degC", lambda cell: "+" + cell),
        ("zeros before the numbers", "*", lambda cell: cell.zfill(12)),
    ):
        yield plain(name, made(next(n)).with_cells(channel, write))
    below = made(next(n), shift_s=-400.0)
    yield plain("minus signs of typesetters", below.with_cells(
        "time_s", lambda cell: cell.replace("-", "\u2212")))  # fmt: skip
    for name, layout in (
        ("decimal commas in a tabbed table", Layout("\t")),
        ("decimal commas, quoted, between commas", QUOTED),
        ("decimal commas between pipes", Layout("|")),
    ):
        yield plain(name, comma(made(next(n))), layout)


def neighbours() -> Iterator[Case]:
    """Make plain tables with columns that are nobody's business."""
    n = count(770)
    for name, header, cells, at in (
        ("a status column of words", "state", lambda i: "RUN" if i % 40 else "RAMP", 99),
        ("a status column of hex", "status_word", lambda i: f"0x{i:04X}", 3),
        ("an index without a name", "", str, 0),
        ("numbers of samples", "Sample", lambda i: str(i + 1), 0),
        ("true and false", "fan_on", lambda i: "TRUE" if i < 60 else "FALSE", 2),
        ("an empty column", "spare", lambda i: "", 4),
        ("a column of NaN", "T_rotor", lambda i: "NaN", 99),
        ("a date beside the seconds", "written", lambda i: f"2024-05-03 10:{i % 60:02d}:00", 0),
        ("remarks with commas", "remark", lambda i: '"ok, warm"' if i == 7 else '""', 99),
        ("a second winding sensor", "T_winding_2", lambda i: f"{40 + i / 9:.1f}", 99),
        ("a set point of the current", "I_set [mA]", lambda i: "900", 1),
        ("a bearing in Fahrenheit", "T_bearing [°F]", lambda i: f"{80 + i / 20:.1f}", 99),
    ):
        yield plain(name, beside(made(next(n)), header, cells, at))
    names = "Elapsed|Current U|Loss|Room|Coil"
    sheet = beside(made(next(n), names), "Comment", lambda i: "", 5)
    yield plain("plain names of one's own", sheet, columns=names_of(sheet))
    sheet = made(next(n), "TIME_S|PHASE_CURRENT_A|LOSSES_W|AMBIENT_DEGC|WINDING_DEGC")
    yield plain("names in capitals", sheet, mapped=True)
    sheet = made(next(n), "Zeit|Strom U|Verlust|T außen|T Nut Süd")
    yield plain("umlauts in Latin-1", sheet, Layout(";", "latin-1"), mapped=True)


def times() -> Iterator[Case]:
    """Make plain dates and clocks."""
    n = count(790)
    for name, form, at in (
        ("ISO dates", "%Y-%m-%dT%H:%M:%S", ","), ("ISO dates with Z", "%Y-%m-%dT%H:%M:%SZ", ","),
        ("dates with a blank", "%Y-%m-%d %H:%M:%S.%f", ","), ("a clock", "%H:%M:%S", ";"),
        ("a clock with milliseconds", "%H:%M:%S.000", "\t"),
        ("dates with slashes, year first", "%Y/%m/%d %H:%M:%S", ","),
        ("dates with an offset", "%Y-%m-%d %H:%M:%S+02:00", ","),
        ("German dates after the twelfth", "%d.%m.%Y %H:%M:%S", ";"),
    ):  # fmt: skip
        form = form.replace("%d.", "23.")
        sheet = made(next(n), "Timestamp|" + "|".join(FIVE[1:]), clock=stamp(form))
        yield plain(name, sheet, Layout(at), columns={"time_s": "Timestamp"})


def packed() -> Iterator[Case]:
    """Make files of other endings."""
    for number, suffix in enumerate((".txt", ".dat", ".tsv", ".asc", ".CSV"), 810):
        sheet, layout = made(number), Layout("\t" if suffix != ".CSV" else ",")
        yield plain(f"ending {suffix}", sheet, layout, suffix=suffix)
    sheet = made(816)
    content = gzip.compress(sheet.text(), mtime=0)
    yield plain("gzip", sheet, content, suffix=".csv.gz")


SOURCES = (layouts, tables, neighbours, times, packed)
