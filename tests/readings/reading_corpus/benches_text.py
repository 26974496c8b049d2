"""Text as the loggers of benches write it: headers, signs, encodings, clocks, rates, restarts."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import count

import numpy as np

from .case import Case, Truth
from .table import Layout, Sheet
from .units import FIVE, SEVEN
from .unseen_file import comma, made, names_of

READ, ASK = Truth.READ, Truth.ASK
HEADS = "t [s]|I [A]|P [W]|T_a [°C]|T_w [°C]"
START = datetime(2025, 9, 23, 11, 58, 20)


LABVIEW = (
    "LabVIEW Measurement\t", "Writer_Version\t0.92", "Reader_Version\t1", "Separator\tTab",
    "Decimal_Separator\t{point}", "Multi_Headings\tNo", "X_Columns\t{x}", "Time_Pref\tRelative",
    "Operator\tlab 3", "Date\t2025/09/23", "Time\t11:58:20,5", "***End_of_Header***\t", "\t",
    "Channels\t4" + "\t" * 4, "Samples" + "\t160" * 4, "Date" + "\t2025/09/23" * 4,
    "Time" + "\t11:58:20,5" * 4, "Y_Unit_Label\tA\tkW\tdegC\tdegC", "X_Dimension" + "\tTime" * 4,
    "X0" + "\t0{point}0000000000000000E+0" * 4, "Delta_X" + "\t5{point}000000" * 4,
    "***End_of_Header***" + "\t" * 5,
)  # fmt: skip
PREAMBLES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("a table of calibration", ("Cal;Date;Slope", "1;20250102;0.998", "2;20250102;1.003", "")),
    ("gains in cells of the table", ("Slot;1;2;3;4", "Gain;1.0;10;2.5;2.5", "Zero;0;0;0.1;0.1")),
    ("sections", ("[Header]", "Version=3", "[Scaling]", "0.5;0.25", "1;1", "[Data]")),
    ("limits of alarms", ("Channel;Low;High", "3;0;60", "4;0;155", "")),
    ("statistics in words", ("Kanal;Min;Max", "Kanal 3;21.5;24.8", "Kanal 4;21.5;97.1", "")),
)  # fmt: skip


def headers() -> Iterator[Case]:
    """Make LabVIEW's second header, and numbers above the table that are not the table."""
    cause, n = "second headers", count(1400)
    for name, x, point in (
        ("LabVIEW, one column of times", "One", "."), ("LabVIEW, decimal comma", "One", ","),
        ("LabVIEW, no column of times", "No", "."),
        ("LabVIEW, a time for each channel", "Multi", "."),
    ):  # fmt: skip
        sheet = made(next(n), "X_Value|Irms|Losses|Air|Coil", "- - kW - -")
        before = tuple(line.format(point=point, x=x) for line in LABVIEW)
        written = comma(sheet) if point == "," else sheet
        columns = {column.channel: column.header for column in sheet.columns[1:]}

        def row(cells: list[str], x: str = x) -> str:
            if x == "Multi":
                return "\t".join(f"{cells[0]}\t{cell}" for cell in cells[1:])
            return "\t".join(["" if x == "No" and cells[0] != "X_Value" else cells[0], *cells[1:]])

        if x == "Multi":
            before = tuple(
                line.replace("kW", "\tkW").replace("degC", "\tdegC") if "Unit" in line else line
                for line in before
            )
        yield written.case(
            cause, name, READ, Layout(before=before, row=row, newline="\r\n"), columns=columns,
            suffix=".lvm",
        )  # fmt: skip
    for name, before in PREAMBLES:
        sheet = made(next(n), HEADS)
        yield sheet.case(cause, name, READ, Layout(";", before=before), columns=names_of(sheet))


def signs() -> Iterator[Case]:
    """Make blanks between the sign and the digits."""
    cause, n = "signs apart", count(1420)

    def apart(width: int) -> Callable[[str], str]:
        return lambda cell: f"{'-' if cell[0] == '-' else '+'}{cell.lstrip('-'):>{width}}"

    quoted = Layout(row=lambda row: ",".join(f'"{cell}"' for cell in row))
    for name, layout, width, shift_s in (
        ("Graphtec", Layout(), 10, 0.0),
        ("tabs", Layout("\t"), 9, 0.0),
        ("decimal comma", Layout(";"), 12, 0.0),
        ("in quotes", quoted, 10, 0.0),
        ("times below zero", Layout(), 11, -400.0),
        ("pipes", Layout("|"), 14, 0.0),
        ("a row of units", Layout(";", below=(("s", "A", "W", "°C", "°C"),)), 10, 0.0),
    ):
        heads = HEADS.replace("[", "(").replace("]", ")") if layout.below == () else "t|I|P|T_a|T_w"
        sheet = made(next(n), heads, shift_s=shift_s)
        written = sheet.with_cells("*", apart(width))
        written = comma(written) if name == "decimal comma" else written
        yield written.case(cause, name, READ, layout, columns=names_of(sheet))
    sheet = made(next(n), HEADS)
    written = sheet.with_cells("*", lambda cell: f"+ {float(cell):.8E}")
    yield written.case(cause, "exponents", READ, Layout(), columns=names_of(sheet))


