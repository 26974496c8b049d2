"""Delimiters, encodings, preambles and quotes."""

from collections.abc import Iterator

from .case import Case, Truth
from .numbers_text import NBSP, comma
from .table import Layout, sheet
from .units import FIVE, SEVEN

LAYOUT = "layout and encoding"
GERMAN = {
    "time_s": "Zeit [s]", "phase_current_A": "Strom [A]", "losses_W": "Verluste [kW]",
    "ambient_degC": "T Umgebung [°C]", "winding_degC": "T Wicklung [°C]",
}  # fmt: skip


def chosen(headers: dict[str, str]) -> dict[str, str]:
    """Return `[columns]` that names these headers, as `heatrun init` would leave them."""
    return {channel: header for channel, header in headers.items() if channel != "time_s"}


def layouts() -> Iterator[Case]:
    """The same table in other clothes."""
    READ = Truth.READ
    for number, (name, layout) in enumerate((
        ("tab", Layout(delimiter="\t")), ("semicolon", Layout(delimiter=";")),
        ("bar", Layout(delimiter="|")), ("comma and space", Layout(delimiter=", ")),
        ("CRLF", Layout(newline="\r\n")), ("CR alone", Layout(newline="\r")),
        ("two spaces", Layout(delimiter="  ")), ("one space", Layout(delimiter=" ")),
        ("fixed width", Layout(row=lambda cells: "".join(f"{cell:>20}" for cell in cells))),
        ("delimiter at the end", Layout(row=lambda cells: ",".join(cells) + ",")),
        ("two delimiters at the end", Layout(row=lambda cells: ";".join(cells) + ";;")),
        ("delimiter in front", Layout(row=lambda cells: "," + ",".join(cells))),
        ("sep=;", Layout(delimiter=";", before=("sep=;",))),
        ("everything quoted", Layout(row=lambda cells: ",".join(f'"{cell}"' for cell in cells))),
        ("single quotes", Layout(row=lambda cells: ",".join(f"'{cell}'" for cell in cells))),
        ("no newline at the end", Layout(rows=lambda lines: lines[:-1], after=())),
        ("names behind #", Layout(row=None, before=())),
        ("blank lines at the end", Layout(after=("", "", ""))),
        ("UTF-8 with BOM", Layout(bom=b"\xef\xbb\xbf")),
        ("UTF-16 with BOM", Layout(encoding="utf-16")),
        ("UTF-16 LE without BOM", Layout(encoding="utf-16-le")),
        ("UTF-16 BE with BOM", Layout(encoding="utf-16-be", bom=b"\xfe\xff")),
        ("UTF-32", Layout(encoding="utf-32")),
    )):  # fmt: skip
        made = sheet(number, rows=200, units={"losses_W": "kW"}, channels=SEVEN)
        content = made.text(layout)
        if name == "names behind #":
            content = b"# " + content
        truth = made.truth
        if name == "no newline at the end":
            content = content[:-1]
            truth = {channel: values[:-1] for channel, values in truth.items()}
        odd = name in ("UTF-32", "delimiter in front", "single quotes", "UTF-16 LE without BOM",
                       "one space")  # fmt: skip
        yield made.case(LAYOUT, name, Truth.ASK if odd else READ, content, channels=truth)
    for number, encoding in enumerate(
        ("utf-8", "utf-8-sig", "cp1252", "latin-1", "utf-16", "cp850", "mac-roman")
    ):
        made = sheet(number, rows=200, units={"losses_W": "kW"}, headers=GERMAN)
        odd = encoding in ("cp850", "mac-roman")
        columns = chosen(GERMAN)
        if odd:  # what the user sees of a degree sign there is not what was meant
            columns |= {"ambient_degC": "T Umgebung [degC]", "winding_degC": "T Wicklung [degC]"}
        yield made.with_cells("*", comma).case(
            LAYOUT, f"German, {encoding}", Truth.ASK if odd else READ,
            Layout(delimiter=";", encoding=encoding, newline="\r\n"), columns=columns,
        )  # fmt: skip
        fahrenheit = {"winding_degC": "TC 1 [°F]", "ambient_degC": "TC 2 [°F]"}
        made = sheet(number, rows=200, headers=fahrenheit, units=dict.fromkeys(fahrenheit, "degF"))
        columns = chosen(fahrenheit)
        if odd:
            columns = {channel: text.replace("°", "deg") for channel, text in columns.items()}
        yield made.case(
            LAYOUT, f"degrees Fahrenheit, {encoding}", Truth.ASK if odd else READ,
            Layout(encoding=encoding), columns=columns,
        )  # fmt: skip
    for number, (name, lines) in enumerate((
        ("one line", ("Bench 3",)),
        ("ten lines", tuple(f"Key {i}: value {i}" for i in range(10))),
        ("forty lines", tuple(f"Channel {i} gain 1.0 offset 0.0" for i in range(40))),
        ("comments of #", ("# bench 3", "# 2024-05-17")),
        ("comments of %", ("% bench 3", "% operator W.")),
        ("comments of //", ("// bench 3",)),
        ("numbers in it", ("Version,1.20", "Channels,5,Rate,0.5", "1,2,3,4,5")),
        ("keys with units", ("Interval;2;s", "Range;600;V", "Filter;1;kHz")),
        ("a blank line below", ("Bench 3", "")),
        ("of as many cells as the table", ("a,b,c,d,e",)),
        ("key=value", ("[Header]", "Sensor=K", "Unit=none", "[Data]")),
        ("LabVIEW", ("LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tComma",
                     "X_Columns\tOne", "***End_of_Header***\t")),
    )):  # fmt: skip
        made = sheet(number, rows=200, units={"losses_W": "kW"})
        hard = name in ("numbers in it", "of as many cells as the table")
        yield made.case(LAYOUT, f"preamble {name}", Truth.ASK if hard else READ,
                        Layout(before=lines))  # fmt: skip
    made = sheet(1, rows=200, units={"losses_W": "kW"}, headers={"losses_W": '"losses\n[kW]"'})
    yield made.case(LAYOUT, "a name of two lines", Truth.ASK, columns={"losses_W": "losses [kW]"})
    made = sheet(
        2, rows=200, units={"losses_W": "kW"}, headers={"losses_W": '"losses ""sum"" [kW]"'}
    )
    yield made.case(LAYOUT, "quotes in a name", READ, columns={"losses_W": 'losses "sum" [kW]'})
    made = sheet(3, rows=200, headers={channel: f"{channel} " for channel in FIVE})
    yield made.case(LAYOUT, "spaces behind names", READ)
    made = sheet(3, rows=200, headers={channel: f"{NBSP}{channel}{NBSP}" for channel in FIVE})
    yield made.case(LAYOUT, "no-break spaces around names", READ)
    made = sheet(4, rows=200, headers={"stator_degC": ""}, channels=(*FIVE, "stator_degC"))
    yield made.case(LAYOUT, "a column without a name", READ,
                    channels={name: made.truth[name] for name in FIVE})  # fmt: skip
    made = sheet(5, rows=200)
    for name, mode in (("upper case", str.upper), ("title", str.title)):
        yield made.headed({channel: mode(channel) for channel in FIVE}).case(
            LAYOUT, f"names in {name}", Truth.ASK, subject="column|channel|unit"
        )
    # An index that is no time in front of the table.
    for number, name in enumerate(("", "Index", "No.", "Sample", "#")):
        made = sheet(number, rows=200)
        lines = made.text().decode().splitlines()
        text = "\n".join(
            [f"{name},{lines[0]}", *(f"{i},{line}" for i, line in enumerate(lines[1:]))]
        )
        truth = Truth.ASK if name == "#" else READ
        yield made.case(LAYOUT, f"index under {name!r} in front", truth, text.encode())
