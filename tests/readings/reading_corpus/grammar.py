"""A plain record, changed at random where its meaning does not change, or changes as it says.

Bytes are choices: each takes the next one. What comes out is a file with what it states kept beside
it; whatever the choices are, a reader must read what is stated, or ask.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from .case import Case, Truth
from .clocks import clock
from .headers import FORMS
from .numbers_text import NBSP, THIN, comma, grouped
from .rows import LOST, without
from .table import Layout, Sheet, sheet
from .units import CHANNELS, FIVE, SEVEN

Item = TypeVar("Item")
ROWS = 60
UNITS: dict[str, tuple[tuple[str, str], ...]] = {
    "time": (("s", "s"), ("min", "min"), ("ms", "ms"), ("h", "h"), ("min", "minutes")),
    "power": (("W", "W"), ("kW", "kW"), ("mW", "mW"), ("MW", "MW"), ("kW", "kilowatt")),
    "temperature": (("degC", "°C"), ("K", "K"), ("degF", "°F"), ("degC", "degC"), ("degF", "degF")),
    "current": (("A", "A"), ("mA", "mA"), ("kA", "kA"), ("A", "Arms"), ("A_peak", "A_peak")),
    "speed": (("rpm", "rpm"), ("rad/s", "rad/s"), ("krpm", "krpm"), ("rps", "rps")),
    "torque": (("Nm", "Nm"), ("mNm", "mNm"), ("kNm", "kNm"), ("Ncm", "Ncm")),
}
"""Unit and how it is written."""
LINES: tuple[tuple[str, Callable[[str, str], str]], ...] = (
    ("empty cells", lambda line, d: d * line.count(d)),
    ("blank", lambda line, d: ""),
    ("spaces", lambda line, d: "  "),
    ("short", lambda line, d: d.join(line.split(d)[:2])),
    ("long", lambda line, d: line + d + "7"),
    ("words", lambda line, d: "pause"),
    ("NaN", lambda line, d: d.join(["NaN"] * (line.count(d) + 1))),
    ("control Z", lambda line, d: line.rpartition(d)[0] + d + "\x1a"),
)
CLOCKS = (
    ("time [hh:mm:ss]", "{H:02}:{m:02}:{s:02}", 1.0),
    ("time [mm:ss]", "{M:02}:{s:02}", 1.0),
    ("time [hh:mm]", "{H:02}:{m:02}", 60.0),
    ("time", "{H:02}:{m:02}:{s:02}", 2.0),
    ("time [d:hh:mm]", "{d}:{h:02}:{m:02}", 60.0),
    ("time", "{M:02}:{s:02}", 1.0),
    ("time", "{H:02}:{m:02}", 60.0),
)


class Choices:
    """Takes choices from bytes; at their end every choice is the first."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def below(self, limit: int) -> int:
        """Return a number from 0 to below the limit."""
        value = self.data[self.at] if self.at < len(self.data) else 0
        self.at += 1
        return value % limit

    def of(self, items: Sequence[Item]) -> Item:
        """Return one of these."""
        return items[self.below(len(items))]


def headed(choices: Choices, delimiter: str) -> tuple[dict, dict, dict, tuple[str, ...], set]:
    """Return units, headers, [columns], a row of units (or none) and which contradict."""
    units, headers, columns = {}, {}, {}
    channels = choices.of((FIVE, SEVEN))
    in_row = choices.below(3) == 1
    row, contradict = [], set()
    for channel in channels:
        unit, written = choices.of(UNITS[CHANNELS[channel][0]])
        units[channel] = unit
        form = "{n}" if in_row else choices.of(FORMS)[1]
        header = form.format(n=CHANNELS[channel][2], u=written)
        columns[channel] = header
        if not in_row and choices.below(12) == 1:
            other = choices.of(UNITS[CHANNELS[channel][0]])
            # A letter, or min, may be part of a name; a bracket behind it then says the unit.
            if other[0] != unit and len(written) > 1 and written != "min":
                header = f"{header} [{other[1]}]"
                contradict.add(channel)
                # A bracket in [columns] would decide it.
                del columns[channel]
        headers[channel] = f'"{header}"' if delimiter in header else header
        row.append(written)
    return units, headers, columns, tuple(row) if in_row else (), contradict


