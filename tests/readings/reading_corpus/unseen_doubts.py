"""Unseen text files that contradict themselves, leave something open or are none of a bench."""

from collections.abc import Iterator
from itertools import count

import numpy as np

from .case import Case, Truth
from .table import Layout
from .units import FIVE, SEVEN
from .unseen_file import beside, changed, comma, made, names_of, stamp, unseen

ASK, OPEN, CONFLICT, REFUSE = Truth.ASK, Truth.OPEN, Truth.CONFLICT, Truth.REFUSE
UNIT = r"unit|\[columns\]|not understood"
"""A warning that says nothing of a unit does not name the doubt."""
WHEN = UNIT + r"|time_|hh:mm|numbers|dd/mm|month|midnight"


def odd_units() -> Iterator[Case]:
    """Make units in the header that hardly anybody understands: right or asked."""
    n = count(960)
    for name, head, unit, at in (
        ("a factor in the bracket", "P_loss [0.1 W]", "dW", 2),
        ("a factor beside the unit", "P_loss x0.1 [W]", "dW", 2),
        ("a power of ten divided away", "P_loss/10^3 [W]", "kW", 2),
        ("a factor behind the unit", "P_loss [W*1000]", "kW", 2),
        ("hundreds of watts", "P_loss [hW]", "hW", 2),
        ("BTU per hour", "P_loss [BTU/h]", "BTU/h", 2), ("horsepower", "P_loss [HP]", "hp", 2),
        ("a code of trade", "P_loss [KWT]", "kW", 2),
        ("per cent of a rating", "P_loss [% of 2 kW]", "20%", 2),
        ("Cyrillic kilowatts", "Потери, кВт", "kW", 2),
        ("Chinese kilowatts", "损耗(千瓦)", "kW", 2),
        ("tenths of a degree", "T_w [0.1°C]", "d°C", 4),
        ("hundredths of a degree in the name", "T_w_degC_x100", "c°C", 4),
        ("a Pt100 in ohms", "T_w [Ω]", "ohm", 4),
        ("a degree sign that got lost", "T_w [?F]", "F", 4),
        ("a bare F", "T_w [F]", "F", 4), ("degrees kelvin", "T_w [°K]", "K", 4),
        ("peak to peak", "I_phase [A_pp]", "pp", 1),
        ("a current with a hat", "Î_phase [A]", "peak", 1),
        ("hundredths of an ampere", "I_phase [A/100]", "cA", 1),
        ("ticks of 10 ms", "time [10 ms]", "10ms", 0),
        ("ticks of 100 Hz", "ticks (100 Hz)", "10ms", 0),
    ):  # fmt: skip
        heads, units = [str(name) for name in FIVE], ["-"] * 5
        heads[at], units[at] = head, unit
        sheet = made(next(n), "|".join(heads), " ".join(units))
        yield unseen(name, ASK, sheet, subject=UNIT)


def wrong_units() -> Iterator[Case]:
    """Make numbers in another unit than their plain name says."""
    n = count(1000)
    for name, truth, units in (
        ("kilowatts as losses_W", ASK, "- - kW - -"),
        ("minutes as time_s", ASK, "min - - - -"),
        ("hours as time_s", ASK, "h - - - -"),
        ("milliseconds as time_s", ASK, "ms - - - -"),
        ("kelvins as winding_degC", ASK, "- - - - K"),
        ("kelvins as both temperatures", ASK, "- - - K K"),
        ("Fahrenheit as winding_degC", ASK, "- - - - F"),
        ("Fahrenheit as ambient_degC", ASK, "- - - F -"),
        ("Fahrenheit as both temperatures", OPEN, "- - - F F"),
        ("milliamperes as phase_current_A", ASK, "- mA - - -"),
        ("tenths of a degree as winding_degC", ASK, "- - - - d°C"),
    ):
        sheet = made(next(n), "", units)
        yield unseen(name, truth, sheet, mapped=False, subject=UNIT)
    sheet = made(1011, "time_s|I_phase|losses_W|ambient_degC|winding_degC", "- peak - - -")
    yield unseen("amplitudes as I_phase", OPEN, sheet, subject="amplitude|peak|rms")
    sheet = made(1021, "|".join((*FIVE, "n", "M")), "- - - - - rad/s -", channels=SEVEN)
    yield unseen("rad/s as n", OPEN, sheet, subject=UNIT)


