"""Unseen text files with numbers and times as programs of many countries write them."""

from collections.abc import Iterator
from datetime import timedelta
from itertools import count

from .case import Case, Truth
from .table import Layout
from .units import FIVE
from .unseen_file import START, beside, comma, made, names_of, stamp, unseen

READ = Truth.READ


def numbers() -> Iterator[Case]:
    """Make numbers as programs of other countries write them, of a machine with kilowatts."""
    sheet = made(923, digits={"losses_W": 2})
    for name, change in (
        ("Swiss thousands", lambda x: f"{float(x):,.2f}".replace(",", "'")),
        ("Swiss thousands of typesetters", lambda x: f"{float(x):,.2f}".replace(",", "\u2019")),
        ("Fortran exponents", lambda x: f"{float(x):.9E}".replace("E", "D")),
    ):
        yield unseen(name, READ, sheet.with_cells("losses_W", change), Layout(";"), mapped=False)
    for name, marks in (
        ("narrow blanks for thousands", {44: "\u202f", 46: ","}),
        ("German thousands", {44: ".", 46: ","}),
    ):
        german = comma(sheet).with_cells(
            "losses_W", lambda x, m=marks: f"{float(x.replace(',', '.')):,.2f}".translate(m)
        )
        yield unseen(name, READ, german, Layout(";"), mapped=False)
    loss = sheet.headed({"losses_W": "P"})
    for name, change in (
        ("the unit in each cell", lambda x: f"{x} W"),
        ("kW in each cell", lambda x: f"{float(x) / 1000:.5f} kW"),
    ):
        yield unseen(name, READ, loss.with_cells("losses_W", change), columns={"losses_W": "P"})


def times() -> Iterator[Case]:
    """Make times that are stated."""
    n = count(930)
    five = "|".join(FIVE[1:])
    for name, head, clock in (
        ("durations of MATLAB", "Time", lambda x: f"{x:g} sec"),
        ("durations of MATLAB in minutes", "Time", lambda x: f"{x / 60:.6f} min"),
        ("durations of pandas", "elapsed", lambda x: f"0 days {timedelta(seconds=x)!s:0>8}"),
        ("durations of ISO 8601", "elapsed", lambda x: f"PT{int(x // 60)}M{x % 60:g}S"),
        ("mm:ss by its header", "t [mm:ss]", lambda x: f"{int(x // 60):02d}:{int(x % 60):02d}"),
        ("h:mm:ss by its header", "t (h:mm:ss)", lambda x: str(timedelta(seconds=x))),
        ("commas before milliseconds", "asctime", lambda x: stamp("%Y-%m-%d %H:%M:%S")(x) + ",000"),
        ("basic ISO dates", "stamp", stamp("%Y%m%dT%H%M%S")),
        ("English months", "stamp", lambda x: '"' + stamp("%B %d, %Y %I:%M:%S %p")(x) + '"'),
        ("short months", "stamp", stamp("%d-%b-%Y %H:%M:%S")),
        ("French months", "date", lambda x: stamp("3 août %Y %H:%M:%S")(x)),
        ("noon by twelve hours", "clock", lambda x: stamp("%I:%M:%S %p")(x + 6300)),
        ("epoch in ms", "timestamp_ms", lambda x: str(1714730000000 + int(x * 1000))),
        ("epoch in us", "ts_us", lambda x: str(1714730000000000 + int(x * 1e6))),
        ("epoch in ns", "time (ns)", lambda x: str(1714730000000000000 + int(x * 1e9))),
        ("summer time with offsets", "stamp", lambda x: (
            f"2024-03-31T01:{58 + int(x // 60):02d}:{int(x % 60):02d}+01:00" if x < 120 else
            f"2024-03-31T03:{int(x // 60) - 2:02d}:{int(x % 60):02d}+02:00")),
        ("the day turns in a date", "stamp", lambda x: (
            START + timedelta(hours=13, minutes=45, seconds=x)).isoformat()),
    ):  # fmt: skip
        sheet = made(next(n), f"{head}|{five}", clock=clock,
                     written_s=1e-4 if "minutes" in name else 0.0)  # fmt: skip
        content = Layout(";") if name == "commas before milliseconds" else None
        yield unseen(name, READ, sheet, content, columns={"time_s": head})
    for name, shift in (("date and clock apart", 0.0), ("date and clock apart at midnight", 49500)):
        sheet = made(next(n), f"Time|{five}", clock=lambda x, s=shift: stamp("%H:%M:%S")(x + s))
        sheet = beside(sheet, "Date", lambda i, s=shift: stamp("%Y-%m-%d")(5 * i + s), 0)
        yield unseen(name, READ, sheet, columns={"time_s": "Time"})
    sheet = made(next(n), f"t [min]|{five}", "min - - - -", step_s=60.0)
    yield unseen("whole minutes", READ, sheet, columns=names_of(sheet))


SOURCES = (numbers, times)