ENCODED: tuple[tuple[str, str, str, str, tuple[str, ...]], ...] = (
    ("HIOKI, half-width", "cp932", "ｼﾞｶﾝ[s]|ﾃﾞﾝﾘｭｳ[A]|ｿﾝｼﾂ[kW]|ｼﾂｵﾝ[ﾟC]|ﾏｷｾﾝ[ﾟC]", "- - kW - -", ()),
    ("Graphtec, a row of units", "cp932", "経過|電流|損失|室温|巻線", "- - kW - -",
     ("s", "A", "kW", "℃", "℃")),
    ("Yokogawa, EUC-JP", "euc_jp", "時間(s)|相電流(A)|損失(W)|周囲温度(℃)|コイル温度(℃)", "", ()),
    ("Chinese test stand", "gb18030", "时间(s)|相电流(A)|损耗(kW)|环境温度(℃)|绕组温度(℃)",
     "- - kW - -", ()),
    ("Chinese, a row of units", "gbk", "时间|电流|功率损耗|室温|线圈", "- mA - - K",
     ("s", "mA", "W", "℃", "K")),
    ("Taiwanese", "big5", "時間(s)|相電流(A)|損耗(W)|環境溫度(℃)|繞組溫度(℃)", "", ()),
    ("Korean", "cp949", "시간[s]|상전류[A]|손실[kW]|주위온도[℃]|권선온도[℃]", "- - kW - -", ()),
    ("UTF-16, full-width brackets", "utf-16",
     "時刻［s］|電流［A］|損失［W］|気温［℃］|巻線［℃］", "", ()),
    ("the ring alone", "utf-8", "t [s]|I [A]|P [W]|T_a [˚C]|T_w [ºC]", "", ()),
    ("a katakana ring", "cp932", "t[s]|I[A]|P[W]|外気[゜C]|巻線[゜C]", "", ()),
)  # fmt: skip


def encodings() -> Iterator[Case]:
    """Make files of East Asian loggers."""
    for number, (name, codec, heads, units, below) in enumerate(ENCODED, 1440):
        sheet = made(number, heads, units)
        layout = Layout(",", codec, "\r\n", below=(below,) if below else ())
        yield sheet.case("East Asian encodings", name, READ, layout, columns=names_of(sheet))


RATES: tuple[tuple[str, dict[str, tuple[int, int]], str], ...] = (
    ("pivot of InfluxDB", {"ambient_degC": (5, 0)}, "null"),
    ("asammdf with empty cells", {"ambient_degC": (4, 0), "coolant_degC": (10, 0)}, ""),
    ("the winding at half the rate", {"winding_degC": (2, 0)}, ""),
    ("the winding between the stamps of the room", {"winding_degC": (2, 0), "ambient_degC": (2, 1)},
     ""),
    ("three rates, NaN", {"winding_degC": (3, 0), "ambient_degC": (6, 0), "coolant_degC": (2, 1)},
     "NaN"),
    ("a room once a minute", {"ambient_degC": (12, 0)}, ""),
    ("a coil once in eight", {"winding_degC": (8, 0), "coolant_degC": (4, 0)}, "nan"),
)  # fmt: skip


def rates() -> Iterator[Case]:
    """Make tables on the time stamps of all channels."""
    channels = (*FIVE, "coolant_degC")
    for number, (name, slow, mark) in enumerate(RATES, 1460):
        sheet = made(number, channels=channels, rows=241)
        truth, tolerance = dict(sheet.truth), dict(sheet.tolerance)
        columns = []
        for column in sheet.columns:
            if column.channel in slow:
                every, first = slow[column.channel]
                kept = np.arange(241) % every == first
                cells = tuple(cell if kept[i] else mark for i, cell in enumerate(column.cells))
                column = replace(column, cells=cells)
                if column.channel == "winding_degC":
                    truth[column.channel] = np.where(kept, truth[column.channel], np.nan)
                else:  # a straight line between its samples, held before the first and last
                    tolerance[column.channel] = 0.01
            columns.append(column)
        slowed = Sheet(number, tuple(columns), truth, tolerance)
        yield slowed.case("rates of their own", name, READ, Layout(";" if number % 2 else ","))


def stamp(form: str, shift_s: float = 0.0) -> Callable[[float], str]:
    """Return what writes a time by `strftime`, `{ms}` and `{us}` being the fraction."""

    def write(seconds: float) -> str:
        moment = START + timedelta(seconds=float(seconds) + shift_s)
        ms = moment.microsecond // 1000
        return moment.strftime(form).format(
            ms=f"{ms:03d}", us=f"{1000 * ms:06d}", cs=f"{ms // 10:02d}"
        )

    return write


CLOCKS: tuple[tuple[str, str], ...] = (
    ("Keysight DAQ970A", "%m/%d/%Y %H:%M:%S:{ms}"),
    ("ISO date and a colon", "%Y-%m-%d %H:%M:%S:{ms}"),
    ("German date and a colon", "%d.%m.%Y %H:%M:%S:{ms}"),
    ("clock with a colon", "%H:%M:%S:{ms}"),
    ("half days", "%m/%d/%Y %I:%M:%S:{ms} %p"),
    ("hundredths behind a colon", "%Y/%m/%d %H:%M:%S:{cs}"),
    ("microseconds behind a colon", "%d-%b-%Y %H:%M:%S:{us}"),
    ("Chinese date", "%Y年%m月%d日 %H:%M:%S:{ms}"),
)


