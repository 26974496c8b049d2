"""Unseen files of every day that leave nothing open: they must simply be read."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from itertools import count

from .case import Case, Truth
from .table import Layout
from .units import DRIVE, FIVE, SEVEN
from .unseen_file import beside, comma, made, names_of, stamp, unseen

PLAIN = Truth.PLAIN
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
    ("everything quoted", Layout(row=lambda row: ",".join(f'"{cell}"' for cell in row))),
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


def layouts() -> Iterator[Case]:
    """Make canonical and thesis names in layouts of all kinds."""
    for number, (name, layout) in enumerate(LAYOUTS, 700):
        sheet = made(number, THESIS if number % 3 == 0 else "")
        content = sheet.text(layout)
        if name.startswith("no newline"):
            content = content.rstrip()
        yield unseen(name, PLAIN, sheet, content, mapped=False)


def tables() -> Iterator[Case]:
    """Make plain tables with other columns, steps, orders and numbers."""
    n = count(740)
    for step_s in (0.05, 0.5, 1.0, 12.5, 60.0):
        yield unseen(
            f"a step of {step_s} s",
            PLAIN,
            made(next(n), rows=160 if step_s >= 0.5 else 2400, step_s=step_s),
            mapped=False,
        )
    for name, channels in (
        ("time in the last column", (*FIVE[1:], FIVE[0])),
        ("backwards", FIVE[::-1]),
        ("speed and torque", SEVEN),
        ("with DC link", DRIVE),
        ("with stator and coolant", (*FIVE, "stator_degC", "coolant_degC")),
    ):
        yield unseen(name, PLAIN, made(next(n), channels=channels), mapped=False)
    for name, shift_s in (
        ("time from 1904", 3.7974e9), ("time from 1970", 1.71473e9), ("time from -120", -120.0),
        ("time from 86000", 86000.0),
    ):  # fmt: skip
        digits = {"time_s": 1}
        sheet = made(next(n), shift_s=shift_s, digits=digits)
        yield unseen(name, PLAIN, sheet, mapped=False)
    whole = {"phase_current_A": 1, "losses_W": 0, "ambient_degC": 1, "winding_degC": 1, "time_s": 0}
    yield unseen("a digit or none after the point", PLAIN, made(741, digits=whole), mapped=False)
    sheet = made(next(n))
    yield unseen(
        "exponents", PLAIN, sheet.with_cells("*", lambda cell: f"{float(cell):.9E}"), mapped=False
    )
    yield unseen(
        "plus signs",
        PLAIN,
        made(next(n)).with_cells("winding_degC", lambda cell: "+" + cell),
        mapped=False,
    )
    yield unseen(
        "zeros before the numbers",
        PLAIN,
        made(next(n)).with_cells("*", lambda cell: cell.zfill(12)),
        mapped=False,
    )
    yield unseen("minus signs of typesetters", PLAIN, made(next(n), shift_s=-400.0).with_cells(
        "time_s", lambda cell: cell.replace("-", "\u2212")), mapped=False)  # fmt: skip
    sheet = comma(made(next(n)))
    yield unseen("decimal commas in a tabbed table", PLAIN, sheet, Layout("\t"), mapped=False)
    yield unseen("decimal commas, quoted, between commas", PLAIN, comma(made(next(n))), Layout(
        row=lambda row: ",".join(f'"{cell}"' for cell in row)), mapped=False)  # fmt: skip
    yield unseen(
        "decimal commas between pipes", PLAIN, comma(made(next(n))), Layout("|"), mapped=False
    )


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
        sheet = beside(made(next(n)), header, cells, at)
        yield unseen(name, PLAIN, sheet, mapped=False)
    names = "Elapsed|Current U|Loss|Room|Coil"
    sheet = beside(made(next(n), names), "Comment", lambda i: "", 5)
    yield unseen("plain names of one's own", PLAIN, sheet, columns=names_of(sheet))
    sheet = made(next(n), "TIME_S|PHASE_CURRENT_A|LOSSES_W|AMBIENT_DEGC|WINDING_DEGC")
    yield unseen("names in capitals", PLAIN, sheet)
    sheet = made(next(n), "Zeit|Strom U|Verlust|T außen|T Nut Süd")
    yield unseen("umlauts in Latin-1", PLAIN, sheet, Layout(";", "latin-1"))


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
        yield unseen(name, PLAIN, sheet, Layout(at), columns={"time_s": "Timestamp"})


def packed() -> Iterator[Case]:
    """Make files of other endings."""
    for number, suffix in enumerate((".txt", ".dat", ".tsv", ".asc", ".CSV"), 810):
        sheet, layout = made(number), Layout("\t" if suffix != ".CSV" else ",")
        yield unseen(f"ending {suffix}", PLAIN, sheet, layout, suffix=suffix, mapped=False)
    sheet = made(816)
    content = gzip.compress(sheet.text(), mtime=0)
    yield unseen("gzip", PLAIN, sheet, content, suffix=".csv.gz", mapped=False)


def plain_files() -> Iterator[Case]:
    """Make all of them."""
    for source in (layouts, tables, neighbours, times, packed):
        yield from source()