def conflicts() -> Iterator[Case]:
    """Make two statements that disagree."""
    n, watts = count(1030), ("s", "A", "W", "°C", "°C")
    for name, head, layout in (
        ("the canonical name and its bracket", "losses_W [kW]", Layout()),
        ("the bracket and the units row", "P_loss [kW]", Layout(below=(watts,))),
        ("the name and the units row", "P_loss_kW", Layout(";", above=(watts,))),
        ("the bracket and a comment", "P_loss [W]", Layout(before=("# P_loss in kW",))),
        ("the name and the bracket", "P_loss_kW (W)", Layout("\t")),
        ("two brackets", "P_loss [kW] [W]", Layout()),
        ("the name and a list of channels", "P_loss_W", Layout(";", before=(
            "Channel;Unit", "time_s;s", "P_loss_W;kW", ""))),
    ):  # fmt: skip
        heads = "|".join((*FIVE[:2], head, *FIVE[3:]))
        sheet = made(next(n), heads, "- - kW - -")
        yield unseen(name, CONFLICT, sheet, layout, subject=UNIT)
    sheet = made(next(n), "time_s [ms]|" + "|".join(FIVE[1:]), "ms - - - -")
    yield unseen("time_s in ms", CONFLICT, sheet, subject=UNIT)
    sheet = made(next(n), "|".join(FIVE[:4]) + "|winding_degC [K]", "- - - - K")
    yield unseen("degC in K", CONFLICT, sheet, subject=UNIT)
    sheet = made(next(n), "|".join((*FIVE[:2], "P_kW", *FIVE[3:])), "- - kW - -")
    yield unseen("the name and the motor file", CONFLICT, sheet,
                 columns={"losses_W": "P_kW [W]"}, subject=UNIT)  # fmt: skip
    sheet = beside(made(next(n), "|".join((*FIVE[:4], "Tw"))), "Tw", lambda i: f"{30 + i / 7:.2f}")
    yield unseen(
        "one name twice", CONFLICT, sheet, columns=names_of(sheet), subject="both stand|twice"
    )