def clocks() -> Iterator[Case]:
    """Make clocks with a colon before the fraction of a second."""
    names = "|".join(("Time", *FIVE[1:]))
    for number, (name, form) in enumerate(CLOCKS, 1480):
        sheet = made(number, names, clock=stamp(form, 0.25), step_s=2.5, written_s=1e-6)
        yield sheet.case("clocks", name, READ, Layout(";"), columns={"time_s": "Time"})


WORDS: tuple[tuple[str, str, str], ...] = (
    ("Graphtec, time", "Date&Time", "time"), ("capitals", "Stamp", "TIME"),
    ("the form of the date", "Timestamp", "yyyy/mm/dd hh:mm:ss"),
    ("German", "Zeitpunkt", "Uhrzeit"),
    ("Italian", "Data e ora", "ora"), ("French", "Horodatage", "heure"),
    ("Japanese", "日時", "時刻"), ("a zone", "When", "UTC"), ("in brackets", "Clock", "[Date]"),
)  # fmt: skip


def unit_rows() -> Iterator[Case]:
    """Make rows of units with a word where the clock has none."""
    for number, (name, head, word) in enumerate(WORDS, 1500):
        sheet = made(number, f"{head}|I|P|T_a|T_w", "- - kW - -",
                     clock=stamp("%Y/%m/%d %H:%M:%S"))  # fmt: skip
        layout = Layout(";", below=((word, "A", "kW", "°C", "°C"),))
        columns = {column.channel: column.header for column in sheet.columns[1:]}
        yield sheet.case("words in the row of units", name, READ, layout, columns=columns)


ORDERS: tuple[tuple[str, str, Callable[[dict[str, np.ndarray]], np.ndarray]], ...] = (
    ("by speed and torque", "speed_rpm", lambda run: np.lexsort(
        (run["torque_Nm"], run["speed_rpm"]))),
    ("by torque, falling", "torque_Nm|phase_current_A", lambda run: np.argsort(
        -run["torque_Nm"], kind="stable")),
    ("by the winding", "winding_degC", lambda run: np.argsort(run["winding_degC"])),
    ("by losses, falling", "losses_W", lambda run: np.argsort(-run["losses_W"])),
    ("by current, then the winding", "torque_Nm|phase_current_A", lambda run: np.lexsort(
        (-run["winding_degC"], run["phase_current_A"]))),
    ("at random", "another order", lambda run: np.random.default_rng(7).permutation(
        run["time_s"].size)),
    ("backwards", "the last sample stands first", lambda run: np.argsort(-run["time_s"])),
)  # fmt: skip


def orders() -> Iterator[Case]:
    """Make rows that are sorted by something else than the time."""
    for k, (name, words, order) in enumerate(ORDERS):
        sheet = made(1524 + k % 4 + 8 * (k // 4), channels=SEVEN)  # runs of many steps
        places = order(sheet.truth)
        shuffled = replace(sheet, columns=tuple(
            replace(one, cells=tuple(one.cells[i] for i in places)) for one in sheet.columns
        ))  # fmt: skip
        yield shuffled.case("rows in another order", name, ASK,
                            subject=f"(?:{words}).*Sort the rows by time")  # fmt: skip


def restarts() -> Iterator[Case]:
    """Make the same header again where a logger was switched off and on."""
    cause = "the header again"
    for number, (name, layout, above, places) in enumerate((
        ("Cycle Analyst, tabs", Layout("\t"), (), (70,)),
        ("twice", Layout(";"), (), (50, 120)),
        ("three times, one behind the other", Layout(","), (), (40, 41, 99)),
        ("a preamble again", Layout(";", before=("Logger 7", "Firmware;2.4")),
         ("Logger 7", "Firmware;2.4"), (80,)),
        ("a row of units again", Layout("\t", below=(("s", "A", "W", "°C", "°C"),)), (), (90,)),
        ("in quotes", Layout(row=lambda row: ",".join(f'"{cell}"' for cell in row)), (), (110,)),
        ("a blank line before", Layout(","), ("",), (60,)),
        ("at the end", Layout(";"), (), (160,)),
    ), 1540):  # fmt: skip
        heads = "t|I|P|T_a|T_w" if layout.below else HEADS
        sheet = made(number, heads)
        join = layout.row or layout.delimiter.join
        again = [*above, join(heads.split("|")), *(join(list(row)) for row in layout.below)]

        def rows(lines: list[str], places: tuple = places, again: list[str] = again) -> list[str]:
            for place in reversed(places):
                lines = [*lines[:place], *again, *lines[place:]]
            return lines

        yield sheet.case(cause, name, READ, replace(layout, rows=rows), columns=names_of(sheet))


SOURCES = (headers, signs, encodings, rates, clocks, unit_rows, orders, restarts)