def numbers(choices: Choices, made: Sheet, delimiter: str) -> tuple[Sheet, str]:
    """Write the numbers otherwise; the same in all columns, so that nothing is open."""
    style = choices.of(("plain", "comma", "exponent", "thousands", "padded", "plus"))
    if style == "comma" and delimiter != ",":
        return made.with_cells("*", comma), style
    if style == "exponent":
        return made.with_cells("*", lambda cell: f"{float(cell):.9E}"), style
    if style == "thousands" and delimiter != ",":
        mark, point = choices.of(((".", ","), (NBSP, ","), ("'", "."), (",", "."), (THIN, ",")))
        return made.with_cells("*", grouped(mark, point)), f"{style} {mark!r}"
    if style == "padded":
        return made.with_cells("*", lambda cell: f" {cell} "), style
    if style == "plus":
        return made.with_cells("*", lambda cell: f"+{cell}"), style
    return made, "plain"


def stated(data: bytes) -> Case:
    """Return the file that these choices make, with what it states."""
    choices = Choices(data)
    number = choices.below(8)
    delimiter = choices.of((",", ";", "\t", "|"))
    units, headers, columns, row, contradict = headed(choices, delimiter)
    channels = tuple(units)
    timing = choices.of(("column", "column", "clock", "rate"))
    if timing != "column":
        contradict.discard("time_s")
    truth = Truth.CONFLICT if contradict else Truth.READ
    step_s, cells, written_s = 1.0, {}, None
    if timing == "clock":
        index = choices.below(len(CLOCKS))
        header, form, step_s = CLOCKS[index]
        headers["time_s"], units["time_s"], written_s = header, "s", 1e-4
        columns.pop("time_s", None)
        cells = {"time_s": clock(form)}
        row = ("", *row[1:]) if row else row
        # Of two numbers with a colon, hours and minutes are as good as minutes and seconds.
        truth = Truth.ASK if index > 4 and not contradict else truth
    # Eight digits of the largest value, and at least three behind the point.
    made = sheet(
        number, rows=ROWS, step_s=step_s, channels=channels, units=units, headers=headers,
        cells=cells, written_s=written_s,
    )  # fmt: skip
    clocked = made.columns[0] if timing == "clock" else None
    made, style = numbers(choices, replace(made, columns=made.columns[1:]) if clocked else made,
                          delimiter)  # fmt: skip
    if clocked:
        made = replace(made, columns=(clocked, *made.columns))
    if timing == "rate":
        made = replace(made, columns=made.columns[1:], tolerance={**made.tolerance, "time_s": 1e-6})
        columns["time_s"], row = "rate 1 Hz", row[1:]
    before = choices.of(((), ("# bench 3",), ("Bench 3", ""), ("# Chiller 10 kW, 25 °C",)))
    change, lost, true_faults = None, made.truth, frozenset()
    kind = "whole"
    if choices.below(3) == 1:
        kind, text = choices.of(LINES)
        places = sorted({5 + choices.below(50) for _ in range(1 + choices.below(4))})
        lost, true_faults = without(made.truth, places), LOST
        truth = Truth.ASK if truth is Truth.READ else truth

        def change(lines: list[str]) -> list[str]:
            return [text(line, delimiter) if i in places else line for i, line in enumerate(lines)]

    layout = Layout(
        delimiter=delimiter, before=before, rows=change,
        newline=choices.of(("\n", "\r\n")), encoding=choices.of(("utf-8", "utf-8-sig", "utf-16")),
        **{choices.of(("below", "above")): (row,) if row else ()},
    )  # fmt: skip
    name = ", ".join((timing, style, kind, *(c.header for c in made.columns)))
    return made.case(
        "statement", name, truth, layout, columns=columns, channels=lost, held=made.truth,
        true_faults=true_faults, subject=r"missing|gap|unit|hh:mm|mm:ss|says|byte|0x|contradict",
    )  # fmt: skip