def open_rows() -> Iterator[Case]:
    """Make rows that are no samples, or samples that are no numbers."""
    n = count(1050)
    for token in ("-9999", "9.9E+37", "OL", "#WERT!", "1.#INF", "Bad", "--.-", "65535", "1e400"):
        sheet = made(next(n))
        layout = changed(sheet, lambda i, row, t=token: [*row[:4], t] if i in (40, 90, 91) else row)
        truth = {name: values.copy() for name, values in sheet.truth.items()}
        truth["winding_degC"][[40, 90, 91]] = np.nan
        yield unseen(f"{token} among the temperatures", ASK, sheet, layout, channels=truth,
                     mapped=False, subject="winding")  # fmt: skip
    for name, after in (
        ("summary rows", ("Mean,12.5,300.1,22.4,41.0", "Max,14.5,340.0,23.0,61.2")),
        ("a summary row of numbers alone", (",12.5,300.1,22.4,41.0",)),
        ("an average after the time", ("397.5,12.5,300.1,22.4,41.0",)),
        ("a second recording", (",".join(FIVE), "0,3,99,22,25", "5,3,99,22,26")),
    ):
        yield unseen(name, ASK, made(next(n)), Layout(after=after), mapped=False)
    sheet = made(next(n))
    again = Layout(rows=lambda lines: [*lines[:80], ",".join(FIVE), *lines[80:]])
    yield unseen("the header again in the middle", ASK, sheet, again, mapped=False)
    sheet = made(next(n))
    yield unseen("half a table with commas", ASK, sheet, Layout(";", rows=lambda lines: [
        line.replace(".", ",") if i > 80 else line for i, line in enumerate(lines)]),
        mapped=False)  # fmt: skip
    sheet = comma(made(next(n)))
    yield unseen("decimal commas between commas", ASK, sheet, mapped=False)
    sheet = made(next(n))
    lost = Layout(rows=lambda lines: lines[:60] + [""] * 20 + lines[80:])
    truth = {k: np.where((np.arange(160) // 20 == 3), np.nan, v) for k, v in sheet.truth.items()}
    yield unseen("20 empty lines", ASK, sheet, lost, channels=truth, mapped=False)
    arabic = str.maketrans("0123456789", "٠١٢٣٤٥٦٧٨٩")
    yield unseen("Arabic digits", ASK, made(next(n)).with_cells(
        "winding_degC", lambda cell: cell.translate(arabic)), mapped=False)  # fmt: skip
    yield unseen("prefixes in cells", ASK, made(1083).with_cells(
        "losses_W", lambda cell: f"{float(cell) / 1000:.6f}k"), mapped=False)  # fmt: skip
    mixed = made(1083, "|".join((*FIVE[:2], "P", *FIVE[3:])), digits={"losses_W": 2})
    yield unseen("W and kW in the cells of one column", ASK, mixed.with_cells(
        "losses_W", lambda x: f"{float(x) / 1e3:.5f} kW" if float(x) > 1500 else f"{x} W"),
        columns={"losses_W": "P"}, subject="P")  # fmt: skip


def open_times() -> Iterator[Case]:
    """Make times that the file does not settle."""
    n = count(1090)
    for name, head, clock, step_s in (
        ("points in the clock", "ora", stamp("%H.%M.%S"), 5.0),
        ("a clock with colons before the milliseconds", "Time", stamp("%H:%M:%S:000"), 5.0),
        ("days of Excel", "Date", lambda x: f"{45412.5 + x / 86400:.8f}", 5.0),
        ("Julian days", "JD", lambda x: f"{2460433.925 + x / 86400:.7f}", 5.0),
        ("two numbers of a clock", "Time", stamp("%H:%M"), 60.0),
        ("sample numbers", "n", lambda x: f"{x / 5:.0f}", 5.0),
        ("day or month first", "Date", stamp("%d/%m/%Y %H:%M:%S"), 5.0),
        ("past midnight", "clock", lambda x: stamp("%H:%M:%S")(x + 49500), 5.0),
        ("summer time without offsets", "stamp",
         lambda x: stamp("2024-03-31 %H:%M:%S")(x - 29640 + (3600 if x >= 120 else 0)), 5.0),
    ):  # fmt: skip
        sheet = made(next(n), f"{head}|" + "|".join(FIVE[1:]), clock=clock, step_s=step_s,
                     written_s=0.01)  # fmt: skip
        # A logger of 1 Hz counts just so.
        truth = OPEN if name == "sample numbers" else ASK
        yield unseen(name, truth, sheet, columns={"time_s": head}, subject=WHEN)
    sheet = made(1110, "Time|" + "|".join(FIVE[1:]), step_s=0.5, clock=stamp("%H:%M:%S"))
    sheet = beside(sheet, "Millisecond", lambda i: str(i % 2 * 500), 1)
    yield unseen("milliseconds in a column of their own", ASK, sheet,
                 columns={"time_s": "Time"}, subject=WHEN)  # fmt: skip


def no_bench_files() -> Iterator[Case]:
    """Make files that hold no heat run."""
    sheet = made(1120)
    lines = sheet.text().decode().splitlines()
    table = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in line.split(",")) + "</tr>\n"
                    for line in lines)  # fmt: skip
    frame = b"   %d.100000 1 1A0 Rx d 8 00 11 22 33 44 55 66 77\n"
    can = b"date Fri May 3 10:12:00 2024\nbase hex timestamps absolute\n"
    for name, content in (
        ("HTML", f"<html><body><table>\n{table}</table></body></html>".encode()),
        ("JSON lines", b'{"t": 0, "Is": 3.1}\n{"t": 5, "Is": 3.1}\n' * 60),
        ("a log of CAN frames", can + b"".join(frame % i for i in range(99))),
        ("names alone", lines[0].encode() + b"\n"),
        ("a picture", b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 8),
        ("a workbook by another name", b"PK\x03\x04" + bytes(range(256)) * 8),
    ):
        yield unseen(name, REFUSE, sheet, content, channels={}, mapped=False)


SOURCES = (odd_units, wrong_units, conflicts, open_rows, open_times, no_bench_files)
